"""Keypoint scores of other tools scaled to [0, 1], keeping their order.

A score is divided by its format's scale and clipped to [0, 1]; the order is kept, except that clipped scores
become equal. The tool's own score is stored too. This makes ranges equal, not meanings: 0.3 from one tool is
still not 0.3 from another.

A detector has one scale, independent of the highest score in a folder: 1, or if scores exceed it, the user
has to give the scale. OpenPose's confidences lie in [0, 1]; AlphaPose's heat-map maxima and Detectron2's
softmax mass can exceed 1 slightly. MMPose's can be those of RTMW, which reach about 10, and so can plain COCO
results.
"""

from hicp_lib.core.errors import InputError
from hicp_lib.formats.importers.people import People

_RTMW_SCALE, _RTMW_UP_TO = 10.0, 20.0
_WITH_RTMW = ("mmpose", "coco")
_A_LITTLE_MORE = 2.0  # than 1


def score_scale(format: str, people: People) -> float:
    """The number by which keypoint scores of this format are divided.

    Parameters
    ----------
    format : str
        The tool's.
    people : People
        All people that it found.

    Returns
    -------
    float

    Raises
    ------
    InputError
        If they exceed 1, so that the scale is ambiguous.
    """
    highest = people.raw_scores.max(initial=0.0)
    if highest <= (1.0 if format in _WITH_RTMW else _A_LITTLE_MORE):
        return 1.0
    known = highest <= _RTMW_UP_TO and format in _WITH_RTMW
    rtmw = f" ({_RTMW_SCALE:g} if RTMW wrote them; if not, 1, and what passes it is cut)" if known else ""
    raise InputError(
        f"{people.path}: keypoint scores go up to {highest:.4g}; give --score-scale, the score that is to "
        f"become 1{rtmw}, the same for every folder of this detector"
    )

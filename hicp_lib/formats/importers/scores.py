"""Keypoint scores of other tools brought into [0, 1], in order.

A score is divided by its format's scale and cut to [0, 1], where order is kept, though what was cut becomes
equal; the tool's own score stays beside it. This makes ranges equal, not meanings: 0.3 of one tool is still
not 0.3 of another.

A detector has one scale, whatever the highest score in a folder is: 1, or where scores pass that it is asked
for. OpenPose's confidences lie in [0, 1]; AlphaPose's heat-map maxima and Detectron2's softmax mass can pass
1 by a little. MMPose's can be those of RTMW, which reach about 10, and so can plain COCO results.
"""

from hicp_lib.core.errors import InputError
from hicp_lib.formats.importers.people import People

_RTMW_SCALE, _RTMW_UP_TO = 10.0, 20.0
_WITH_RTMW = ("mmpose", "coco")
_A_LITTLE_MORE = 2.0  # than 1


def score_scale(format: str, people: People) -> float:
    """What keypoint scores of this format are divided by.

    Parameters
    ----------
    format : str
        The tool's.
    people : People
        All that it found.

    Returns
    -------
    float

    Raises
    ------
    InputError
        If they pass 1, and another scale may be meant.
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

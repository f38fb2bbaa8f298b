"""Keypoint scores of other tools brought into [0, 1], in order.

A score is divided by its format's scale and cut to [0, 1], where order is kept, though what was cut becomes
equal; the tool's own score stays beside it. This makes ranges equal, not meanings: 0.3 of one tool is still
not 0.3 of another.

- OpenPose, AlphaPose, Detectron2: scale 1. OpenPose's confidences lie in [0, 1]; heat-map maxima and
  Detectron2's softmax mass can pass 1 by a little.
- MMPose and plain COCO results: 1, or 10 when a score is above 2, which only RTMW's are (up to about 10).
  Between 1 and 2 both may be meant, and the network's next folder could fall on the other side: asked for.
- Scores above 20 belong to no known scale, which must then be given.
"""

from hicp_lib.core.errors import InputError
from hicp_lib.formats.importers.people import People

_WITH_RTMW = ("mmpose", "coco")
_RTMW_SCALE, _SURELY_RTMW_FROM, _RTMW_UP_TO = 10.0, 2.0, 20.0


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
        If the scores fit no known scale, or more than one.
    """
    highest = people.raw_scores.max(initial=0.0)
    if highest > _RTMW_UP_TO:
        raise InputError(
            f"{people.path}: keypoint scores go up to {highest:g}; expected at most {_RTMW_UP_TO:g}, "
            "or give --score-scale, the score that is to become 1"
        )
    if format not in _WITH_RTMW or highest <= 1:
        return 1.0
    if highest <= _SURELY_RTMW_FROM:
        raise InputError(
            f"{people.path}: keypoint scores go up to {highest:g}, as those of two scales may; give "
            f"--score-scale {_RTMW_SCALE:g} if RTMW wrote them, else --score-scale 1"
        )
    return _RTMW_SCALE

"""Open choices of COCO's protocol: which keypoints count, how strictly, and what an object is.

The options cover what tools and papers leave open or do differently; the defaults are the rules of COCO and
COCO-WholeBody with Halpe's sigmas:

- `sigmas`: "halpe" (every hand keypoint .015) or "wholebody" (.017-.047); the body's 17 are the same.
- `labelled`, the keypoints that count: "all" with a label, or "visible": those whose flag says so (2; COCO's
  1 is occluded). Annotators leave many invisible keypoints unlabelled; rendered people have them all.
- `outside`, keypoints known to lie outside the picture: "ignore" (OKS), or "count" (`extended_oks`: a
  keypoint with a score of at least .5 is declared present, which is an error if it is outside).
- `area`, the s² of OKS: "segment" (annotated), "box" (width x height), "box53" (0.53 of that, as tools
  do without segments), "source" (the segment before HiCP cut the head off; in HiCP folders only).
- `unlabelled`, people without a labelled keypoint of the group: "ignore" (COCO: they do not count, and
  detections near them are ignored) or "drop" (as if not there: such detections are false positives).
- `absent`, detections without a keypoint of the group: "drop" (COCO-WholeBody) or "count" (the Halpe
  tool: each a false positive).
- `others`, the other people in a HiCP crop: "ignore" (detections of them are ignored) or "count" (false
  positives).
- `score`, by which detections are ranked: "person", or "group": the mean score of the object's keypoints, 0
  for a missing one, as it adds 0 to OKS. Bodies use the first; hands the second, since the score of a person
  is that of the body (COCO-WholeBody nevertheless ranks hands by it).

Both hands of a person are one object of 42 keypoints with sigma .015, as in the Halpe tool (AlphaPose's):
with one of them missing its OKS is at most about .5. "each hand" follows COCO-WholeBody: every hand is an
object of 21, matched only on its own side, with that data set's sigmas.

A missing keypoint adds 0 to OKS. Crowds are ignored. The 20 best detections of an image are used.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_type_hints

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import GROUPS, HANDS
from hicp_lib.formats.annotations import Annotations

VISIBLE = 2  # COCO's flag; labelled keypoints below it are occluded
_HAND_OPTIONS = {"score": "group"}
_EACH_HAND_OPTIONS = {"score": "group", "sigmas": "wholebody"}
# Per group, the keypoints of each object of a person, and default options.
OBJECTS: dict[str, tuple[np.ndarray, dict[str, str]]] = {
    "body": (GROUPS["body"][None], {}),
    "below the head": (GROUPS["body"][None, 5:], {}),
    "hand": (HANDS[None], _HAND_OPTIONS),
    "each hand": (HANDS.reshape(2, -1), _EACH_HAND_OPTIONS),
    "left hand": (HANDS[None, :21], _EACH_HAND_OPTIONS),
    "right hand": (HANDS[None, 21:], _EACH_HAND_OPTIONS),
}


@dataclass(frozen=True)
class Options:
    """The options of an evaluation, explained in this module's docstring.

    Raises
    ------
    InputError
        For an unknown value.

    Examples
    --------
    >>> Options(area="bbox")
    Traceback (most recent call last):
    hicp_lib.core.errors.InputError: option area='bbox': expected one of segment, box, box53, source
    """

    sigmas: Literal["halpe", "wholebody"] = "halpe"
    labelled: Literal["all", "visible"] = "all"
    outside: Literal["ignore", "count"] = "ignore"
    area: Literal["segment", "box", "box53", "source"] = "segment"
    unlabelled: Literal["ignore", "drop"] = "ignore"
    absent: Literal["drop", "count"] = "drop"
    others: Literal["ignore", "count"] = "ignore"
    score: Literal["person", "group"] = "person"

    def __post_init__(self) -> None:
        for name, kind in get_type_hints(Options).items():
            if getattr(self, name) not in get_args(kind):
                expected = ", ".join(get_args(kind))
                raise InputError(f"option {name}={getattr(self, name)!r}: expected one of {expected}")


def definitions(annotations: Annotations, group: str) -> list[tuple[str, dict[str, str]]]:
    """Definitions to report side by side: groups and options, the usual ones first.

    Hands as one object and every hand alone; all labelled keypoints and, if some are marked occluded, the
    visible ones; if some are known to lie outside the picture, including these.
    """
    flags = annotations.visibility
    occluded, outside = (flags > 0) & (flags < VISIBLE), flags < 0  # all 1: no information
    groups = (group, "each hand") if group == "hand" else (group,)
    ways = [{"labelled": "all"}]
    ways += [{"labelled": "visible"}] if occluded.any() and (flags >= VISIBLE).any() else []
    ways += [{"labelled": "all", "outside": "count"}] if outside.any() else []
    return [(of, way) for of in groups for way in ways]


def choose(group: str, options: Mapping[str, Any]) -> tuple[np.ndarray, Options]:
    """The keypoints of a group's objects, shape (n_objects, k), and its options with the given ones applied.

    Raises
    ------
    InputError
        For an unknown group.
    """
    if group not in OBJECTS:
        raise InputError(f"group {group!r}: expected one of {', '.join(OBJECTS)}")
    objects, defaults = OBJECTS[group]
    return objects, Options(**defaults | dict(options))

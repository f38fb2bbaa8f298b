"""What a detector takes for granted about a model file, and what the others take, for people to read."""

from typing import NamedTuple


class Fact(NamedTuple):
    """One property of a model.

    Attributes
    ----------
    what, value : str
    why : str
        How the value is known.
    """

    what: str
    value: str
    why: str


KNOWN_NETWORKS = (
    "mmpose (crops (n, 3, h, w) in; heat maps (n, k, h, w), or SimCC x, y and perhaps z, (n, k, bins), out), "
    "alphapose (crops in; heat maps out), "
    "openpose (image (1, 3, h, w) in; 57 or 78 maps at an eighth out, for hands 22), "
    "detectron2 (image (3, h, w) in; boxes, scores, keypoints (n, 17, 3) or maps (n, 17, h, w) out), "
    "one-stage (image in; RTMO's dets (1, n, 5) and keypoints (1, n, k, 3), or YOLO-pose's (1, 5 + 3 k, n) "
    "or (1, n, 6 + 3 k), out), "
    "person models (image in; dets (1, n, 5), or YOLOX's (1, cells, 5 + classes), out); "
    "k is 14 (CrowdPose), 17 (COCO), 21 (hand), 26, 68, 136 (Halpe) or 133 (COCO-WholeBody)"
)
"""The networks that the detectors take, in one line."""

"""AlphaPose's networks on the user's own weights: boxes, one pass per person, poses merged."""

from functools import partial
from pathlib import Path

import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.detectors.onnx import pose_nms
from hicp_lib.detectors.onnx.affine import Regions
from hicp_lib.detectors.onnx.box_source import BoxSource
from hicp_lib.detectors.onnx.decode import decode_combined, decode_integral, decode_quarter
from hicp_lib.detectors.onnx.facts import Fact
from hicp_lib.detectors.onnx.pose_net import Decoder, PoseNet
from hicp_lib.detectors.onnx.session import open_model

_N_FACE_AND_HANDS = 110
# By the name of the decoding: how heat maps are read, and what a keypoint's score is.
_DECODINGS: dict[str, tuple[Decoder, str]] = {
    "heatmap": (partial(decode_quarter, needs_both_axes=True), "maximum of the map"),
    "integral": (decode_integral, "maximum of the map's sigmoid"),
    "combined": (
        partial(decode_combined, n_integral=_N_FACE_AND_HANDS),
        "maximum of the map; of its sigmoid for face and hands",
    ),
}
# Taken off the R, G and B values, which are then divided.
_MEAN, _STD = (0.406 * 255, 0.457 * 255, 0.480 * 255), (255.0,) * 3
# Weight of the greatest keypoint score in a person's score.
_GREATEST_WEIGHT = 1.25


class AlphaPose:
    """AlphaPose's networks (FastPose and others) with 17, 26, 68, 133 or 136 keypoints.

    Parameters
    ----------
    model : str or Path
        ONNX export.
    person_model : str or Path, optional
    boxes : str, optional
        See `hicp_lib.detectors.onnx.box_source.BoxSource`.
    decoding : str, optional
        "heatmap", "integral" (symmetric integral regression) or "combined" (face and hands integral); if
        None, told by the network's answer to the mean colour.
    flip_test : bool
    provider : str
    threads : int
        As for `hicp_lib.detectors.onnx.mmpose.MMPose`.
    """

    name = "alphapose"

    def __init__(
        self,
        model: str | Path,
        person_model: str | Path | None = None,
        boxes: str | None = None,
        decoding: str | None = None,
        flip_test: bool = False,
        provider: str = "cpu",
        threads: int = 1,
    ) -> None:
        opened = open_model(model, provider, threads)
        self._is_told = decoding is None
        self.decoding = decoding or _told_decoding(opened.response_to_zeros)
        if self.decoding not in _DECODINGS:
            raise InputError(f"decoding {decoding!r}: not known; expected one of: {', '.join(_DECODINGS)}")
        self._net = PoseNet(opened, _MEAN, _STD, _DECODINGS[self.decoding][0], flip_test)
        if self._net.is_simcc:
            raise InputError(f"{model}: gives SimCC vectors; expected heat maps, or use detector mmpose")
        self._rules = _rules(self._net, self.decoding)
        self._boxes = BoxSource(boxes, person_model, provider, threads)
        self.takes_boxes = self._boxes.kind == "gt"
        self.settings = {"model": opened.settings, "decoding": self.decoding, "flip_test": flip_test}
        self.settings |= self._boxes.settings

    def detect(self, image: np.ndarray, boxes_px: np.ndarray | None = None) -> Detections:
        """Find people in an RGB image; parameters as in `MMPose.detect`."""
        boxes, box_scores = self._boxes.find(image, boxes_px)
        if not len(boxes):
            return Detections.none()
        regions = Regions.around(boxes, self._net.input_size_px)
        positions_px, scores = self._net.find(image, regions)
        rows, positions_px, scores = pose_nms.merge_poses(positions_px, scores, boxes, self._rules)
        greatest = scores.max(axis=1, initial=0)
        person_scores = scores.mean(axis=1) + box_scores[rows] + _GREATEST_WEIGHT * greatest
        return Detections.of_parts(positions_px, np.clip(scores, 0, 1), person_scores, self._net.convention)

    def describe(self) -> list[Fact]:
        """What is taken for granted about the model."""
        told = "told by the network's answer to the mean colour" if self._is_told else "given"
        return [
            *self._net.describe(),
            Fact("pixels", "RGB / 255 - (0.406, 0.457, 0.480)", "as AlphaPose trains"),
            Fact("decoding", self.decoding, f"{told}; option decoding"),
            Fact("keypoint score", _DECODINGS[self.decoding][1] + ", cut off at 1", "as AlphaPose"),
            Fact("person score", f"mean + {_GREATEST_WEIGHT} x greatest keypoint score + box score",
                 "as AlphaPose; pose-NMS"),
            *self._boxes.describe(),
        ]  # fmt: skip


def _told_decoding(outputs: list[np.ndarray]) -> str:
    """Heat maps stay near 0 where nobody is; logits for integral regression lie far below."""
    if len(outputs) != 1 or outputs[0].ndim != 4:
        return "heatmap"
    is_logits = np.median(outputs[0][0], axis=(1, 2)) < -1
    if is_logits.all():
        return "integral"
    n_keypoints = len(is_logits)
    whole_body = n_keypoints > _N_FACE_AND_HANDS and is_logits[-_N_FACE_AND_HANDS:].mean() > 0.5
    return "combined" if whole_body else "heatmap"


def _rules(net: PoseNet, decoding: str) -> pose_nms.PoseNmsRules:
    if net.convention not in ("halpe136", "wholebody133"):
        if decoding == "combined":
            raise InputError(
                f"{net.model.path}: has no face and hands; expected decoding heatmap or integral for it"
            )
        return pose_nms.BODY_RULES
    return pose_nms.WHOLE_BODY_RULES if decoding == "heatmap" else pose_nms.INTEGRAL_RULES

"""AlphaPose's networks on the user's own weights: boxes, one pass per person, poses merged."""

from functools import partial
from pathlib import Path
from typing import Unpack

import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError, refuse_unknown
from hicp_lib.detectors.onnx import pose_nms
from hicp_lib.detectors.onnx.box_source import BoxOptions, BoxSource
from hicp_lib.detectors.onnx.decode import decode_combined, decode_integral, decode_quarter
from hicp_lib.detectors.onnx.fitting import Regions
from hicp_lib.detectors.onnx.pose_net import Decoder, PoseNet
from hicp_lib.detectors.onnx.session import TEXTS, Fact, OnnxModel, facts, open_model

# Points of face and hands at the end of a set, or of the hands alone.
_N_INTEGRAL = {"halpe136": 110, "wholebody133": 110, "halpe68_noface": 42}
# Meaning of a keypoint's score, by the name of the decoding.
_SCORES: dict[str, str] = TEXTS["alphapose scores"]
# Subtracted from the R, G and B values, which are then divided.
_MEAN, _STD = (0.406 * 255, 0.457 * 255, 0.480 * 255), (255.0,) * 3
# Weight of the greatest keypoint score in a person's score.
_GREATEST_WEIGHT = 1.25


class AlphaPose:
    """AlphaPose's networks (FastPose and others) with 17, 26, 68, 133 or 136 keypoints.

    Parameters
    ----------
    model : str or Path
        ONNX export.
    decoding : str, optional
        "heatmap", "integral" (symmetric integral regression) or "combined" (face and hands integral); if
        None, detected from the network's output for the mean colour.
    flip_test : bool
    input_size_px : list of int, optional
    **person_boxes : object
        See `hicp_lib.detectors.onnx.box_source.BoxOptions`.
    """

    name = "alphapose"

    def __init__(
        self,
        model: str | Path,
        decoding: str | None = None,
        flip_test: bool = False,
        input_size_px: list | None = None,
        **person_boxes: Unpack[BoxOptions],
    ) -> None:
        self._boxes = BoxSource(**person_boxes)
        opened = open_model(model, **self._boxes.run)
        self._net = PoseNet(opened, _MEAN, _STD, flip_test, input_size_px)
        if self._net.is_simcc:
            raise opened.refusal("SimCC vectors are not AlphaPose's; expected heat maps, or use mmpose")
        n_integral = _N_INTEGRAL.get(self._net.convention, 0)
        self._is_told = decoding is None
        self.decoding = decoding or _told_decoding(self._net.answer[0], n_integral)
        self._decode = _decoder(opened, self.decoding, n_integral)
        self._rules = _rules(self._net.convention, self.decoding)
        self.takes_boxes = self._boxes.kind == "gt"
        self.settings = {"model": opened.settings, "decoding": self.decoding, "flip_test": flip_test}
        self.settings |= self._boxes.settings

    def detect(self, image: np.ndarray, boxes_px: np.ndarray | None = None) -> Detections:
        """Find people in an RGB image; parameters as in `MMPose.detect`."""
        boxes, box_scores = self._boxes.find(image, boxes_px)
        if not len(boxes):
            return Detections.none()
        regions = Regions.around(boxes, self._net.input_size_px)
        positions_px, scores = self._net.find(image, regions, self._decode)
        rows, positions_px, scores = pose_nms.merge_poses(positions_px, scores, boxes, self._rules)
        greatest = scores.max(axis=1, initial=0)
        person_scores = scores.mean(axis=1) + box_scores[rows] + _GREATEST_WEIGHT * greatest
        return Detections.of_parts(positions_px, np.clip(scores, 0, 1), person_scores, self._net.convention)

    def describe(self) -> list[Fact]:
        """What is assumed about the model."""
        told = "from its output for the mean colour" if self._is_told else "given"
        score = {"score": _SCORES[self.decoding], "greatest_weight": _GREATEST_WEIGHT}
        own = facts("alphapose", told=told, **score, **self.settings)
        return [*self._net.describe(), *own, *self._boxes.describe()]


def _told_decoding(maps: np.ndarray, n_integral: int) -> str:
    """Without a person, heat maps stay near 0; logits for integral regression are far below."""
    is_logits = np.median(maps[0], axis=(1, 2)) < -1
    if is_logits.all():
        return "integral"
    return "combined" if n_integral and is_logits[-n_integral:].mean() > 0.5 else "heatmap"


def _decoder(model: OnnxModel, decoding: str, n_integral: int) -> Decoder:
    refuse_unknown("decoding", decoding, _SCORES)
    if decoding == "combined":
        if not n_integral:
            raise InputError(f"{model.path}: has no face and hands; expected decoding heatmap or integral")
        return partial(decode_combined, n_integral=n_integral)
    return decode_integral if decoding == "integral" else partial(decode_quarter, needs_both_axes=True)


def _rules(convention: str, decoding: str) -> pose_nms.PoseNmsRules:
    if convention not in ("halpe136", "wholebody133"):
        return pose_nms.BODY_RULES
    return pose_nms.WHOLE_BODY_RULES if decoding == "heatmap" else pose_nms.INTEGRAL_RULES

"""AlphaPose's networks on the user's own weights: boxes, one pass per person, poses merged."""

from pathlib import Path
from typing import Unpack

import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError, refuse_unknown
from hicp_lib.detectors.onnx import pose_nms
from hicp_lib.detectors.onnx.decode import Decoded, decode_combined, decode_integral, decode_quarter
from hicp_lib.detectors.onnx.fitting import Regions
from hicp_lib.detectors.onnx.session import TEXTS, Fact, facts
from hicp_lib.detectors.onnx.top_down import TopDown, TopDownOptions

# Points of face and hands at the end of a set, or of the hands alone.
_N_INTEGRAL = {"halpe136": 110, "wholebody133": 110, "halpe68_noface": 42}
# Meaning of a keypoint's score, by the name of the decoding.
_SCORES: dict[str, str] = TEXTS["alphapose scores"]
# Subtracted from the R, G and B values, which are then divided.
_MEAN, _STD = (0.406 * 255, 0.457 * 255, 0.480 * 255), (255.0,) * 3
# Weight of the greatest keypoint score in a person's score.
_GREATEST_WEIGHT = 1.25


class AlphaPose(TopDown):
    """AlphaPose's networks (FastPose and others) with 17, 26, 68, 133 or 136 keypoints.

    Parameters
    ----------
    model : str or Path
        ONNX export.
    decoding : str, optional
        "heatmap", "integral" (symmetric integral regression) or "combined" (face and hands integral); if
        None, detected from the network's output for the mean colour.
    **options : object
        See `hicp_lib.detectors.onnx.top_down.TopDownOptions`.
    """

    name = "alphapose"

    def __init__(
        self, model: str | Path, decoding: str | None = None, **options: Unpack[TopDownOptions]
    ) -> None:
        super().__init__(model, _MEAN, _STD, **options)
        if self.is_simcc:
            raise self.model.refusal("SimCC vectors are not AlphaPose's; expected heat maps, or use mmpose")
        self._n_integral = _N_INTEGRAL.get(self.convention, 0)
        self._is_told = decoding is None
        self.decoding = decoding or _told_decoding(self.answer[0], self._n_integral)
        refuse_unknown("decoding", self.decoding, _SCORES)
        if self.decoding == "combined" and not self._n_integral:
            raise InputError(f"{model}: has no face and hands; expected decoding heatmap or integral")
        self._rules = _rules(self.convention, self.decoding)
        self.settings["decoding"] = self.decoding

    def _decode_maps(self, maps: np.ndarray) -> Decoded:
        """As of `TopDown`."""
        if self.decoding == "combined":
            return decode_combined(maps, self._n_integral)
        return (
            decode_integral(maps)
            if self.decoding == "integral"
            else decode_quarter(maps, needs_both_axes=True)
        )

    def _people(
        self, found: Decoded, box_scores: np.ndarray, boxes: np.ndarray, regions: Regions
    ) -> Detections:
        """As of `TopDown`: poses merged."""
        rows, positions_px, scores = pose_nms.merge_poses(*found, boxes, self._rules)
        greatest = scores.max(axis=1, initial=0)
        person_scores = scores.mean(axis=1) + box_scores[rows] + _GREATEST_WEIGHT * greatest
        return Detections.of_parts(positions_px, np.clip(scores, 0, 1), person_scores, self.convention)

    def describe(self) -> list[Fact]:
        """What is assumed about the model."""
        told = "from its output for the mean colour" if self._is_told else "given"
        score = {"score": _SCORES[self.decoding], "greatest_weight": _GREATEST_WEIGHT}
        return self.described(facts("alphapose", told=told, **score, **self.settings))


def _told_decoding(maps: np.ndarray, n_integral: int) -> str:
    """Without a person, heat maps stay near 0; logits for integral regression are far below."""
    is_logits = np.median(maps[0], axis=(1, 2)) < -1
    if is_logits.all():
        return "integral"
    return "combined" if n_integral and is_logits[-n_integral:].mean() > 0.5 else "heatmap"


def _rules(convention: str, decoding: str) -> pose_nms.PoseNmsRules:
    if convention not in ("halpe136", "wholebody133"):
        return pose_nms.BODY_RULES
    return pose_nms.WHOLE_BODY_RULES if decoding == "heatmap" else pose_nms.INTEGRAL_RULES

"""MMPose's top-down networks on the user's own weights: boxes, then one pass and one pose per person."""

from pathlib import Path
from typing import Unpack

import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import refuse_unknown
from hicp_lib.core.keypoints import SIGMAS, TO_HALPE
from hicp_lib.detectors.onnx.decode import Decoded, decode_dark, decode_dark_udp, decode_quarter
from hicp_lib.detectors.onnx.fitting import IMAGENET_RGB, Regions
from hicp_lib.detectors.onnx.pose_nms import oks_nms
from hicp_lib.detectors.onnx.session import Fact, OnnxModel, facts
from hicp_lib.detectors.onnx.top_down import TopDown, TopDownOptions

# RTMW's head enlarges features by shuffling pixels; the other SimCC heads do not. Its scores reach about ten.
_RTMW_OPERATOR, _RTMW_SCALE = "DepthToSpace", 10.0
# Vision transformers (ViTPose, Sapiens) first cut the crop into patches, and all were trained with UDP;
# convolutional networks (HRNet, CSPNeXt) look the same with and without.
_MIN_PATCH_PX = 14
# Keypoints with a network score above this are averaged for a person's score.
_MIN_COUNTED_SCORE = 0.2


class MMPose(TopDown):
    """MMPose's top-down networks: heat maps (HRNet, ViTPose) and SimCC (RTMPose, DWPose, RTMW, RTMW3D).

    Parameters
    ----------
    model : str or Path
        ONNX export, whole body (133 points), Halpe (26, 136), COCO (17), CrowdPose (14) or one hand (21).
    dark : bool
        Decode heat maps aware of their distribution (the "dark" configurations).
    udp : bool, optional
        The network was trained with unbiased data processing ("udp" configurations, ViTPose, Sapiens): its
        transform and decoding; if None, detected from the file's metadata `udp` or its patches, else False.
    score_scale : float, optional
        Network score that counts as 1; if None, 10 for RTMW's head and 1 otherwise.
    hand : str
        "left" or "right", the hand that a one-hand network sees.
    **options : object
        See `hicp_lib.detectors.onnx.top_down.TopDownOptions`.
    """

    name = "mmpose"

    def __init__(
        self, model: str | Path, dark: bool = True, udp: bool | None = None, score_scale: float | None = None,
        hand: str = "right", **options: Unpack[TopDownOptions],
    ) -> None:  # fmt: skip
        super().__init__(model, *IMAGENET_RGB, **options)
        self._dark = dark
        self.udp, self._udp_from = _told_udp(self.model, self.is_simcc, udp)
        if self.udp and (self.is_simcc or not dark):
            raise self.model.refusal("UDP is for heat maps decoded by DARK; leave out udp, or dark false")
        is_rtmw = self.is_simcc and _RTMW_OPERATOR in self.model.told.operators
        self._score_scale = score_scale or (_RTMW_SCALE if is_rtmw else 1.0)
        refuse_unknown("hand", hand, ("left", "right"))
        if self.convention.endswith("hand21"):
            self.convention = f"{hand}_hand21"
        self._sigmas = SIGMAS["wholebody"][TO_HALPE[self.convention]]
        self.settings |= {"score_scale": self._score_scale, "convention": self.convention}
        self.settings |= {"udp": self.udp, "dark": dark, "input_size_px": self.input_size_px}

    def _decode_maps(self, maps: np.ndarray) -> Decoded:
        """As of `TopDown`."""
        return (decode_dark_udp if self.udp else decode_dark if self._dark else decode_quarter)(maps)

    def _people(
        self, found: Decoded, box_scores: np.ndarray, boxes: np.ndarray, regions: Regions
    ) -> Detections:
        """As of `TopDown`: of two poses of one person, the better."""
        positions_px, raw_scores = found
        scores = np.clip(raw_scores / self._score_scale, 0, 1)
        person_scores = box_scores * _mean_above(raw_scores, _MIN_COUNTED_SCORE)
        keep = oks_nms(positions_px, person_scores, regions.sizes_px.prod(axis=1), self._sigmas)
        return Detections.of_parts(positions_px[keep], scores[keep], person_scores[keep], self.convention)

    def describe(self) -> list[Fact]:
        """What is assumed about the model."""
        transform = "UDP: sizes minus one" if self.udp else "classic, not UDP"
        how = {"transform": transform, "transform_from": self._udp_from, "least": _MIN_COUNTED_SCORE}
        how["decoding"] = "heat maps, DARK" if self._dark else "heat maps, quarter cell"
        return self.described(facts("mmpose SimCC" if self.is_simcc else "mmpose", **how, **self.settings))


def _told_udp(model: OnnxModel, is_simcc: bool, given: bool | None) -> tuple[bool, str]:
    """Whether a network was trained with unbiased data processing, and how that is known."""
    if given is not None:
        return given, "option udp"
    told = model.told.metadata.get("udp")
    if isinstance(told, bool):
        return told, "from its metadata"
    patch_px = min(model.told.first_convolution[2:], default=0)
    if is_simcc:
        return False, "from the outputs"
    if patch_px >= _MIN_PATCH_PX:
        return True, f"from its patches of {patch_px} pixels (ViTPose, Sapiens); option udp"
    return False, "ASSUMED, the file does not tell; -o udp true for networks named udp"


def _mean_above(scores: np.ndarray, least: float) -> np.ndarray:
    """Mean (n,) of the scores (n, k) above `least`; 0 if there are none."""
    counts = scores > least
    return np.where(counts, scores, 0).sum(axis=1) / np.maximum(counts.sum(axis=1), 1)

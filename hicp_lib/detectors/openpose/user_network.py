"""OpenPose's own networks on the user's weights: bodies of 18 or 25 parts, and hands.

What goes in is BGR, value / 256 - 0.5; what comes out is one heat map per part, one for the
background, and two affinity fields per limb, at an eighth of the input's size. Peaks, limbs
and people are read as OpenPose's program does. A hand is looked for in a square around the point a
third of the forearm beyond the wrist (Simon et al., "Hand keypoint detection in single images using
multiview bootstrapping", CVPR 2017), the left one mirrored: the network knows right hands.
"""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import INDEX, LEFT_HAND, RIGHT_HAND
from hicp_lib.detectors.onnx.facts import Fact
from hicp_lib.detectors.onnx.letterbox import planes
from hicp_lib.detectors.onnx.session import OnnxModel, open_model
from hicp_lib.detectors.openpose.mobilenet import COCO_18, STRIDE, as_detections, check_height, fit
from hicp_lib.detectors.openpose.paf import PafOptions, PartModel, assemble
from hicp_lib.detectors.openpose.released import assemble_released, enlarge

_BODY_25_LIMBS = {
    (1, 8): (0, 1), (1, 2): (14, 15), (1, 5): (22, 23), (2, 3): (16, 17), (3, 4): (18, 19),
    (5, 6): (24, 25), (6, 7): (26, 27), (8, 9): (6, 7), (9, 10): (2, 3), (10, 11): (4, 5),
    (8, 12): (8, 9), (12, 13): (10, 11), (13, 14): (12, 13), (1, 0): (30, 31), (0, 15): (32, 33),
    (15, 17): (36, 37), (0, 16): (34, 35), (16, 18): (38, 39), (2, 17): (20, 21), (5, 18): (28, 29),
    (14, 19): (40, 41), (19, 20): (42, 43), (14, 21): (44, 45), (11, 22): (46, 47), (22, 23): (48, 49),
    (11, 24): (50, 51),
}  # fmt: skip
BODY_25 = PartModel(
    convention="openpose_body25",
    n_parts=25,
    pairs=np.array(list(_BODY_25_LIMBS)),
    fields=np.array(list(_BODY_25_LIMBS.values())),
    completing=frozenset({18, 19}),
    uncounted=frozenset(range(19, 25)),
)
# By the number of heat maps, background included, and of fields.
_PART_MODELS = {(19, 38): COCO_18, (26, 52): BODY_25}
_HAND_SIDE_PX, _N_HAND, _MIN_ARM_SCORE = 368, 21, 0.03
# Where a hand's square lies and how large it is, in lengths of the forearm; smaller ones are not looked at.
_BEYOND_WRIST, _SQUARE_SIDE, _FOREARMS_PER_UPPER_ARM, _MIN_AREA_PX2 = 0.33, 1.5, 0.9, 10.0
_HANDS = {"left": LEFT_HAND, "right": RIGHT_HAND}


class OpenPose:
    """OpenPose's body networks (COCO, BODY_25), and its hand network.

    Parameters
    ----------
    model : str or Path
        ONNX conversion of a body network.
    hand_model : str or Path, optional
        ONNX conversion of the hand network; without it no hands are given.
    net_height_px : int
        Height images are scaled to, a multiple of 16, where the file leaves it open.
    as_released : bool
        Read the maps as OpenPose's program does; else the cheaper way of `hicp_lib.detectors.openpose.paf`.
    provider : str
    threads : int
        See `hicp_lib.detectors.onnx.session.open_model`.
    """

    name = "openpose"

    def __init__(
        self,
        model: str | Path,
        hand_model: str | Path | None = None,
        net_height_px: int = 368,
        as_released: bool = True,
        provider: str = "cpu",
        threads: int = 1,
    ) -> None:
        check_height(net_height_px)
        self._model = open_model(model, provider, threads)
        height, width = self._model.image_size_px
        self._size_px = height or net_height_px, width if height else None
        self._hands = OpenPoseHands(hand_model, provider, threads) if hand_model is not None else None
        self._as_released = as_released
        self._options = PafOptions()
        hands = self._hands.settings if self._hands else None
        self.settings: dict[str, Any] = {"model": self._model.settings, "hand_model": hands}
        self.settings |= {"size_px": self._size_px, "as_released": as_released}
        self.settings |= {"opencv": cv2.__version__, **asdict(self._options)}

    def detect(self, image: np.ndarray) -> Detections:
        """Find people in an RGB image, shape (height, width, 3), uint8."""
        net_input = fit(image, *self._size_px)
        maps = self._model.run(_feed(net_input.pixels))
        heat_maps, fields, parts_model = _split(self._model, maps, net_input.pixels.shape)
        given = heat_maps, fields, parts_model, STRIDE, self._options
        if self._as_released:
            parts, scores = assemble_released(*given, offset_px=0.5 * net_input.scale.min())
        else:
            parts, scores = assemble(*given)
        people = as_detections(parts, scores, net_input, parts_model.convention)
        return self._hands.complete(image, people) if self._hands else people

    def describe(self) -> list[Fact]:
        """What is taken for granted about the models."""
        height, width = self._size_px
        size = f"{width or 'any'} wide, {height} high"
        hands = "by the hand model" if self._hands else "none; option hand_model"
        return [
            *self._model.describe(),
            Fact("input", size, "read from the file" if width else "option net_height_px"),
            Fact("pixels", "BGR / 256 - 0.5, aspect kept, padded right and below", "as OpenPose"),
            Fact("keypoints", " or ".join(part_model.convention for part_model in _PART_MODELS.values()),
                 "told by the number of maps when it runs"),
            Fact("decoding", "as OpenPose's program" if self._as_released else "in the small maps",
                 "option as_released"),
            Fact("hands", hands, "square around wrist + 0.33 (wrist - elbow), side 1.5 x the greater of "
                 "forearm and 0.9 x upper arm"),
            Fact("keypoint score", "value of the map's peak, cut off at 1", "as OpenPose"),
            Fact("person score", "sum of part and limb scores / " + (
                 "number of all parts and limbs" if self._as_released else "number of those found"),
                 "as OpenPose" if self._as_released else "option as_released"),
        ]  # fmt: skip


class OpenPoseHands:
    """OpenPose's hand network: 21 points of a right hand in a square crop."""

    def __init__(self, model: str | Path, provider: str, threads: int) -> None:
        self._model = open_model(model, provider, threads)
        height, width = self._model.image_size_px
        if height != width:
            raise InputError(f"{model}: takes images of {width} x {height}; expected squares")
        self._side_px = height or _HAND_SIDE_PX
        self.settings = self._model.settings

    def complete(self, image: np.ndarray, people: Detections) -> Detections:
        """The people with the hands found at their arms; none where shoulder, elbow or wrist is missing."""
        keypoints_px, scores = people.keypoints_px.copy(), people.scores.copy()
        for person in range(len(people)):
            for side, indices in _HANDS.items():
                square = hand_square(keypoints_px[person], scores[person], side)
                if square is not None:
                    found = self.find(image, *square, is_left=side == "left")
                    keypoints_px[person, indices], scores[person, indices] = found
        return Detections(keypoints_px, scores, people.person_scores)

    def find(
        self, image: np.ndarray, corner_px: np.ndarray, side_px: float, is_left: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """The points of the hand in a square.

        Parameters
        ----------
        image : array, shape (height, width, 3), dtype uint8
            RGB.
        corner_px : array, shape (2,)
            Top left of the square.
        side_px : float
        is_left : bool
            Show it mirrored.

        Returns
        -------
        points_px : array, shape (21, 2)
            In the image; NaN where not found.
        scores : array, shape (21,)
        """
        zoom = side_px / self._side_px
        x0, step = (corner_px[0] + side_px, -zoom) if is_left else (corner_px[0], zoom)
        to_image = np.array([[step, 0, x0], [0, zoom, corner_px[1]]])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        crop = cv2.warpAffine(image, to_image, (self._side_px, self._side_px), flags=flags)
        (maps, *_) = self._model.run(_feed(crop))
        cells = self._side_px // STRIDE
        if maps.ndim != 4 or maps.shape[1] < _N_HAND or maps.shape[2:] != (cells, cells):
            raise InputError(
                f"{self._model.path}: gives maps of shape {maps.shape}; expected "
                f"(1, {_N_HAND + 1}, {cells}, {cells})"
            )
        large = enlarge(maps[0, :_N_HAND], STRIDE).reshape(_N_HAND, -1)
        at = large.argmax(axis=1)
        scores = np.clip(np.nan_to_num(large.max(axis=1).astype(float)), 0, 1)
        points = (
            np.stack([at % self._side_px, at // self._side_px], axis=1) @ to_image[:, :2].T + to_image[:, 2]
        )
        return np.where(scores[:, None] > 0, points, np.nan), scores


def hand_square(keypoints_px: np.ndarray, scores: np.ndarray, side: str) -> tuple[np.ndarray, float] | None:
    """The square in which OpenPose looks for a hand of a person, if it does.

    Parameters
    ----------
    keypoints_px : array, shape (136, 2)
    scores : array, shape (136,)
    side : {"left", "right"}

    Returns
    -------
    (array, float) or None
        Its upper left corner, shape (2,), and its side in pixels.

    Examples
    --------
    >>> keypoints_px = np.zeros((136, 2))
    >>> joints = [INDEX[f"left_{joint}"] for joint in ("wrist", "elbow", "shoulder")]
    >>> keypoints_px[joints] = (400, 200), (300, 200), (200, 200)
    >>> corner_px, side_px = hand_square(keypoints_px, np.ones(136), "left")
    >>> corner_px.tolist(), side_px
    ([358.0, 125.0], 150.0)
    """
    joints = [INDEX[f"{side}_{joint}"] for joint in ("wrist", "elbow", "shoulder")]
    if not (scores[joints] > _MIN_ARM_SCORE).all():
        return None
    wrist, elbow, shoulder = keypoints_px[joints]
    upper_arm_px = np.linalg.norm(elbow - shoulder)
    side_px = _SQUARE_SIDE * max(np.linalg.norm(wrist - elbow), _FOREARMS_PER_UPPER_ARM * upper_arm_px)
    centre = wrist + _BEYOND_WRIST * (wrist - elbow)
    return (centre - side_px / 2, float(side_px)) if side_px**2 > _MIN_AREA_PX2 else None


def _feed(pixels: np.ndarray) -> np.ndarray:
    feed = np.empty((1, 3, *pixels.shape[:2]), np.float32)
    planes(pixels[..., ::-1], (128.0,) * 3, (256.0,) * 3, feed[0])
    return feed


def _split(
    model: OnnxModel, outputs: list[np.ndarray], input_shape: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray, PartModel]:
    """Heat maps (n_parts, h, w), fields and what they are, from one output or one of each, in any order."""
    cells = input_shape[0] // STRIDE, input_shape[1] // STRIDE
    by_channels = {
        output.shape[1]: np.nan_to_num(output[0])
        for output in outputs
        if output.ndim == 4 and output.shape[0] == 1 and output.shape[2:] == cells
    }
    for (n_maps, n_fields), part_model in _PART_MODELS.items():
        if n_maps + n_fields in by_channels:
            maps = by_channels[n_maps + n_fields]
            return maps[: part_model.n_parts], maps[n_maps:], part_model
        if n_maps in by_channels and n_fields in by_channels:
            return by_channels[n_maps][: part_model.n_parts], by_channels[n_fields], part_model
    raise model.unexpected(outputs, f"57 (COCO) or 78 (BODY_25) maps of {cells[1]} x {cells[0]}")

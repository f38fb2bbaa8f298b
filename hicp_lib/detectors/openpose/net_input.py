"""Input of OpenPose's own networks: BGR, value / 256 - 0.5, aspect ratio kept."""

import cv2
import numpy as np

from hicp_lib.detectors.onnx.letterbox import Letterbox

# Wider images are scaled down, and the height padded with black.
_MAX_ASPECT = 16 / 9


def fit(image: np.ndarray, height_px: int, width_px: int | None = None) -> Letterbox:
    """Fit an image into the input like OpenPose's program: aspect ratio kept, black right and below.

    The width follows the image's aspect ratio, rounded to a multiple of 16 and at most 16 / 9 of the height.
    The centres of the first and last pixels coincide.

    Parameters
    ----------
    image : array, shape (height, width, 3), dtype uint8
    height_px : int
    width_px : int, optional
        If the network accepts no other.

    Examples
    --------
    >>> [fit(np.zeros((h, w, 3), np.uint8), 368).pixels.shape[1] for w, h in ((640, 429), (1280, 425))]
    [544, 656]
    """
    size = np.array(image.shape[1::-1])
    proportion = min(_MAX_ASPECT, size[0] / size[1])
    net_size = np.array([width_px or 16 * int(height_px * proportion / 16 + 0.5) or 16, height_px])
    zoom = ((net_size - 1) / np.maximum(size - 1, 1)).min()
    flags = cv2.INTER_CUBIC if zoom > 1 else cv2.INTER_AREA
    pixels = cv2.warpAffine(image, np.eye(2, 3) * zoom, tuple(net_size.tolist()), flags=flags)
    covered = np.floor(zoom * size + 0.5)
    back = (np.maximum(size - 1, 1) / np.maximum(covered - 1, 1)).min()
    return Letterbox(pixels, np.full(2, 1 / back), (0.0, 0.0), 0.0)


def feed(pixels: np.ndarray) -> np.ndarray:
    """The network's input, shape (1, 3, height, width), for an RGB image."""
    return cv2.dnn.blobFromImage(pixels, 1 / 256, mean=(128.0,) * 3, swapRB=True)

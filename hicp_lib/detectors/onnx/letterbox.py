"""Fit images into a detector's input: aspect ratio kept, the rest padded."""

from dataclasses import dataclass

import cv2
import numpy as np

IMAGENET_RGB = (123.675, 116.28, 103.53), (58.395, 57.12, 57.375)
"""Mean and deviation of ImageNet's red, green and blue, 0-255."""
IMAGENET_BGR = IMAGENET_RGB[0][::-1], IMAGENET_RGB[1][::-1]
"""The same of blue, green and red."""


@dataclass(frozen=True)
class Letterbox:
    """An image scaled for a detector's input, and the transform back.

    Attributes
    ----------
    pixels : array, shape (height, width, 3), dtype uint8
    scale : array, shape (2,)
        Input pixels per image pixel along x and y.
    corner_px : tuple of float
        Position in the input, x and y, of the image's point (`origin_px`, `origin_px`).
    origin_px : float
        -0.5 if the corners of the first pixels coincide, 0 if their centres do.
    """

    pixels: np.ndarray
    scale: np.ndarray
    corner_px: tuple[float, float] = (-0.5, -0.5)
    origin_px: float = -0.5

    def to_image_px(self, positions_px: np.ndarray) -> np.ndarray:
        """Positions (..., 2) in input pixels as image pixels."""
        return (positions_px - np.array(self.corner_px)) / self.scale + self.origin_px


def letterbox(
    image: np.ndarray, size_px: tuple[int, int], fill: tuple[int, int, int], is_centred: bool = False
) -> Letterbox:
    """Scale an image to fit into an input, bilinearly, as YOLOX does.

    Parameters
    ----------
    image : array, shape (height, width, 3), dtype uint8
    size_px : tuple of int
        Width and height of the input.
    fill : tuple of int
        Colour of the padding.
    is_centred : bool
        Whether the image is centred in the input, as in YOLO-pose.

    Examples
    --------
    >>> fitted = letterbox(np.zeros((50, 100, 3), np.uint8), (40, 40), (114, 114, 114))
    >>> fitted.pixels[:, 0, 0].tolist() == 20 * [0] + 20 * [114], fitted.to_image_px(np.array([3.5, 1.5]))
    (True, array([9.5, 4.5]))
    """
    height, width = image.shape[:2]
    ratio = min(size_px[0] / width, size_px[1] / height)
    whole = round if is_centred else int
    fitted = max(1, whole(width * ratio)), max(1, whole(height * ratio))
    left, top = ((size - side) // 2 * is_centred for size, side in zip(size_px, fitted, strict=True))
    pixels = np.full((size_px[1], size_px[0], 3), fill, np.uint8)
    resized = cv2.resize(image, fitted, interpolation=cv2.INTER_LINEAR)
    pixels[top : top + fitted[1], left : left + fitted[0]] = resized
    scale = np.array(fitted) / (width, height)
    return Letterbox(pixels, scale, (left - 0.5, top - 0.5))


def blob(
    images: list[np.ndarray], mean: tuple[float, ...], std: tuple[float, ...], is_bgr: bool = False
) -> np.ndarray:
    """The normalised network input for RGB images of one size: (value - mean) / std.

    Parameters
    ----------
    images : list of array, shape (height, width, 3), dtype uint8
    mean, std : tuple of float
        One per channel of the network.
    is_bgr : bool
        Whether the network's channels start with blue.

    Returns
    -------
    array, shape (n, 3, height, width), dtype float32
    """
    params = cv2.dnn.Image2BlobParams([*(1 / spread for spread in std), 1], mean=mean, swapRB=is_bgr)
    return cv2.dnn.blobFromImagesWithParams(images, params)

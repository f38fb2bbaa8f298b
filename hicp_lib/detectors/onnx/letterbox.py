"""Images fitted into a detector's input: aspect kept, top-left, the rest filled."""

from dataclasses import dataclass

import cv2
import numpy as np


@dataclass(frozen=True)
class Letterbox:
    """An image as a detector takes it, and the way back.

    Attributes
    ----------
    pixels : array, shape (height, width, 3), dtype uint8
    scale : array, shape (2,)
        Input pixels per image pixel along x and y.
    """

    pixels: np.ndarray
    scale: np.ndarray

    def to_image_px(self, positions_px: np.ndarray) -> np.ndarray:
        """Positions (..., 2) in input pixels as image pixels; pixel centres at integers in both."""
        return (positions_px + 0.5) / self.scale - 0.5


def letterbox(image: np.ndarray, size_px: tuple[int, int], fill: tuple[int, int, int]) -> Letterbox:
    """Scale an image to fit into an input, bilinearly, as YOLOX does.

    Parameters
    ----------
    image : array, shape (height, width, 3), dtype uint8
    size_px : tuple of int
        Width and height of the input.
    fill : tuple of int
        Colour of the rest.

    Examples
    --------
    >>> fitted = letterbox(np.zeros((50, 100, 3), np.uint8), (40, 40), (114, 114, 114))
    >>> fitted.pixels[:, 0, 0].tolist() == 20 * [0] + 20 * [114], fitted.to_image_px(np.array([3.5, 1.5]))
    (True, array([9.5, 4.5]))
    """
    height, width = image.shape[:2]
    ratio = min(size_px[0] / width, size_px[1] / height)
    fitted = max(1, int(width * ratio)), max(1, int(height * ratio))
    pixels = np.full((size_px[1], size_px[0], 3), fill, np.uint8)
    pixels[: fitted[1], : fitted[0]] = cv2.resize(image, fitted, interpolation=cv2.INTER_LINEAR)
    return Letterbox(pixels, np.array(fitted) / (width, height))


def planes(pixels: np.ndarray, mean: tuple[float, ...], std: tuple[float, ...], out: np.ndarray) -> None:
    """Write (pixels - mean) / std of an image into `out`.

    Parameters
    ----------
    pixels : array, shape (height, width, 3), dtype uint8
    mean, std : tuple of float
        One of each channel.
    out : array, shape (3, height, width), dtype float32
    """
    for plane, channel, centre, spread in zip(out, cv2.split(pixels), mean, std, strict=True):
        np.subtract(channel, np.float32(centre), out=plane, dtype=np.float32)
        plane *= np.float32(1 / spread)

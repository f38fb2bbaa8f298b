"""Images fitted into a detector's input: aspect kept, top-left, the rest filled."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np


@dataclass(frozen=True)
class Letterbox:
    """An image as a detector takes it, and the way back.

    Attributes
    ----------
    pixels : array, shape (height, width, 3), uint8
    scale : array (2,), input pixels per image pixel along x and y
    """

    pixels: np.ndarray
    scale: np.ndarray

    def to_image_px(self, positions_px: np.ndarray) -> np.ndarray:
        """Positions (..., 2) in input pixels as image pixels; pixel centres at integers in both."""
        return (positions_px + 0.5) / self.scale - 0.5


def letterbox(image: np.ndarray, size_px: tuple[int, int], fill: tuple[int, int, int]) -> Letterbox:
    """Scale an image (height, width, 3) to fit into (width, height), bilinearly, as YOLOX does."""
    height, width = image.shape[:2]
    ratio = min(size_px[0] / width, size_px[1] / height)
    fitted = max(1, int(width * ratio)), max(1, int(height * ratio))
    pixels = np.full((size_px[1], size_px[0], 3), fill, np.uint8)
    pixels[: fitted[1], : fitted[0]] = cv2.resize(image, fitted, interpolation=cv2.INTER_LINEAR)
    return Letterbox(pixels, np.array(fitted) / (width, height))


def planes(pixels: np.ndarray, mean: tuple[float, ...], std: tuple[float, ...], out: np.ndarray) -> None:
    """Write (pixels - mean) / std of an image (height, width, 3) into `out` (3, height, width), float32."""
    for plane, channel, centre, spread in zip(out, cv2.split(pixels), mean, std, strict=True):
        np.subtract(channel, np.float32(centre), out=plane, dtype=np.float32)
        plane *= np.float32(1 / spread)

"""Fit images, or people in them, into a network's input, and find the way back; aspect ratios are kept.

A `Letterbox` is a whole image, scaled and padded.

`Regions` are those of people. The box is padded and grown to the network's aspect ratio about its centre. The
classic transform (Xiao et al., "Simple baselines for human pose estimation and tracking", ECCV 2018) maps it
onto the input so that the centre falls on (width / 2, height / 2). Keypoints are mapped back by their
relative position on the grid, which is the heat map's cells or the bins of SimCC. Unbiased data processing
(Huang et al., "The devil is in the details", UDP, CVPR 2020) measures all three, box, input and grid, from
the first pixel's centre to the last one's: their sizes minus one.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

PADDING = 1.25
"""Factor by which people's boxes are enlarged, unless said otherwise."""
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


@dataclass(frozen=True)
class Regions:
    """Parts of an image, one per person, all of one aspect ratio.

    Attributes
    ----------
    centres_px : array, shape (n, 2)
    sizes_px : array, shape (n, 2)
        Width and height.
    udp : bool
        Measured as in unbiased data processing.
    """

    centres_px: np.ndarray
    sizes_px: np.ndarray
    udp: bool = False

    @classmethod
    def around(
        cls, boxes_px: np.ndarray, input_size_px: tuple[int, int], padding: float = PADDING, udp: bool = False
    ) -> Regions:
        """The regions of boxes for a network's input.

        Parameters
        ----------
        boxes_px : array, shape (n, 4: x, y, width, height)
        input_size_px : tuple of int
            Width and height.
        padding : float
            Factor by which the boxes are enlarged.
        udp : bool

        Examples
        --------
        >>> regions = Regions.around([[10, 20, 30, 80]], (192, 256), padding=1.0)
        >>> regions.centres_px.tolist(), regions.sizes_px.tolist()
        ([[25.0, 60.0]], [[60.0, 80.0]])
        """
        boxes_px = np.asarray(boxes_px, dtype=float).reshape(-1, 4)
        sizes = np.maximum(boxes_px[:, 2:], 1.0)
        aspect = input_size_px[0] / input_size_px[1]
        widths = np.maximum(sizes[:, 0], sizes[:, 1] * aspect)
        grown = np.stack([widths, widths / aspect], axis=1) * padding
        return cls(boxes_px[:, :2] + boxes_px[:, 2:] / 2, grown, udp)

    @classmethod
    def whole(cls, image: np.ndarray, input_size_px: tuple[int, int]) -> Regions:
        """The one region that an image fits into exactly."""
        return cls.around(np.array([[0, 0, image.shape[1], image.shape[0]]]), input_size_px, padding=1.0)

    def __len__(self) -> int:
        return len(self.centres_px)

    def crop(self, image: np.ndarray, input_size_px: tuple[int, int]) -> list[np.ndarray]:
        """The pixels of each region, scaled bilinearly to (width, height); black outside the image."""
        crops = []
        spans = self._span(input_size_px)
        for centre, zoom in zip(self.centres_px, spans / self.sizes_px, strict=True):
            matrix = np.column_stack([np.diag(zoom), spans / 2 - zoom * centre])
            crops.append(cv2.warpAffine(image, matrix, input_size_px, flags=cv2.INTER_LINEAR))
        return crops

    def to_image_px(self, positions: np.ndarray, grid_size: tuple[int, int]) -> np.ndarray:
        """Positions on each region's grid as image pixels, pixel centres at integers.

        Parameters
        ----------
        positions : array, shape (n, k, 2)
        grid_size : tuple of int
            (width, height) of the grid, in the unit of `positions`.
        """
        corners = self.centres_px - self.sizes_px / 2
        return corners[:, None] + positions / self._span(grid_size) * self.sizes_px[:, None]

    def _span(self, size: tuple[int, int]) -> np.ndarray:
        return np.asarray(size, float) - self.udp

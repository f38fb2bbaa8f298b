"""Transforms from person boxes to a top-down network's input, and back.

The box is padded and grown to the network's aspect ratio about its centre. The classic transform (Xiao et
al., "Simple baselines for human pose estimation and tracking", ECCV 2018) maps it onto the input so that the
centre falls on (width / 2, height / 2). Keypoints are mapped back by their relative position on the grid,
which is the heat map's cells or the bins of SimCC. Unbiased data processing (Huang et al., "The devil is in
the details", UDP, CVPR 2020) measures all three, box, input and grid, from the first pixel's centre to the
last one's: their sizes minus one.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

PADDING = 1.25


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

"""From person boxes to the pixels a top-down network sees, and back.

The classic transform of top-down pose estimation (Xiao et al., "Simple baselines for human pose
estimation and tracking", ECCV 2018; not the later UDP variant): the box is padded, grown to the
network's aspect ratio about its centre, and mapped so that the centre falls on
(width / 2, height / 2) of the input. Keypoints go back by the fraction of the grid they lie
at, whatever the grid: the heat map's cells or the bins of SimCC.
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
    """

    centres_px: np.ndarray
    sizes_px: np.ndarray

    @classmethod
    def around(
        cls, boxes_px: np.ndarray, input_size_px: tuple[int, int], padding: float = PADDING
    ) -> Regions:
        """The regions of boxes for a network's input.

        Parameters
        ----------
        boxes_px : array, shape (n, 4: x, y, width, height)
        input_size_px : tuple of int
            Width and height.
        padding : float
            What the boxes are grown by.

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
        return cls(boxes_px[:, :2] + boxes_px[:, 2:] / 2, grown)

    def __len__(self) -> int:
        return len(self.centres_px)

    def crop(self, image: np.ndarray, input_size_px: tuple[int, int]) -> list[np.ndarray]:
        """What lies in each region, scaled to (width, height) bilinearly; black outside the image."""
        crops = []
        for (x, y), (width, _) in zip(self.centres_px, self.sizes_px, strict=True):
            zoom = input_size_px[0] / width
            matrix = np.array(
                [[zoom, 0, input_size_px[0] / 2 - zoom * x], [0, zoom, input_size_px[1] / 2 - zoom * y]]
            )
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
        return corners[:, None] + positions / np.asarray(grid_size, float) * self.sizes_px[:, None]

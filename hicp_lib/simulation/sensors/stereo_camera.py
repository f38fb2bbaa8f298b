"""A stereo depth camera like Intel's RealSense D435, with its errors.

Depth is measured in the left imager's view as disparity, d = f B / z, and has the errors of stereo
matching; the colour camera sits 15 mm to the left of the left imager. Sources: Intel's "Tuning depth
cameras for best performance" (Grunnet-Jepsen, Sweetser, Woodfill) for the noise, the D435's data sheet
for geometry and invalid band, librealsense for units, range and alignment; the book's page on simulated
sensors has the formulas.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from hicp_lib.simulation.sensors.depth_camera import DepthCamera, Rng
from hicp_lib.simulation.sensors.depth_noise import correlated_noise, patches

_STEP_PX = 1.0  # difference beyond which neighbours are on different surfaces
_EDGE_JITTER = 0.12  # shift of matched edges by texture, as a fraction of the window
_EDGE_GROWTH = 0.06  # and growth of near surfaces over far ones


@dataclass(frozen=True, kw_only=True)
class StereoCamera(DepthCamera):
    """Errors of a stereo camera in addition to those of every depth camera; zero (or False) switches one off.

    Its imager is the left one, its baseline leads to the right one.

    Attributes
    ----------
    subpixel_rms_px : float
        Standard deviation of disparity; z**2 * subpixel_rms_px / (f B) in depth.
    window_px : int
        Side of the matching window, odd; noise is correlated over about this much.
    edge_px : float
        Width of the slope of flying pixels between two depths; 0 makes depth steps sharp.
    edge_holes : float
        Share of that slope that gets no depth.
    disparity_step_px : float
        Resolution of disparity.
    left_band : bool
        No depth where the right imager's image ends, at the left edge.
    shadow : bool
        No depth where something hides the surface from the right imager.
    hair_holes : float
        Share of hair that gives no depth.
    """

    subpixel_rms_px: float = 0.08
    window_px: int = 7
    edge_px: float = 2.5
    edge_holes: float = 0.35
    disparity_step_px: float = 1 / 32
    left_band: bool = True
    shadow: bool = True
    hair_holes: float = 0.25

    def measure(self, true_px: np.ndarray, hair: np.ndarray, first_column: int, rng: Rng) -> np.ndarray:
        """Depth by matching.

        Parameters
        ----------
        true_px : array, shape (h, w), dtype float32
        hair : array of bool, shape (h, w)
        first_column : int
        rng : numpy.random.Generator
            These as of `DepthCamera.measure`.

        Returns
        -------
        array, shape (h, w), dtype float32
        """
        valid = true_px > 0
        measured_px = true_px
        if self.edge_px:
            measured_px, clear = _edges(true_px, self, rng)
            valid &= clear
        if self.subpixel_rms_px:
            noise = correlated_noise(true_px.shape, self.window_px, rng)
            measured_px = measured_px + np.float32(self.subpixel_rms_px) * noise
        if self.disparity_step_px:
            measured_px = np.rint(measured_px / self.disparity_step_px) * self.disparity_step_px
        if self.left_band:
            column = first_column + np.arange(true_px.shape[1], dtype=np.float32)
            valid &= measured_px <= column
        if self.shadow:
            valid &= ~_hidden_from_right(true_px)
        if self.hair_holes and hair.any():
            valid &= ~(hair & patches(hair.shape, self.hair_holes, self.window_px, rng))
        depth_m = np.full(measured_px.shape, np.nan, np.float32)
        np.divide(np.float32(self.focal_baseline), measured_px, out=depth_m, where=valid & (measured_px > 0))
        return depth_m


D435 = StereoCamera(
    width_px=848, height_px=480, focal_px=424.0, baseline_m=0.050, colour_offset_m=0.015,
    nearest_m=0.168, max_range_m=10.0,
)  # fmt: skip
"""The mode with the best depth, 848 x 480. Disparities are searched up to 126 px, that of `nearest_m`."""

D435_VGA = replace(D435, width_px=640, focal_px=384.0, nearest_m=0.152)
"""640 x 480."""


def _edges(true_px: np.ndarray, settings: StereoCamera, rng: Rng) -> tuple[np.ndarray, np.ndarray]:
    """Disparity from windows that overlap steps in depth, and where there is one.

    A window gets the disparity of the surface that fills most of it or, if both fill about half, a value in
    between. Texture also has an influence, so outlines are ragged.
    """
    box = np.ones((settings.window_px, settings.window_px), np.uint8)
    small = np.ones((3, 3), np.uint8)
    step = cv2.dilate(true_px, small) - cv2.erode(true_px, small) > _STEP_PX
    rows, columns = np.nonzero(cv2.dilate(step.astype(np.uint8), box))
    low, high = (f(true_px, box)[rows, columns] for f in (cv2.erode, cv2.dilate))
    mean = cv2.blur(true_px, (settings.window_px, settings.window_px))[rows, columns]
    jitter = correlated_noise(true_px.shape, settings.window_px, rng)[rows, columns]
    share = (mean - low) / np.maximum(high - low, 1e-6) - 0.5 + _EDGE_GROWTH + _EDGE_JITTER * jitter
    share = np.clip(0.5 + share * (settings.window_px / settings.edge_px), 0, 1)
    measured, clear = true_px.copy(), np.ones(true_px.shape, bool)
    measured[rows, columns] = low + share * (high - low)
    between = (share > 0) & (share < 1)
    holes = patches(true_px.shape, settings.edge_holes, settings.window_px, rng)
    clear[rows[between], columns[between]] = ~holes[rows[between], columns[between]]
    return measured, clear


def _hidden_from_right(true_px: np.ndarray) -> np.ndarray:
    """Whether a nearer surface projects to the same pixel of the right imager, (height, width)."""
    height, width = true_px.shape
    margin = int(np.ceil(true_px.max(initial=0))) + 2
    column = np.arange(width, dtype=np.float32) - true_px + margin
    start = np.arange(height)[:, None] * (width + margin + 2)
    nearest = np.zeros(height * (width + margin + 2), np.float32)
    at = column.astype(np.int32) + start
    # On both pixels it lies between: surfaces that turn to the right imager have no gaps there.
    for offset in (0, 1):
        np.maximum.at(nearest, (at + offset).ravel(), true_px.ravel())
    return nearest[np.rint(column).astype(np.int32) + start] > true_px + _STEP_PX

"""Align depth from the imager that measured it to the colour camera beside it."""

import numpy as np

from hicp_lib.simulation.rendering.camera import PlacedCamera


def align_to_colour(depth_m: np.ndarray, left: PlacedCamera, colour: PlacedCamera) -> np.ndarray:
    """Depth of the left imager, moved to where the colour camera sees it.

    As librealsense does: each depth pixel fills the rectangle of colour pixels from the one that holds
    its first corner to the one that holds its last; of depths that fall on one pixel the nearest stays.

    Parameters
    ----------
    depth_m : array, shape (left.height_px, left.width_px)
        NaN for none.
    left, colour : PlacedCamera
        Beside each other: the same orientation, a shift along x.

    Returns
    -------
    array, shape (colour.height_px, colour.width_px), dtype float32
        NaN for none.
    """
    shift_m = float(colour.T_world_camera[:3, 0] @ (left.centre_m - colour.centre_m))
    z = np.where(np.isfinite(depth_m), depth_m, np.float32(np.inf))
    scale = np.float32(colour.fx_px / left.fx_px)
    middle = np.float32(colour.fx_px * shift_m) / z
    middle += scale * (np.arange(left.width_px, dtype=np.float32) - np.float32(left.cx_px))
    middle += np.float32(colour.cx_px)
    wide = np.full((left.height_px, colour.width_px + 2), np.inf, np.float32)  # a column for each side's rest
    start = np.arange(left.height_px, dtype=np.int32)[:, None] * np.int32(wide.shape[1]) + np.int32(1)
    first, last = (
        np.clip(np.rint(middle + side * scale / 2), -1, colour.width_px).astype(np.int32) + start
        for side in (-1, 1)
    )
    for step in range(int(np.ceil(scale)) + 1):
        at = np.minimum(first + np.int32(step), last)
        np.minimum.at(wide.reshape(-1), at.reshape(-1), z.reshape(-1))
    return _stretch_rows(wide[:, 1:-1], left, colour)


def _stretch_rows(wide: np.ndarray, left: PlacedCamera, colour: PlacedCamera) -> np.ndarray:
    """Rows of depth (infinite: none) as rows of the colour image, NaN for none."""
    scale = colour.fy_px / left.fy_px
    middle = scale * (np.arange(left.height_px) - left.cy_px) + colour.cy_px
    first, last = (np.rint(middle + side * scale / 2).astype(int) for side in (-1, 1))
    aligned = np.full((colour.height_px, wide.shape[1]), np.inf, np.float32)
    for step in range(int(np.ceil(scale)) + 1):
        rows = np.minimum(first + step, last)
        inside = np.flatnonzero((rows >= 0) & (rows < colour.height_px))
        # Two rows at most meet on one: every second is put down at a time.
        for part in (inside[::2], inside[1::2]):
            aligned[rows[part]] = np.minimum(aligned[rows[part]], wide[part])
    aligned[np.isinf(aligned)] = np.nan
    return aligned

"""One clock for camera and motion capture: the offset between two, and positions at camera stamps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from hicp_lib.errors import InputError

# At 100 Hz: up to three frames missing in a row are bridged.
MAX_GAP_S = 0.045
_RATE_HZ = 100.0
_SMOOTHING_S = 0.25
# Between camera frames at 10 Hz or more, with one frame missing.
_CAMERA_GAP_S = 0.25
# No wrist of a person who is not throwing anything is faster: such speeds are wrong detections.
_MAX_SPEED_M_S = 4.0
_MIN_OVERLAP_S = 2.0


@dataclass(frozen=True)
class ClockOffset:
    """How one clock differs from another.

    Attributes
    ----------
    offset_s : to add to b's stamps to have them on a's clock
    correlation : of the speeds at that offset, up to 1
    halves_s : the offset of each half of the recording alone; NaN where a half has too little motion.
        A difference beyond what the halves scatter by is drift
    """

    offset_s: float
    correlation: float
    halves_s: tuple[float, float]


def interpolate_mocap(
    times_s: np.ndarray, points_m: np.ndarray, stamps_s: np.ndarray, max_gap_s: float = MAX_GAP_S
) -> np.ndarray:
    """Positions at other times, linearly between the two samples around each.

    Parameters
    ----------
    times_s : array, shape (n,), increasing
    points_m : array, shape (n, m, 3); a point with a NaN coordinate is missing
    stamps_s : array, shape (k,)
    max_gap_s : between samples further apart than this nothing is made up

    Returns
    -------
    array, shape (k, m, 3); NaN in longer gaps, before the first sample and after the last
    """
    times_s, stamps_s = np.asarray(times_s, dtype=float), np.asarray(stamps_s, dtype=float)
    n, m, _ = points_m.shape
    if n == 0:
        return np.full((len(stamps_s), m, 3), np.nan)
    valid = np.isfinite(points_m).all(axis=-1)
    frames = np.arange(n)[:, None]
    last_valid = np.maximum.accumulate(np.where(valid, frames, -1))
    next_valid = np.minimum.accumulate(np.where(valid, frames, n)[::-1])[::-1]
    left = np.searchsorted(times_s, stamps_s, side="right") - 1
    right = np.searchsorted(times_s, stamps_s, side="left")
    before = np.where((left >= 0)[:, None], last_valid[left], -1)
    after = np.where((right < n)[:, None], next_valid[np.minimum(right, n - 1)], n)
    known = (before >= 0) & (after < n)
    before, after = np.where(known, before, 0), np.where(known, after, 0)
    span = times_s[after] - times_s[before]
    share = (stamps_s[:, None] - times_s[before]) / np.where(span > 0, span, 1.0)
    tracks = np.arange(m)
    start, end = points_m[before, tracks], points_m[after, tracks]
    # Half a microsecond: stamps in files are decimal.
    known &= span <= max_gap_s + 5e-7
    return np.where(known[..., None], start + share[..., None] * (end - start), np.nan)


def clock_offset(
    times_a_s: np.ndarray,
    points_a_m: np.ndarray,
    times_b_s: np.ndarray,
    points_b_m: np.ndarray,
    max_offset_s: float = 1.0,
) -> ClockOffset:
    """The offset of clock b, from the same points seen on both clocks.

    The *speeds* of the points do not depend on the frame they are given in. They are smoothed
    (Savitzky-Golay over a quarter of a second), and the offset is where their normalised
    cross-correlation is largest, refined by a parabola through its peak.

    Parameters
    ----------
    times_a_s, times_b_s : arrays, shapes (n,) and (k,), increasing
    points_a_m, points_b_m : arrays, shapes (n, m, 3) and (k, m, 3); NaN where missing; any two frames
    max_offset_s : offsets up to this are tried, in both directions

    Raises
    ------
    InputError
        If the two never move at the same time, so that nothing can be compared, or the best offset
        is the largest tried.
    """
    start_s, end_s = times_a_s[0], times_a_s[-1]
    grid_s = start_s + np.arange(0, end_s - start_s, 1 / _RATE_HZ)
    n_lags = int(np.ceil(max_offset_s * _RATE_HZ))
    wide_s = start_s + np.arange(-n_lags, len(grid_s) + n_lags) / _RATE_HZ
    speed_a = _speeds(times_a_s, points_a_m, grid_s, _CAMERA_GAP_S)
    speed_b = _speeds(times_b_s, points_b_m, wide_s, _CAMERA_GAP_S)
    offset_s, correlation = _best_offset(speed_a, speed_b, n_lags)
    if not np.isfinite(offset_s):
        raise InputError(
            f"no clock offset within {max_offset_s:g} s makes the two recordings move together; "
            "record a clear movement that both see, or allow a larger offset"
        )
    half = len(grid_s) // 2
    early, _ = _best_offset(speed_a[:half], speed_b[: half + 2 * n_lags], n_lags)
    late, _ = _best_offset(speed_a[half:], speed_b[half:], n_lags)
    return ClockOffset(offset_s, correlation, (early, late))


def _speeds(times_s: np.ndarray, points_m: np.ndarray, grid_s: np.ndarray, max_gap_s: float) -> np.ndarray:
    """Smoothed speed (n, m) on an even grid; NaN where positions around are missing."""
    positions = interpolate_mocap(times_s, points_m, grid_s, max_gap_s)
    window = int(_SMOOTHING_S * _RATE_HZ) | 1
    if len(positions) < window:
        return np.full(positions.shape[:2], np.nan)
    velocity = savgol_filter(
        positions, window, 2, deriv=1, delta=1 / _RATE_HZ, axis=0, mode="constant", cval=np.nan
    )
    return np.minimum(np.linalg.norm(velocity, axis=-1), _MAX_SPEED_M_S)


def _best_offset(speed_a: np.ndarray, speed_b: np.ndarray, n_lags: int) -> tuple[float, float]:
    """Offset [s] and correlation at the peak; row i + n_lags of `speed_b` is at the time of row i of a."""
    n = len(speed_a)
    values = np.array([_correlation(speed_a, speed_b[lag : lag + n]) for lag in range(2 * n_lags + 1)])
    if not np.isfinite(values).any():
        return np.nan, np.nan
    peak = int(np.nanargmax(values))
    if peak in (0, 2 * n_lags) or not np.isfinite(values[peak - 1 : peak + 2]).all():
        return np.nan, np.nan
    before, top, after = values[peak - 1 : peak + 2]
    shift = 0.5 * (before - after) / (before - 2 * top + after)
    return float((n_lags - peak - shift) / _RATE_HZ), float(top)


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Pearson's correlation over what both have, each track about its own mean."""
    both = np.isfinite(a) & np.isfinite(b)
    if both.sum() < _MIN_OVERLAP_S * _RATE_HZ:
        return np.nan
    n = np.maximum(both.sum(axis=0), 1)
    a, b = np.where(both, a, 0.0), np.where(both, b, 0.0)
    a, b = np.where(both, a - a.sum(axis=0) / n, 0.0), np.where(both, b - b.sum(axis=0) / n, 0.0)
    scale = np.sqrt((a**2).sum() * (b**2).sum())
    return float((a * b).sum() / scale) if scale > 0 else np.nan

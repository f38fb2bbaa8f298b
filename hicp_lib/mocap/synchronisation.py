"""One clock for camera and motion capture: the offset between two, and positions at camera stamps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.extras import needs

with needs("analysis"):
    from scipy.signal import fftconvolve, savgol_filter

# At 100 Hz: up to three frames missing in a row are bridged.
MAX_GAP_S = 0.045
_RATE_HZ = 100.0
_SMOOTHING_S = 0.25
# Between camera frames at 10 Hz or more, with one frame missing.
_CAMERA_GAP_S = 0.25
# No wrist of a person who is not throwing anything is faster: such speeds are wrong detections.
_MAX_SPEED_M_S = 4.0
_MIN_OVERLAP_S = 2.0
_MAX_DRIFT_S = 0.5


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
    times_a_s: np.ndarray, points_a_m: np.ndarray, times_b_s: np.ndarray, points_b_m: np.ndarray
) -> ClockOffset:
    """The offset of clock b, from the same points seen on both clocks.

    The *speeds* of the points do not depend on the frame they are given in. They are smoothed
    (Savitzky-Golay over a quarter of a second), and the offset is where their normalised
    cross-correlation is largest, refined by a parabola through its peak. All offsets are tried at which
    half of what was seen of the points on the one clock was also seen on the other.

    Parameters
    ----------
    times_a_s, times_b_s : arrays, shapes (n,) and (k,), increasing; may start at any number
    points_a_m, points_b_m : arrays, shapes (n, m, 3) and (k, m, 3); NaN where missing; any two frames

    Raises
    ------
    InputError
        If no offset makes the two move together.
    """
    speeds_a, speeds_b = _speeds(times_a_s, points_a_m), _speeds(times_b_s, points_b_m)
    half = len(speeds_a) // 2
    early, late = speeds_a.copy(), speeds_a.copy()
    early[half:], late[:half] = np.nan, np.nan
    lag, correlation = _best_lag(speeds_a, speeds_b)
    if not np.isfinite(lag):
        raise InputError(
            "no clock offset makes camera and motion capture move together; record at least some seconds of "
            "clear movement that both see"
        )
    halves = [_best_lag(part, speeds_b, near=lag)[0] for part in (early, late)]
    start_s = float(times_a_s[0] - times_b_s[0])
    offset_s, *halves_s = (start_s + value / _RATE_HZ for value in (lag, *halves))
    return ClockOffset(offset_s, correlation, tuple(halves_s))


def _speeds(times_s: np.ndarray, points_m: np.ndarray) -> np.ndarray:
    """Smoothed speeds (n, m) [m/s] at an even rate from the first time on; NaN where not known."""
    grid_s = np.arange(times_s[0], times_s[-1], 1 / _RATE_HZ)
    positions = interpolate_mocap(times_s, points_m, grid_s, _CAMERA_GAP_S)
    window = int(_SMOOTHING_S * _RATE_HZ) | 1
    if len(positions) < window:
        return np.full(positions.shape[:2], np.nan)
    velocity = savgol_filter(
        positions, window, 2, deriv=1, delta=1 / _RATE_HZ, axis=0, mode="constant", cval=np.nan
    )
    return np.minimum(np.linalg.norm(velocity, axis=-1), _MAX_SPEED_M_S)


def _best_lag(a: np.ndarray, b: np.ndarray, near: float | None = None) -> tuple[float, float]:
    """Rows by which b must be moved to be most like a, and the correlation then; NaN where nothing is."""
    values = _correlations(a, b)
    lags = np.arange(len(values)) - (len(b) - 1)
    if near is not None:
        values[np.abs(lags - near) > _MAX_DRIFT_S * _RATE_HZ] = np.nan
    if not np.isfinite(values).any():
        return np.nan, np.nan
    peak = int(np.nanargmax(values))
    around = values[max(peak - 1, 0) : peak + 2]
    if len(around) < 3 or not np.isfinite(around).all():
        return np.nan, np.nan
    before, top, after = around
    return float(lags[peak] + 0.5 * (before - after) / (before - 2 * top + after)), float(top)


def _correlations(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Pearson's correlation at every lag over what both have, each track about its own mean there.

    NaN where they have too little together.
    """
    seen_a, seen_b = np.isfinite(a), np.isfinite(b)
    a, b = np.where(seen_a, a, 0.0), np.where(seen_b, b, 0.0)
    n = _sums(seen_a, seen_b)
    mean_n = np.maximum(n, 1)
    sum_a, sum_b = _sums(a, seen_b), _sums(seen_a, b)
    covariance = (_sums(a, b) - sum_a * sum_b / mean_n).sum(axis=1)
    variance_a = (_sums(a**2, seen_b) - sum_a**2 / mean_n).sum(axis=1)
    variance_b = (_sums(seen_a, b**2) - sum_b**2 / mean_n).sum(axis=1)
    enough = n.sum(axis=1) >= max(_MIN_OVERLAP_S * _RATE_HZ, 0.5 * min(seen_a.sum(), seen_b.sum()))
    enough &= np.minimum(variance_a, variance_b) > 1e-6  # m^2/s^2 summed: standing still
    scale = np.sqrt(np.where(enough, variance_a * variance_b, 1.0))
    return np.where(enough, covariance / scale, np.nan)


def _sums(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Sums over i of a[i + lag] b[i], per track, for every lag from 1 - len(b) on."""
    return fftconvolve(a.astype(float), b[::-1].astype(float), axes=0)

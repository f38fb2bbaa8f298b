"""Synchronise camera and motion capture: the offset of their clocks, and positions at camera stamps."""

from dataclasses import dataclass

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.extras import needs

with needs("analysis"):
    from scipy.signal import fftconvolve, savgol_filter

# At 100 Hz: up to three frames missing in a row are bridged.
MAX_GAP_S = 0.045
_RATE_HZ = 100.0
# Windows over which speeds are smoothed, and the largest bridged gap, at 10 Hz or more. Below that, in
# periods of the slower clock.
_LEAST_S, _SMOOTHED_PERIODS, _GAP_PERIODS = 0.25, 2.0, 2.5
# Upper limit of speeds, so that jumps from wrong detections do not outweigh gestures. Chosen on development
# identities (14, seed 0): the offset's standard deviation is a quarter of that with 4 m/s.
_MAX_SPEED_M_S = 0.5
_MIN_OVERLAP_S = 2.0
_MAX_DRIFT_S = 0.5
_STAMP_ERROR_S = 5e-7  # timestamps in files are decimal
_MIN_SHARE = 0.5  # fraction of samples on one clock with a counterpart on the other
_STANDING_M2_S2 = 1e-6  # sum of variances of speeds below which nothing moves
_FIT_ALIKE = np.log(20)  # log ratio below the best beyond which an offset is excluded
_OVERLAP_GIVEN = 4 / 3  # factor of missing samples that is compensated for other offsets
_LEAST_RESIDUAL = 1e-4  # fraction of the variance; closer agreement is not counted


@dataclass(frozen=True)
class ClockOffset:
    """How one clock differs from another.

    Attributes
    ----------
    offset_s : float
        To add to b's stamps to have them on a's clock.
    correlation : float
        Of the speeds at that offset, up to 1.
    halves_s : (float, float)
        The offset of each half of the recording alone; NaN where a half has too little motion. A difference
        beyond what the halves scatter by is drift.
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
    times_s : array, shape (n,)
        Increasing.
    points_m : array, shape (n, m, 3)
        A point with a NaN coordinate is missing.
    stamps_s : array, shape (k,)
    max_gap_s : float, optional
        Gaps longer than this are not interpolated.

    Returns
    -------
    array, shape (k, m, 3)
        NaN in longer gaps, before the first sample and after the last.

    Examples
    --------
    >>> points_m = np.array([[[0.0, 0, 0]], [[0.1, 0, 0]]])
    >>> interpolate_mocap(np.array([0.0, 0.01]), points_m, np.array([0.005, 0.02]))[:, 0, 0]
    array([0.05,  nan])
    """
    times_s, stamps_s = np.asarray(times_s, dtype=float), np.asarray(stamps_s, dtype=float)
    found_m = np.full((len(stamps_s), *points_m.shape[1:]), np.nan)
    for k, track_m in enumerate(points_m.swapaxes(0, 1)):
        valid = np.isfinite(track_m).all(axis=1)
        samples_s, positions_m = times_s[valid], track_m[valid]
        before = np.searchsorted(samples_s, stamps_s, side="right") - 1
        after = np.searchsorted(samples_s, stamps_s, side="left")
        known = np.flatnonzero((before >= 0) & (after < len(samples_s)))
        before, after = before[known], after[known]
        span_s = samples_s[after] - samples_s[before]
        share = (stamps_s[known] - samples_s[before]) / np.where(span_s > 0, span_s, 1.0)
        start_m, end_m = positions_m[before], positions_m[after]
        is_near = span_s <= max_gap_s + _STAMP_ERROR_S
        found_m[known[is_near], k] = (start_m + share[:, None] * (end_m - start_m))[is_near]
    return found_m


def clock_offset(
    times_a_s: np.ndarray, points_a_m: np.ndarray, times_b_s: np.ndarray, points_b_m: np.ndarray
) -> ClockOffset:
    """The offset of clock b, from the same points seen on both clocks.

    The *speeds* of the points do not depend on the frame they are given in. They are smoothed (Savitzky-Golay
    over a quarter of a second, or two periods of the slower clock), and the offset is the one at which one
    predicts the other best: where the logarithm of the likelihood ratio, -n/2 log(1 - r²), is largest, with r
    their correlation and n the number of smoothing windows that both have there. Few samples, which can agree
    by chance, thus get little weight. A parabola through r refines the offset. All offsets are tried at which
    at least half of the samples on one clock have a counterpart on the other.

    Parameters
    ----------
    times_a_s : array, shape (n,)
        Increasing; may start at any number.
    points_a_m : array, shape (n, m, 3)
        NaN where missing.
    times_b_s : array, shape (k,)
        Increasing; may start at any number.
    points_b_m : array, shape (k, m, 3)
        The same points, NaN where missing; in a frame of their own.

    Returns
    -------
    ClockOffset

    Raises
    ------
    InputError
        If no offset makes the two move together, or several do: a second one is at least a twentieth as
        likely as the best.

    Examples
    --------
    >>> times_s = np.arange(0, 10, 0.01)
    >>> points_m = np.sin(times_s * (1 + times_s / 10))[:, None, None] * [0.3, 0.2, 0.1]
    >>> round(clock_offset(times_s, points_m, times_s - 0.25, points_m).offset_s, 3)
    0.25
    """
    period_s = max(float(np.median(np.diff(t, prepend=t[0]))) for t in (times_a_s, times_b_s))
    speeds_a, speeds_b = (
        _speeds(*seen, period_s) for seen in ((times_a_s, points_a_m), (times_b_s, points_b_m))
    )
    half = len(speeds_a) // 2
    early, late = speeds_a.copy(), speeds_a.copy()
    early[half:], late[:half] = np.nan, np.nan
    start_s = float(times_a_s[0] - times_b_s[0])
    window = max(_LEAST_S, _SMOOTHED_PERIODS * period_s) * _RATE_HZ
    lag, correlation, other = _best_lag(speeds_a, speeds_b, window)
    if not np.isfinite(lag):
        hint = "record at least some seconds of clear movement that both see"
        raise InputError(f"no clock offset makes camera and motion capture move together; {hint}")
    if np.isfinite(other):
        both = " and ".join(f"{start_s + value / _RATE_HZ:.2f} s" for value in (lag, other))
        hint = "record a movement that does not repeat, or its start and end"
        raise InputError(f"clock offsets of {both} fit camera and motion capture alike; {hint}")
    halves = (_best_lag(part, speeds_b, window, near=lag) for part in (early, late))
    lags = (lag, *(part if np.isnan(another) else np.nan for part, _, another in halves))
    offset_s, early_s, late_s = (start_s + value / _RATE_HZ for value in lags)
    return ClockOffset(offset_s, correlation, (early_s, late_s))


def _speeds(times_s: np.ndarray, points_m: np.ndarray, period_s: float = 0.0) -> np.ndarray:
    """Smoothed speeds (n, m) [m/s] at an even rate from the first time on; NaN where not known."""
    grid_s = np.arange(times_s[0], times_s[-1], 1 / _RATE_HZ)
    positions = interpolate_mocap(times_s, points_m, grid_s, max(_LEAST_S, _GAP_PERIODS * period_s))
    window = int(max(_LEAST_S, _SMOOTHED_PERIODS * period_s) * _RATE_HZ) | 1
    if len(positions) < window:
        return np.full(positions.shape[:2], np.nan)
    velocity = savgol_filter(
        positions, window, 2, deriv=1, delta=1 / _RATE_HZ, axis=0, mode="constant", cval=np.nan
    )
    return np.minimum(np.linalg.norm(velocity, axis=-1), _MAX_SPEED_M_S)


def _best_lag(
    a: np.ndarray, b: np.ndarray, window: float, near: float | None = None
) -> tuple[float, float, float]:
    """Rows by which b must be shifted to match a best, the correlation there, and another possible lag.

    NaN if nothing matches, and for the other lag if there is none more than the smoothing `window` away that
    is about as likely.
    """
    values, n = _correlations(a, b)
    lags = np.arange(len(values)) - (len(b) - 1)
    if near is not None:
        values[np.abs(lags - near) > _MAX_DRIFT_S * _RATE_HZ] = np.nan
    gain = -0.5 * n / window * np.log(np.maximum(1 - np.maximum(values, 0) ** 2, _LEAST_RESIDUAL))
    gain = np.where(np.isfinite(gain), gain, -np.inf)
    peak = int(np.argmax(gain))
    around = values[max(peak - 1, 0) : peak + 2]
    if len(around) < 3 or not np.isfinite(around).all():
        return np.nan, np.nan, np.nan
    # Slightly fewer samples are not evidence against another offset.
    rivals = gain * np.clip(n[peak] / np.maximum(n, 1), 1, _OVERLAP_GIVEN)
    rival = int(np.argmax(np.where(np.abs(lags - lags[peak]) > window, rivals, -np.inf)))
    is_alike = rivals[rival] > gain[peak] - _FIT_ALIKE
    before, top, after = around
    lag = float(lags[peak] + 0.5 * (before - after) / (before - 2 * top + after))
    return lag, float(top), float(lags[rival]) if is_alike else np.nan


def _correlations(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pearson's correlation at every lag over the common samples, each track about its own mean there.

    NaN where there are too few; and the largest number of common samples of one track.
    """
    seen_a, seen_b = np.isfinite(a), np.isfinite(b)
    a, b = np.where(seen_a, a, 0.0), np.where(seen_b, b, 0.0)
    n = _sums(seen_a, seen_b)
    mean_n = np.maximum(n, 1)
    sum_a, sum_b = _sums(a, seen_b), _sums(seen_a, b)
    covariance = (_sums(a, b) - sum_a * sum_b / mean_n).sum(axis=1)
    variance_a = (_sums(a**2, seen_b) - sum_a**2 / mean_n).sum(axis=1)
    variance_b = (_sums(seen_a, b**2) - sum_b**2 / mean_n).sum(axis=1)
    enough = n.sum(axis=1) >= max(_MIN_OVERLAP_S * _RATE_HZ, _MIN_SHARE * min(seen_a.sum(), seen_b.sum()))
    enough &= np.minimum(variance_a, variance_b) > _STANDING_M2_S2
    scale = np.sqrt(np.where(enough, variance_a * variance_b, 1.0))
    return np.where(enough, covariance / scale, np.nan), n.max(axis=1, initial=0)


def _sums(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Sums over i of a[i + lag] b[i], per track, for every lag from 1 - len(b) on."""
    return fftconvolve(a.astype(float), b[::-1].astype(float), axes=0)

"""One clock: positions between samples, and the offset between clocks."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hicp_lib.core.errors import InputError
from hicp_lib.mocap.synchronisation import (
    MAX_GAP_S,
    _best_lag,
    _correlations,
    _speeds,
    clock_offset,
    interpolate_mocap,
)


def test_between_samples_positions_lie_on_the_line():
    times = np.arange(0, 1, 0.01)
    points = np.stack([times[:, None] * [1.0, 2, 3], 1 - times[:, None] * [0.0, 0, 1]], axis=1)
    stamps = np.array([0.0, 0.005, 0.3333, 0.99])
    assert interpolate_mocap(times, points, stamps)[:, 0] == pytest.approx(stamps[:, None] * [1, 2, 3])


@given(st.integers(1, 12), st.integers(1, 80))
def test_gaps_are_bridged_up_to_the_limit_and_no_further(n_missing, start):
    times = np.arange(0, 1, 0.01)
    points = times[:, None, None] * np.ones(3)
    points[start : start + n_missing] = np.nan
    middle = (times[start - 1] + times[min(start + n_missing, 99)]) / 2
    found = interpolate_mocap(times, points, np.array([middle]))[0, 0]
    if (n_missing + 1) * 0.01 <= MAX_GAP_S:
        assert found == pytest.approx(np.full(3, middle))
    else:
        assert np.isnan(found).all()


def test_markers_have_their_own_gaps_and_nothing_is_made_up_at_the_ends():
    times = np.array([0.0, 0.01, 0.02])
    points = np.zeros((3, 2, 3))
    points[0, 0] = np.nan
    found = interpolate_mocap(times, points, np.array([-0.001, 0.0, 0.005, 0.02, 0.021]))
    assert np.isnan(found[:, 0, 0]).tolist() == [True, True, True, False, True]
    assert np.isnan(found[:, 1, 0]).tolist() == [True, False, False, False, True]
    assert np.isnan(interpolate_mocap(times[:0], points[:0], times)).all()


def walk(times_s):
    """Two wrists that wave, turn and rest, at any time."""
    t = times_s[:, None]
    wave = np.c_[0.3 * np.sin(2 * t) * np.cos(0.7 * t), 0.2 * np.cos(3.1 * t), 0.1 * np.sin(5 * t + 1)]
    return np.stack([wave, 0.5 * wave[:, ::-1] + 0.2 * np.sin(1.3 * t)], axis=1)


@settings(max_examples=25)
@given(st.floats(-500, 500), st.integers(0, 1000))
def test_the_offset_is_found_in_any_frame_with_noise_and_gaps(offset, seed):
    rng = np.random.default_rng(seed)
    camera_s, mocap_s = np.arange(0, 16, 1 / 15), np.arange(-2, 19, 0.01)
    seen = Rotation.random(rng=rng).apply(walk(camera_s).reshape(-1, 3)).reshape(-1, 2, 3) + 5
    seen += rng.normal(0, 0.005, seen.shape)
    seen[rng.random(seen.shape[:2]) < 0.05] = np.nan
    found = clock_offset(camera_s, seen, mocap_s - offset, walk(mocap_s))
    assert found.offset_s == pytest.approx(offset, abs=0.012)
    assert found.halves_s == pytest.approx((offset, offset), abs=0.02)
    assert found.correlation > 0.8


@settings(max_examples=10)
@given(st.floats(-500, 500), st.integers(0, 1000))
def test_five_frames_a_second_are_enough_with_a_frame_missing_now_and_then(offset, seed):
    rng = np.random.default_rng(seed)
    camera_s, mocap_s = np.arange(0, 9.6, 0.2), np.arange(-0.5, 10.1, 0.01)
    seen = walk(camera_s) + rng.normal(0, 0.005, (len(camera_s), 2, 3))
    seen[rng.random(seen.shape[:2]) < 0.1] = np.nan
    assert clock_offset(camera_s, seen, mocap_s - offset, walk(mocap_s)).offset_s == pytest.approx(
        offset, abs=0.03
    )


def test_exact_positions_give_the_offset_to_a_millisecond():
    times_s = np.arange(0, 20, 0.01)
    found = clock_offset(times_s, walk(times_s), times_s - 0.1234, walk(times_s))
    assert found.offset_s == pytest.approx(0.1234, abs=1e-3)
    assert found.correlation > 0.999


def test_a_clock_that_drifts_shows_in_the_halves():
    camera_s, mocap_s = np.arange(0, 20, 1 / 30), np.arange(-1, 22, 0.01)
    found = clock_offset(camera_s, walk(camera_s * 1.01), mocap_s, walk(mocap_s))
    assert found.halves_s[1] - found.halves_s[0] == pytest.approx(-0.1, abs=0.03)


def test_it_is_the_correlation_numpy_finds_at_that_offset():
    times_s = np.arange(0, 10, 0.01)
    rng = np.random.default_rng(0)
    a, b = walk(times_s), walk(times_s) + np.cumsum(rng.normal(0, 0.003, (1000, 2, 3)), axis=0)
    b[300:400, 1] = np.nan
    found = clock_offset(times_s, a, times_s, b)
    lag = round(found.offset_s * 100)
    va, vb = _speeds(times_s, a), _speeds(times_s, b)
    va, vb = (va[lag:], vb[: len(vb) - lag]) if lag >= 0 else (va[:lag], vb[-lag:])
    both = np.isfinite(va) & np.isfinite(vb)
    va, vb = (np.concatenate([v[m, k] - v[m, k].mean() for k, m in enumerate(both.T)]) for v in (va, vb))
    assert found.correlation == pytest.approx(va @ vb / np.sqrt(va @ va * (vb @ vb)))


@pytest.mark.parametrize("seconds, moves", [(10, False), (1, True), (0.1, True)])
def test_without_enough_movement_there_is_no_offset(seconds, moves):
    camera_s = np.arange(0, seconds, 1 / 30)
    seen = walk(camera_s) if moves else np.zeros((len(camera_s), 2, 3))
    with pytest.raises(InputError, match="no clock offset"):
        clock_offset(camera_s, seen, np.arange(0, 10, 0.01), walk(np.arange(0, 10, 0.01)))


@pytest.mark.parametrize(("gap_s", "is_bridged"), [(0.045, True), (0.0450004, True), (0.0451, False)])
def test_gaps_end_at_45_ms_as_files_round_them(gap_s, is_bridged):
    times_s = np.array([0.0, gap_s])
    found_m = interpolate_mocap(times_s, np.zeros((2, 1, 3)), np.array([0.02]))
    assert np.isfinite(found_m).all() == is_bridged


@pytest.mark.parametrize(("seconds", "is_enough"), [(2.5, True), (2.1, False)])
def test_two_seconds_must_be_seen_of_all_points_together(seconds, is_enough):
    """Two seconds of one wrist, without the quarter of a second at both ends that smoothing takes."""
    times_s = np.arange(0, 10, 0.01)
    seen = walk(times_s)[:, :1]
    here = times_s < seconds
    if is_enough:
        found = clock_offset(times_s[here], seen[here], times_s, seen)
        assert found.offset_s == pytest.approx(0, abs=0.01)
    else:
        with pytest.raises(InputError, match="no clock offset"):
            clock_offset(times_s[here], seen[here], times_s, seen)


def test_speeds_are_of_the_smoothed_positions_and_at_most_those_of_people():
    times_s = np.arange(0, 3, 0.01)
    for speed_m_s, expected_m_s in ((0.2, 0.2), (0.49, 0.49), (4.5, 0.5)):
        speeds = _speeds(times_s, times_s[:, None, None] * [0, speed_m_s, 0])
        inner = speeds[np.isfinite(speeds)]
        assert len(inner) == len(speeds) - 24 and inner == pytest.approx(expected_m_s)


def test_the_halves_are_sought_near_the_whole():
    """A second half that fits best a second away says nothing: only half a second of drift is drift."""
    times_s = np.arange(0, 20, 0.01)
    shown = walk(times_s)
    for shift_s in (0.4, 3.0):
        later = np.where((times_s < 14)[:, None, None], shown, walk(times_s + shift_s))
        late_s = clock_offset(times_s, later, times_s, shown).halves_s[1]
        assert np.isnan(late_s) or abs(late_s) < 0.55


@pytest.mark.parametrize(("later_s", "is_enough"), [(4.0, True), (6.0, False)])
def test_half_of_what_one_clock_saw_is_enough_on_the_other(later_s, is_enough):
    """Ten seconds each, of which six or four are the same."""
    a_s, b_s = np.arange(0, 10, 0.01), later_s + np.arange(0, 10, 0.01)
    if is_enough:
        assert abs(clock_offset(a_s, walk(a_s), b_s, walk(b_s)).offset_s) < 0.01
    else:
        with pytest.raises(InputError, match="fit camera and motion capture alike"):
            clock_offset(a_s, walk(a_s), b_s, walk(b_s))


def swing(times_s, start_s=-np.inf, end_s=np.inf):
    """A wrist that swings once a second, from start to end."""
    t = 2 * np.pi * np.clip(times_s, start_s, end_s)
    return np.stack([0.15 * np.sin(t), 0.02 * np.cos(t), 0 * t], axis=-1)[:, None]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("between_s", "camera_s", "is_sure"),
    [
        ((-np.inf, np.inf), (0, 20), False),
        ((0, np.inf), (0, 20), False),  # the camera began to look when the wrist moved already
        ((0, np.inf), (-2, 20), True),
        ((-np.inf, 18), (0, 20), True),
        ((2, 15), (0, 20), True),
        ((2, 15), (2, 15), True),  # only motion capture saw start and end
    ],
)
def test_a_movement_that_repeats_gives_an_offset_only_by_its_start_or_end(between_s, camera_s, is_sure, seed):
    camera_s, mocap_s = np.arange(*camera_s, 1 / 30), np.arange(-15, 35, 0.01)
    seen = swing(camera_s, *between_s)
    seen = seen + np.random.default_rng(seed).normal(0, 0.008, seen.shape)
    if is_sure:
        found = clock_offset(100 + camera_s, seen, mocap_s + 87.5, swing(mocap_s, *between_s))
        assert found.offset_s == pytest.approx(12.5, abs=0.01)
    else:
        with pytest.raises(InputError, match="record a movement that does not repeat") as told:
            clock_offset(100 + camera_s, seen, mocap_s + 87.5, swing(mocap_s, *between_s))
        assert "\n" not in str(told.value)


@pytest.mark.parametrize("shift_s", [0.0, 0.3, 1.0])
def test_the_larger_overlap_of_a_movement_that_repeats_is_no_reason(shift_s):
    times_s = np.arange(0, 20, 0.01)
    with pytest.raises(InputError, match="alike"):
        clock_offset(times_s, swing(times_s), times_s + shift_s, swing(times_s + shift_s))


@pytest.mark.parametrize("seed", range(5))
def test_movements_that_have_nothing_to_do_with_each_other_have_no_offset(seed):
    rng = np.random.default_rng(seed)
    a_s, b_s = np.arange(0, 20, 1 / 30), np.arange(0, 30, 0.01)
    a, b = (np.cumsum(rng.normal(0, 0.2 * np.sqrt(t[1]), (len(t), 2, 3)), axis=0) for t in (a_s, b_s))
    with pytest.raises(InputError):
        clock_offset(a_s, a, b_s, b)


@pytest.mark.parametrize("seed", range(5))
def test_few_samples_that_are_alike_by_chance_do_not_win(seed):
    """The whole movement with much noise, rather than any part of it that chance makes alike."""
    rng = np.random.default_rng(seed)
    camera_s, mocap_s = np.arange(0, 20, 1 / 15), np.arange(-10, 30, 0.01)
    seen = walk(camera_s) + rng.normal(0, 0.03, (len(camera_s), 2, 3))
    assert clock_offset(camera_s, seen, mocap_s, walk(mocap_s)).offset_s == pytest.approx(0, abs=0.05)


@pytest.mark.parametrize(("variance", "moves"), [(1.2e-6, True), (0.8e-6, False)])
def test_what_hardly_moves_stands(variance, moves):
    speeds = np.random.default_rng(0).normal(size=(400, 1))
    speeds *= np.sqrt(variance / ((speeds - speeds.mean()) ** 2).sum())
    assert np.isfinite(_correlations(speeds, speeds)[0]).any() == moves


def test_at_its_peak_a_parabola_through_three_lags_gives_the_offset():
    rng = np.random.default_rng(1)
    a = rng.normal(size=(600, 1))
    values, _ = _correlations(a, np.roll(a, -3, axis=0) + np.roll(a, -2, axis=0))
    peak = int(np.nanargmax(values))
    lag, top, other = _best_lag(a, np.roll(a, -3, axis=0) + np.roll(a, -2, axis=0), 25.0)
    curve = np.polynomial.Polynomial.fit([-1, 0, 1], values[peak - 1 : peak + 2], 2)
    assert lag == pytest.approx(peak - 599 + curve.deriv().roots().item()) and top == values[peak]
    assert np.isnan(other)

"""One clock: positions between samples, and the offset between clocks."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hicp_lib.errors import InputError
from hicp_lib.rgbd.synchronisation import MAX_GAP_S, clock_offset, interpolate_mocap


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


@settings(max_examples=12)
@given(st.floats(-0.9, 0.9), st.integers(0, 1000))
def test_the_offset_is_found_in_any_frame_with_noise_and_gaps(offset, seed):
    rng = np.random.default_rng(seed)
    camera_s, mocap_s = np.arange(0, 16, 1 / 30), np.arange(-1, 17, 0.01)
    seen = Rotation.random(rng=rng).apply(walk(camera_s).reshape(-1, 3)).reshape(-1, 2, 3) + 5
    seen += rng.normal(0, 0.005, seen.shape)
    seen[rng.random(seen.shape[:2]) < 0.05] = np.nan
    found = clock_offset(camera_s, seen, mocap_s - offset, walk(mocap_s))
    assert found.offset_s == pytest.approx(offset, abs=0.01)
    assert found.halves_s == pytest.approx((offset, offset), abs=0.02)
    assert found.correlation > 0.8


def test_exact_positions_give_the_offset_to_a_millisecond():
    times_s = np.arange(0, 20, 0.01)
    found = clock_offset(times_s, walk(times_s), times_s - 0.1234, walk(times_s))
    assert found.offset_s == pytest.approx(0.1234, abs=1e-3)
    assert found.correlation > 0.999


def test_a_clock_that_drifts_shows_in_the_halves():
    camera_s = np.arange(0, 20, 1 / 30)
    mocap_s = np.arange(-1, 22, 0.01)
    found = clock_offset(camera_s, walk(camera_s * 1.01), mocap_s, walk(mocap_s))
    assert found.halves_s[1] - found.halves_s[0] == pytest.approx(-0.1, abs=0.03)


@pytest.mark.parametrize("shift_s", [3.0, 40.0])
def test_recordings_that_never_move_together_are_refused(shift_s):
    camera_s = np.arange(0, 10, 1 / 30)
    still = np.zeros((len(camera_s), 2, 3))
    with pytest.raises(InputError, match="no clock offset within 1 s"):
        clock_offset(camera_s, still, camera_s + shift_s, walk(camera_s))

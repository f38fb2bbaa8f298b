"""Flicker, jitter and latency, on tracks whose values are known."""

from dataclasses import replace

import numpy as np
import pytest

from hicp_lib.core.keypoints import N_KEYPOINTS
from hicp_lib.evaluation.space.flicker import best_person, causal_filter, flicker, latency_s
from hicp_lib.evaluation.statistics.resampling import Draws
from tests.evaluation.made_people import make_detections

RATE_HZ = 20.0
TIMES_S = np.arange(100) / RATE_HZ
POINTS = np.random.default_rng(2).uniform(50, 400, (N_KEYPOINTS, 2))


def frames(shift_px, given=None):
    """Detections of a person moved by (n, 2); keypoints of every frame given where (n,) is true."""
    given = np.ones(len(shift_px), bool) if given is None else given
    return [
        make_detections(POINTS[None] + shift if seen else np.full((1, N_KEYPOINTS, 2), np.nan))
        for shift, seen in zip(shift_px, given, strict=True)
    ]


def values(found):
    table = flicker({"d": found}, TIMES_S, draws=Draws(20))
    return table.set_index(["tracks", "measure"])["value"]


def test_a_still_person_neither_flickers_nor_jumps():
    found = values(frames(np.zeros((100, 2))))
    assert found["as detected", "flicker rate"] == found["filtered", "flicker rate"] == 0
    assert found["as detected", "jitter [px]"] == pytest.approx(0, abs=1e-9)


def test_steady_motion_is_no_jitter():
    assert values(frames(TIMES_S[:, None] * [80.0, -20.0]))["as detected", "jitter [px]"] == pytest.approx(
        0, abs=1e-9
    )


def test_jitter_measures_independent_errors():
    noise = np.random.default_rng(0).normal(0, 2.0, (100, 2))
    # Rayleigh distribution: the mean length of a normal vector is sigma sqrt(pi / 2).
    assert values(frames(noise))["as detected", "jitter [px]"] == pytest.approx(
        2 * np.sqrt(np.pi / 2), rel=0.15
    )


def test_single_frames_that_drop_out_flicker_and_the_filter_bridges_them():
    given = np.arange(100) % 10 != 5
    found = values(frames(np.zeros((100, 2)), given))
    assert found["as detected", "flicker rate"] == pytest.approx(20 / 99)
    assert found["filtered", "flicker rate"] == 0


def test_the_filter_smooths_errors_and_does_not_see_the_future():
    noise = np.random.default_rng(0).normal(0, 2.0, (100, 2))
    found = values(frames(noise))
    assert found["filtered", "jitter [px]"] < 0.6 * found["as detected", "jitter [px]"]
    tracks = best_person(frames(noise))
    changed = tracks.copy()
    changed[60:] += 100
    np.testing.assert_array_equal(causal_filter(tracks, TIMES_S)[:60], causal_filter(changed, TIMES_S)[:60])


def test_latency_is_the_delay_of_moving_tracks():
    tracks = best_person(frames(np.stack([40 * np.sin(2 * TIMES_S), 30 * np.cos(TIMES_S)], axis=1)))
    late = np.roll(tracks, 2, axis=0)
    late[:2] = np.nan
    assert latency_s(tracks, late, TIMES_S) == pytest.approx(2 / RATE_HZ, rel=0.1)
    assert latency_s(tracks, tracks, TIMES_S) == 0
    assert np.isnan(latency_s(tracks[:1].repeat(5, axis=0), tracks[:5], TIMES_S[:5]))


def test_frames_far_apart_are_not_compared():
    found = flicker(
        {"d": frames(np.zeros((5, 2)), np.array([1, 0, 1, 0, 1], bool))}, np.arange(5.0), draws=Draws(5)
    )
    assert found.loc[found["measure"] == "flicker rate", "n"].tolist() == [0, 0]


def test_only_sure_keypoints_of_the_best_person_count():
    people = make_detections(np.stack([POINTS, POINTS + 1000]), [0.2, 0.9])
    people.scores[1, 3] = 0.1
    track = best_person([people])
    assert np.isnan(track[0, 3]).all()
    np.testing.assert_array_equal(track[0, 4], POINTS[4] + 1000)


def test_a_threshold_decides_which_keypoints_are_given():
    person = make_detections(POINTS[None])
    found = [replace(person, scores=person.scores * (1.0 + 0.4 * (i % 2))) for i in range(100)]
    rates = {
        min_score: flicker({"d": found}, TIMES_S, draws=Draws(2), min_score=min_score)["value"].iloc[0]
        for min_score in (0.4, 0.6)
    }
    assert rates == {0.4: 0.0, 0.6: 1.0}


def track(given):
    """A keypoint that rests, given in some frames."""
    return np.where(np.array(given, bool)[:, None, None], 5.0, np.nan) * np.ones((1, 1, 2))


def test_the_filter_takes_a_keypoint_as_given_by_the_majority_of_three():
    filtered = causal_filter(track([1, 0, 0, 1, 1, 0, 1, 0, 0]), TIMES_S[:9])
    assert np.isfinite(filtered[:, 0, 0]).tolist() == [
        True,
        False,
        False,
        False,
        True,
        True,
        True,
        False,
        False,
    ]
    np.testing.assert_allclose(filtered[np.isfinite(filtered)], 5)


def test_after_half_a_second_the_filter_starts_anew():
    for gap_s, carried in ((0.5, True), (0.51, False)):
        tracks = np.array([0.0, 0.0, 100.0])[:, None, None] * np.ones((1, 1, 2))
        filtered = causal_filter(tracks, np.array([0.0, 0.1, 0.1 + gap_s]))
        assert (filtered[2, 0, 0] < 99) == carried and filtered[2, 0, 0] > 50


def test_jitter_of_an_error_in_one_frame():
    shift = np.zeros((100, 2))
    shift[50] = [3, 4]
    found = flicker({"d": frames(shift)}, TIMES_S, draws=Draws(2)).set_index(["tracks", "measure"])
    row = found.loc[("as detected", "jitter [px]")]
    # The second difference is 5, 10 and 5 long in three of 98 frames.
    assert row["value"] == pytest.approx(20 / np.sqrt(6) / 98) and row["n"] == 98 * 17


def test_half_a_second_still_counts_as_consecutive():
    given = np.array([1, 0, 1, 1], bool)
    for step_s, n in ((0.5, 3), (0.51, 0)):
        found = flicker({"d": frames(np.zeros((4, 2)), given)}, np.arange(4) * step_s, draws=Draws(2))
        assert found.loc[found["measure"] == "flicker rate", "n"].iloc[0] == n * 17


def test_intervals_are_over_stretches_of_a_second():
    """Half of twelve seconds flicker throughout: as wide as twelve draws are, not 240."""
    times_s = np.arange(240) / 20
    given = (np.arange(240) % 2 == 0) | (times_s < 6)
    row = flicker({"d": frames(np.zeros((240, 2)), given)}, times_s, draws=Draws(500)).iloc[0]
    assert 0.3 < row["high"] - row["low"] < 0.75
    few = flicker({"d": frames(np.zeros((180, 2)), given[:180])}, times_s[:180], draws=Draws(500)).iloc[0]
    assert np.isnan([few["low"], few["high"]]).all()  # nine stretches


@pytest.mark.parametrize("start_s", [0.0, 1.0])
def test_the_filter_is_a_one_euro_filter_of_one_and_a_half_hertz(start_s):
    """Casiez, Roussel and Vogel (2012): the cutoff is 1.5 Hz and 0.02 Hz more for every pixel per second."""

    def smoothing(cutoff_hz: float) -> float:
        return 1 / (1 + 1 / (2 * np.pi * cutoff_hz * 0.1))

    tracks = np.array([[0.0, 0.0], [100.0, -10.0]])[:, None]
    filtered = causal_filter(tracks, start_s + np.array([0.0, 0.1]))[1, 0]
    speeds_px_s = smoothing(1.0) * np.array([1000.0, 100.0])  # the speed itself is smoothed at 1 Hz
    expected = [smoothing(1.5 + 0.02 * speed) * x for speed, x in zip(speeds_px_s, (100, -10), strict=True)]
    np.testing.assert_allclose(filtered, expected, rtol=1e-6)

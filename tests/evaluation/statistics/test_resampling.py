"""Medians and shares under resampling, against the same made by repeating values."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hicp_lib.evaluation.statistics.resampling import Draws, draw_counts, weighted_median, with_interval

some_values = arrays(float, st.integers(1, 12), elements=st.one_of(st.just(np.nan), st.floats(-5, 5)))


@given(some_values, st.integers(0, 2**31))
def test_a_weighted_median_is_the_median_of_the_repeated_values(values, seed):
    weights = np.random.default_rng(seed).integers(0, 4, (5, len(values)))
    for got, counts in zip(weighted_median(values, weights), weights, strict=True):
        repeated = np.repeat(values, counts)
        kept = repeated[np.isfinite(repeated)]
        np.testing.assert_allclose(got, np.median(kept) if len(kept) else np.nan, atol=1e-12)


def test_draws_may_have_values_of_their_own():
    rng = np.random.default_rng(0)
    values, weights = rng.normal(size=(4, 9)), rng.integers(0, 3, (4, 9))
    alone = [weighted_median(row, counts[None])[0] for row, counts in zip(values, weights, strict=True)]
    assert weighted_median(values, weights).tolist() == alone


def test_the_first_draw_is_the_sample_and_every_draw_as_large():
    counts = draw_counts(17, Draws(50, 3))
    assert counts.shape == (51, 17) and (counts[0] == 1).all() and (counts.sum(axis=1) == 17).all()
    assert (draw_counts(17, Draws(50, 3)) == counts).all() and counts[1:].std() > 0


def test_a_handful_says_nothing_about_its_own_spread():
    times = draw_counts(9, Draws(50, 3))
    assert times.tolist() == [[1] * 9]
    value, low, high = with_interval(times @ np.arange(9) / times.sum(axis=1))
    assert value == 4 and np.isnan([low, high]).all()


def test_intervals_are_percentiles_of_the_draws_that_count():
    draws = np.r_[5.0, np.linspace(0, 1, 101), np.nan]
    np.testing.assert_allclose(with_interval(draws), (5, 0.025, 0.975))
    value, low, high = with_interval(np.array([[1.0, 2.0]]))
    assert value.tolist() == [1, 2] and np.isnan([low, high]).all()


def test_the_interval_of_a_mean_is_as_wide_as_theory_says():
    values = np.random.default_rng(1).normal(size=400)
    weights = draw_counts(400, Draws(2000))
    _, low, high = with_interval(weights @ values / 400)
    np.testing.assert_allclose(high - low, 2 * 1.96 * values.std() / 20, rtol=0.06)


def test_ten_images_are_drawn_again():
    assert draw_counts(10, Draws(50, 3)).shape == (51, 10)


def test_one_subject_is_drawn_frame_by_frame():
    """The multinomial draws of before there were subjects, and the blocks'."""
    drawn = np.random.default_rng(3).multinomial(17, np.full(17, 1 / 17), size=50)
    assert (draw_counts(17, Draws(50, 3))[1:] == drawn).all()
    assert (draw_counts(["only"] * 17, Draws(50, 3))[1:] == drawn).all()
    assert (draw_counts(np.full(40, 7), Draws(5, 1), 3) == draw_counts(40, Draws(5, 1), 3)).all()


@pytest.mark.parametrize("length", [1, 3])
def test_people_are_drawn_and_with_each_as_many_frames_as_there_are(length):
    people = np.array(list("abcdefghijkl") * 6)
    counts = draw_counts(people, Draws(400), length)
    of_each = np.stack([counts[:, people == name].sum(axis=1) for name in "abcdefghijkl"], axis=1)
    assert (of_each % 6 == 0).all() and (of_each[0] == 6).all() and (of_each.sum(axis=1) == 72).all()
    assert of_each[1:].min() == 0 and of_each.max() >= 18  # nobody, and somebody three times
    # Frames of those drawn once: drawn again, too, not taken as they are.
    assert counts[1:, people == "a"][of_each[1:, 0] == 6].std() > 0.3


def test_nine_people_say_nothing_of_people_however_many_their_frames():
    assert len(draw_counts(np.repeat(np.arange(9), 50), Draws(20))) == 1
    assert len(draw_counts(np.repeat(np.arange(10), 2), Draws(20))) == 21


@pytest.mark.parametrize("n_people, between, least, most", [
    (12, 0.0, 0.96, 1.0),  # frames count twice where people do not differ
    (12, 1.0, 0.91, 0.985),
    (12, 5.0, 0.91, 0.985),
    (40, 1.0, 0.91, 0.985),
])  # fmt: skip
def test_intervals_over_people_cover_the_mean(n_people, between, least, most):
    rng, people = np.random.default_rng(n_people), np.repeat(np.arange(n_people), 10)
    weights = draw_counts(people, Draws(500))
    covered = alone = 0
    for _ in range(300):
        values = between * rng.normal(size=n_people)[people] + rng.normal(size=len(people))
        _, low, high = with_interval(weights @ values / len(people), n_people)
        covered += low <= 0 <= high
        _, low, high = with_interval(draw_counts(len(people), Draws(500)) @ values / len(people))
        alone += low <= 0 <= high
    assert least <= covered / 300 <= most
    assert (alone / 300 < 0.7) == (between > 0)  # as if the frames were all of different people


def test_of_few_people_intervals_are_wider_than_percentiles_that_fit_many():
    draws = np.random.default_rng(0).normal(size=20_001)
    assert np.isnan([with_interval(draws, n)[1:] for n in (0, 2, 9)]).all()
    widths = [np.diff(with_interval(draws, n)[1:])[0] for n in (1, 10_000, 12)]
    assert widths[0] == pytest.approx(widths[1], rel=1e-3)
    # Student's with 11 degrees of freedom, and the deviation of 12 from their own mean.
    assert widths[2] / widths[0] == pytest.approx(2.201 * np.sqrt(12 / 11) / 1.96, rel=0.02)

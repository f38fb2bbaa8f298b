"""Medians and shares under resampling, against the same made by repeating values."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hicp_lib.evaluation.statistics.resampling import draw_counts, weighted_median, with_interval

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
    counts = draw_counts(17, 50, seed=3)
    assert counts.shape == (51, 17) and (counts[0] == 1).all() and (counts.sum(axis=1) == 17).all()
    assert (draw_counts(17, 50, seed=3) == counts).all() and counts[1:].std() > 0


def test_a_handful_says_nothing_about_its_own_spread():
    times = draw_counts(9, 50, seed=3)
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
    weights = draw_counts(400, 2000, seed=0)
    _, low, high = with_interval(weights @ values / 400)
    np.testing.assert_allclose(high - low, 2 * 1.96 * values.std() / 20, rtol=0.06)


def test_ten_images_are_drawn_again():
    assert draw_counts(10, 50, seed=3).shape == (51, 10)

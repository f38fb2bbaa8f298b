"""Medians and shares under resampling, against the same made by repeating values."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hicp_lib.evaluation.statistics.resampling import (
    MIN_DRAWN,
    Draws,
    block_length,
    draw_counts,
    weighted_median,
    with_interval,
)

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


def autoregressive(rho: float, n: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    series = np.zeros((n, 3))
    for k in range(1, n):
        series[k] = rho * series[k - 1] + rng.normal(size=3)
    return series


def test_independent_errors_need_short_blocks_and_lasting_ones_long_blocks():
    lengths = [block_length(autoregressive(rho, 480)) for rho in (0.0, 0.6, 0.9, 0.99)]
    assert lengths == sorted(lengths)
    assert lengths[0] <= 3 and 10 <= lengths[2] <= 60 and lengths[3] > 60


def test_the_length_does_not_depend_on_the_unit_or_on_outliers():
    series = autoregressive(0.9, 480)
    wild = series.copy()
    wild[100] = 1e6
    assert block_length(series) == block_length(5 * series - 3)
    assert abs(block_length(wild) - block_length(series)) <= 1


def test_gaps_and_missing_series_are_left_out():
    series = autoregressive(0.9, 480)
    gaps = np.where(np.random.default_rng(1).random(series.shape) < 0.2, np.nan, series)
    gaps = np.c_[gaps, np.full(480, np.nan)]
    assert 0.6 < block_length(gaps) / block_length(series) < 1.6
    assert block_length(np.full((100, 2), np.nan)) == 1 and block_length(series[:5]) == 1


@given(st.integers(1, 60), st.integers(1, 20), st.integers(0, 100))
def test_every_draw_has_as_many_frames_and_the_first_is_the_sample(n, length, seed):
    length = min(length, n)
    counts = draw_counts(n, Draws(5, seed), length)
    n_drawn = 6 if -(-n // length) >= MIN_DRAWN else 1  # too few blocks tell nothing of the spread
    assert counts.shape == (n_drawn, n) and (counts[0] == 1).all() and (counts.sum(axis=1) == n).all()


def test_frames_are_drawn_with_their_neighbours():
    counts = draw_counts(400, Draws(50), 40)[1:]
    steps = (np.diff(counts, axis=1) != 0).sum(axis=1)
    # Ten blocks have at most twenty ends; frames drawn one by one would change almost everywhere.
    assert steps.max() <= 20


def test_intervals_of_lasting_errors_cover_the_mean_where_single_frames_do_not():
    covered = {1: 0, 40: 0}
    for seed in range(60):
        series = autoregressive(0.9, 480, seed)[:, 0]
        for length in covered:
            weights = draw_counts(480, Draws(200, seed), length)[1:]
            low, high = np.percentile(weights @ series / 480, [2.5, 97.5])
            covered[length] += low <= 0 <= high
    assert covered[40] > 45 and covered[1] < 35


def test_blocks_are_as_long_as_the_rule_says():
    """Sherman, Speed and Speed's length of an autoregressive process, from the signs' correlation."""
    signs = np.sign(autoregressive(0.6, 480) - np.median(autoregressive(0.6, 480), axis=0))
    rho = np.sin(np.pi / 2 * (signs[1:] * signs[:-1]).mean())
    expected = 480 ** (1 / 3) * (np.sqrt(6) * rho / (1 - rho**2)) ** (2 / 3)
    assert block_length(autoregressive(0.6, 480)) == np.ceil(expected)


def test_eight_frames_are_the_fewest_and_a_quarter_of_them_the_longest():
    rising = np.arange(100.0)[:, None]
    assert [block_length(rising[:n]) for n in (7, 8, 100)] == [1, 2, 25]


def test_ten_blocks_are_drawn_again_and_nine_are_not():
    assert len(draw_counts(100, Draws(5), 10)) == 6 and len(draw_counts(90, Draws(5), 10)) == 1


def test_a_single_pair_of_neighbours_counts_in_full():
    errors = np.full((40, 1), np.nan)
    errors[[0, 1, 4, 6], 0] = 2, 2, 0, 0
    assert block_length(errors) == 10  # the longest: as alike as neighbours can be


def test_of_few_frames_every_one_is_a_block():
    assert [block_length(np.arange(n)[:, None] * 1.0) for n in (1, 3, 7)] == [1, 1, 1]


def test_people_differ_and_that_makes_no_frames_alike():
    """One person's frames after another's: independent within, apart between."""
    people = np.repeat(np.arange(12), 40)
    errors = np.random.default_rng(0).normal(size=(480, 3)) + 10.0 * people[:, None]
    assert block_length(errors) > 40 and block_length(errors, people) <= 3


def test_of_several_people_a_length_is_as_of_one():
    series = np.concatenate([autoregressive(0.9, 480, seed) for seed in range(8)])
    together = block_length(series, np.repeat(np.arange(8), 480))
    alone = [block_length(autoregressive(0.9, 480, seed)) for seed in range(8)]
    assert min(alone) <= together <= max(alone)
    assert block_length(series[:480], np.zeros(480)) == alone[0]


def test_a_share_of_nought_or_one_has_the_exact_interval_of_its_people():
    draws = np.tile([0.0, 1.0, 0.5], (21, 1))
    _, low, high = with_interval(draws, 12, n_frames=96)
    reach = 0.025 ** (1 / 12)
    assert low.tolist() == pytest.approx([0, reach, 0.5])
    assert high.tolist() == pytest.approx([1 - reach, 1, 0.5])
    assert with_interval(draws[:, 0], 1, n_frames=20)[2] == pytest.approx(1 - 0.025 ** (1 / 20))
    for n_people, n_frames in ((1, 9), (9, 90), (0, 90)):
        assert np.isnan(with_interval(draws, n_people, n_frames)[1:]).all()

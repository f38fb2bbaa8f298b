"""Moving block bootstrap: blocks as long as errors are alike, drawn whole."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hicp_lib.evaluation.statistics.resampling import MIN_DRAWN, Draws, draw_counts
from hicp_lib.evaluation.statistics.time_blocks import block_length


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

"""Shares with intervals."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.evaluation.statistics.proportions import (
    mean_with_interval,
    paired_differences,
    proportions,
)


def test_shares_are_means_of_what_is_known():
    rows = pd.DataFrame({"who": ["b", "a", "a", "a"], "source_image": [1, 1, 2, 3], "hit": [1, 0, 1, np.nan]})
    table = proportions(rows, ["who"], "hit", n_resamples=50)
    assert table["who"].tolist() == ["b", "a"] and table["value"].tolist() == [1, 0.5]
    assert table["n"].tolist() == [1, 2] and table["n_images"].tolist() == [1, 2]


def test_rows_of_one_image_are_drawn_together():
    images = np.repeat(np.arange(20), 50)
    alone = mean_with_interval(images % 2, np.arange(1000))
    together = mean_with_interval(images % 2, images)
    assert alone[0] == together[0] == 0.5
    # Fifty equal rows say no more than one.
    assert (together[2] - together[1]) / (alone[2] - alone[1]) == pytest.approx(np.sqrt(50), rel=0.15)


def test_of_nothing_there_is_no_mean():
    assert np.isnan(mean_with_interval(np.zeros(0), np.zeros(0))).all()


def test_paired_differences_see_what_intervals_side_by_side_do_not():
    rng = np.random.default_rng(0)
    hard, n = rng.random(60), 60  # images that are hard for both
    hits = {"a": (hard < 0.6).astype(float), "b": (hard < 0.5).astype(float)}
    rows = pd.concat(
        [pd.DataFrame({"who": who, "source_image": np.arange(n), "hit": hit}) for who, hit in hits.items()]
    ).assign(view="upper")
    less = paired_differences(rows, ["view"], "who", "hit", 400).set_index("pair")
    apart = proportions(rows, ["view", "who"], "hit", 400).set_index("who")
    a, b = less.loc["a less b"], less.loc["b less a"]
    assert a["value"] == pytest.approx(hits["a"].mean() - hits["b"].mean()) and a["low"] > 0
    assert (b["value"], b["low"], b["high"]) == (-a["value"], -a["high"], -a["low"])
    assert apart.loc["a", "low"] < apart.loc["b", "high"]  # side by side they overlap


def test_images_that_lack_one_of_a_pair_are_left_out_of_it():
    rows = pd.DataFrame({"view": 1, "who": list("aaab"), "source_image": [1, 1, 2, 1], "hit": [0, 1, 1, 1]})
    row = paired_differences(rows, ["view"], "who", "hit").iloc[0]
    assert (row["value"], row["n_images"]) == (-0.5, 1) and np.isnan(row["low"])

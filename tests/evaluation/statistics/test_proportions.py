"""Shares with intervals."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.evaluation.statistics.proportions import (
    mean_with_interval,
    paired_differences,
    proportions,
)
from hicp_lib.evaluation.statistics.resampling import Draws


def test_shares_are_means_of_what_is_known():
    rows = pd.DataFrame({"who": ["b", "a", "a", "a"], "source_image": [1, 1, 2, 3], "hit": [1, 0, 1, np.nan]})
    table = proportions(rows, ["who"], "hit", draws=Draws(50))
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
    less = paired_differences(rows, ["view"], "who", "hit", Draws(400)).set_index("pair")
    apart = proportions(rows, ["view", "who"], "hit", Draws(400)).set_index("who")
    a, b = less.loc["a less b"], less.loc["b less a"]
    assert a["value"] == pytest.approx(hits["a"].mean() - hits["b"].mean()) and a["low"] > 0
    assert (b["value"], b["low"], b["high"]) == (-a["value"], -a["high"], -a["low"])
    assert apart.loc["a", "low"] < apart.loc["b", "high"]  # side by side they overlap


def test_images_that_lack_one_of_a_pair_are_left_out_of_it():
    rows = pd.DataFrame({"view": 1, "who": list("aaab"), "source_image": [1, 1, 2, 1], "hit": [0, 1, 1, 1]})
    row = paired_differences(rows, ["view"], "who", "hit").iloc[0]
    assert (row["value"], row["n_images"]) == (-0.5, 1) and np.isnan(row["low"])


def of_people(between: float, n_people: int = 12, seed: int = 0) -> pd.DataFrame:
    """Ten images of each person in two ways; the second adds to the first what differs between people."""
    rng, people = np.random.default_rng(seed), np.repeat(np.arange(n_people), 10)
    first = rng.normal(size=len(people))
    second = first + 1 + between * rng.normal(size=n_people)[people] + 0.1 * rng.normal(size=len(people))
    rows = pd.DataFrame({"subject": people, "source_image": np.arange(len(people)), "view": "upper"})
    return pd.concat([rows.assign(way="first", of=first), rows.assign(way="second", of=second)])


def test_people_are_drawn_where_rows_say_whose_they_are():
    rows = of_people(between=3.0)
    table = proportions(rows, ["way"], "of").set_index("way").loc["second"]
    frames = proportions(rows.drop(columns="subject"), ["way"], "of").set_index("way").loc["second"]
    assert (table["n_people"], table["n_images"], table["n"]) == (12, 120, 120) and "n_people" not in frames
    assert table["value"] == frames["value"]
    assert table["high"] - table["low"] > 2 * (frames["high"] - frames["low"])


def test_of_one_person_intervals_are_over_images():
    rows = of_people(1.0, n_people=1)
    alone = rows.drop(columns="subject")
    pd.testing.assert_frame_equal(
        proportions(rows, ["way"], "of").drop(columns="n_people"), proportions(alone, ["way"], "of")
    )
    less = paired_differences(rows, ["view"], "way", "of")
    assert (less["n_people"] == 1).all() and less["detectable"].isna().all() and less["low"].notna().all()
    pd.testing.assert_frame_equal(
        less.drop(columns=["n_people", "detectable"]), paired_differences(alone, ["view"], "way", "of")
    )


def test_comparisons_say_what_difference_so_many_people_would_show():
    for between in (0.3, 3.0):
        less = paired_differences(of_people(between), ["view"], "way", "of").set_index("pair")
        row = less.loc["second less first"]
        assert (row["n_people"], row["n_images"]) == (12, 120)
        assert row["detectable"] == less.loc["first less second", "detectable"]
        assert 0.5 < row["detectable"] / (3.08 * between / np.sqrt(12)) < 1.6
        assert row["low"] < 1 < row["high"]


def test_images_of_equal_number_of_two_people_are_two():
    people, images = np.repeat(np.arange(20), 2), np.tile([0, 1], 20)
    apart = mean_with_interval(people % 2, images, subjects=people)
    assert apart == mean_with_interval(people % 2, np.arange(40), subjects=people)


def test_flags_that_are_alike_in_all_people_count_each_person_once():
    never = np.zeros(120, bool)
    high = mean_with_interval(never, np.arange(120), subjects=np.repeat(np.arange(12), 10))[2]
    assert high == pytest.approx(1 - 0.025 ** (1 / 12))


def test_shares_that_are_all_1_have_an_exact_interval_and_differences_of_0_none():
    rows = pd.DataFrame(
        {"part": "arm", "subject": np.repeat(np.arange(12), 8), "source_image": np.arange(96)}
    )
    whole = proportions(rows.assign(share=1.0), ["part"], "share").iloc[0]
    assert whole["low"] == pytest.approx(0.025 ** (1 / 12)) and whole["high"] == 1
    same = proportions(rows.assign(change=0.0), ["part"], "change", are_shares=False).iloc[0]
    assert (same["low"], same["high"]) == (0, 0)

"""What a design can tell, on data whose variances are known."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import ttest_1samp

from hicp_lib.evaluation.statistics.proportions import (
    component_table,
    smallest_difference,
    variance_components,
)


@pytest.mark.parametrize("between, within", [(2.0, 1.0), (0.5, 3.0), (0.0, 1.0)])
def test_variances_between_people_and_their_frames_are_told_apart(between, within):
    rng = np.random.default_rng(0)
    people = np.repeat(np.arange(400), rng.integers(2, 9, 400))  # not as many frames of each
    values = between * rng.normal(size=400)[people] + within * rng.normal(size=len(people))
    got = np.sqrt(variance_components(np.r_[values, np.nan], np.r_[people, 0]))
    np.testing.assert_allclose(got, (between, within), rtol=0.1, atol=0.15)


def test_they_say_how_much_the_mean_varies():
    """Over many samples of 12 people with 10 frames."""
    rng, people = np.random.default_rng(1), np.repeat(np.arange(12), 10)
    means, said = [], []
    for _ in range(400):
        values = 0.5 * rng.normal(size=12)[people] + rng.normal(size=120)
        between, within = variance_components(values, people)
        means.append(values.mean())
        said.append(between / 12 + within / 120)
    assert np.var(means) == pytest.approx(np.mean(said), rel=0.15)


def test_one_person_or_one_value_of_each_tells_no_variances():
    assert np.isnan(variance_components([1, 2, 3], [0, 0, 0])).all()
    assert np.isnan(variance_components([1, 2, 3], [0, 1, 2])).all()


def test_the_smallest_difference_is_found_in_four_samples_of_five():
    rng = np.random.default_rng(0)
    detectable = np.mean([smallest_difference(rng.normal(size=12)) for _ in range(300)])
    samples = rng.normal(detectable, 1, (4000, 12))
    found = ttest_1samp(samples, 0, axis=1).pvalue < 0.05
    assert found.mean() == pytest.approx(0.8, abs=0.03)
    assert smallest_difference(rng.normal(size=1000)) < detectable / 5


def test_nothing_is_detectable_in_one_person_or_where_all_are_alike():
    assert np.isnan([smallest_difference(of) for of in ([1.0], [np.nan, 1.0], [2.0, 2.0, 2.0], [])]).all()


def test_views_people_and_images_have_variances_of_their_own():
    rng = np.random.default_rng(0)
    rows = pd.MultiIndex.from_product(
        [("upper", "lower"), range(200), range(5)], names=["view", "subject", "image"]
    ).to_frame(index=False)
    of_view, of_person = {"upper": 0.0, "lower": 2.0}, 0.5 * rng.normal(size=(2, 200))
    person = of_person[(rows["view"] == "lower").astype(int), rows["subject"]]
    rows["value"] = rows["view"].map(of_view) + person + 0.1 * rng.normal(size=len(rows))
    rows["part"] = "wrist"
    row = component_table(rows, ["part"], "value").iloc[0]
    assert row["views"] == pytest.approx(2.0, rel=0.1)  # the variance of 0 and 2
    assert np.sqrt(row[["people", "images"]].to_list()) == pytest.approx([0.5, 0.1], rel=0.1)
    assert (row["part"], row["n_people"]) == ("wrist", 200)
    one_view = component_table(rows[rows["view"] == "upper"], ["part"], "value").iloc[0]
    assert np.isnan(one_view["views"]) and one_view["people"] == pytest.approx(0.25, rel=0.2)

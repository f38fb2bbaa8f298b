"""Calibration: monotone curves, fitted on images they are not judged on."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hicp_lib.core.errors import InputError
from hicp_lib.evaluation.calibration.curves import (
    Calibration,
    calibration_study,
    calibration_table,
    calibrations_of,
    reliability,
    split_half,
)
from hicp_lib.evaluation.statistics.resampling import Draws
from tests.evaluation.made_people import make_detections

POINTS = np.random.default_rng(0).uniform(50, 400, (1, 136, 2))

scored = st.lists(st.tuples(st.floats(0, 1), st.booleans()), min_size=1, max_size=60)


@given(scored, st.lists(st.floats(0, 1), min_size=2, max_size=20))
@settings(deadline=None)
def test_a_higher_score_never_becomes_a_lower_one(rows, asked):
    scores, hits = np.array([row[0] for row in rows]), np.array([row[1] for row in rows], float)
    values = Calibration.fit(scores, hits)(np.sort(asked))
    assert (np.diff(values) >= 0).all()
    assert ((values >= 0) & (values <= 1)).all()


@given(scored)
@settings(deadline=None)
def test_the_curve_is_the_best_monotone_one(rows):
    """Pool-adjacent-violators by its min-max formula, and the mean is kept."""
    scores, hits = np.array([row[0] for row in rows]), np.array([row[1] for row in rows], float)
    levels, place = np.unique(scores, return_inverse=True)
    n = len(levels)
    sums, counts = np.bincount(place, hits), np.bincount(place)
    best = [
        max(min(sums[a : b + 1].sum() / counts[a : b + 1].sum() for b in range(i, n)) for a in range(i + 1))
        for i in range(n)
    ]
    fitted = Calibration.fit(scores, hits)
    np.testing.assert_allclose(fitted(levels), best, atol=1e-9)
    assert fitted(scores).mean() == pytest.approx(hits.mean())


@given(scored, st.randoms(use_true_random=False))
@settings(deadline=None)
def test_the_order_of_rows_changes_nothing(rows, random):
    shuffled = random.sample(rows, len(rows))
    one, other = (
        Calibration.fit(np.array([row[0] for row in r]), np.array([row[1] for row in r], float))
        for r in (rows, shuffled)
    )
    np.testing.assert_allclose(one(np.linspace(0, 1, 50)), other(np.linspace(0, 1, 50)), atol=1e-12)


def test_nothing_to_fit_to_is_an_error_in_words():
    with pytest.raises(InputError, match="more images"):
        Calibration.fit(np.zeros(0), np.zeros(0))


def test_applied_scores_are_new_and_the_raw_ones_stay():
    found = make_detections(POINTS[:1])
    found.keypoints_px[0, 4], found.scores[0, 4] = np.nan, 0.0
    raw = found.scores.copy()
    done = Calibration(np.array([0.0, 1.0]), np.array([0.4, 1.0])).apply(found, "body")
    assert done.scores[0, 0] == pytest.approx(0.7)
    assert done.scores[0, 4] == 0 and np.isnan(done.keypoints_px[0, 4]).all()
    np.testing.assert_array_equal(done.scores[0, 17:], raw[0, 17:])
    np.testing.assert_array_equal(found.scores, raw)


@given(st.lists(st.integers(0, 12), min_size=1, max_size=80), st.integers(0, 5))
def test_no_source_image_is_on_both_sides_of_the_split(groups, seed):
    groups = pd.Series(groups)
    fits_on = split_half(groups, seed)
    assert not set(groups[fits_on]) & set(groups[~fits_on])
    assert len(set(groups[fits_on])) == (groups.nunique() + 1) // 2


def test_calibration_error_by_hand():
    """Of the half held out: bins .9 to 1 and .1 to .2, hit rates 1/2 and 0."""
    scores, hits = np.tile([0.95, 0.95, 0.15, 0.15], 30), np.tile([1, 0, 0, 0], 30)
    table = pd.DataFrame({"detector": "a", "group": "body", "source_image": np.repeat(range(30), 4)})
    errors, _, _ = calibration_study(table.assign(score=scores, hit=hits.astype(bool)), draws=Draws(50))
    row = errors.iloc[0]
    assert row["raw"] == pytest.approx((2 * 0.45 + 2 * 0.15) / 4)
    assert row["calibrated"] == pytest.approx(0, abs=1e-12)
    assert row["change"] == pytest.approx(row["calibrated"] - row["raw"])
    assert (row["n_keypoints"], row["n_images"], row["hit_rate"]) == (60, 15, 0.25)


def test_reliability_has_a_row_per_bin_in_use():
    times = (12, 12, 12, 3)
    scores, hits = np.repeat([0.05, 0.05, 0.55, 1.0], times), np.repeat([0, 1, 1, 1], times)
    table = reliability(scores, hits, np.arange(39), draws=Draws(50))
    assert table["bin"].tolist() == [0, 5, 9] and table["count"].tolist() == [24, 12, 3]
    assert table["rate"].tolist() == [0.5, 1, 1]
    assert (table["low"] < table["rate"])[:2].all() and (table["rate"] <= table["high"])[:2].all()
    assert table.loc[1, "low"] == pytest.approx(0.025 ** (1 / 12)) and table.loc[1, "high"] == 1
    assert table.loc[2, ["low", "high"]].isna().all()  # three pictures


def crooked(n: int = 4000, seed: int = 0) -> pd.DataFrame:
    """A detector that is right with the square root of its score."""
    rng = np.random.default_rng(seed)
    score = rng.random(n)
    labels = {"detector": "d", "group": "body", "image_id": np.arange(n), "keypoint": 0}
    return pd.DataFrame(
        {
            **labels,
            "source_image": rng.integers(0, 100, n),
            "score": score,
            "hit": rng.random(n) < np.sqrt(score),
        }
    )


def test_calibration_mends_a_crooked_scale_on_images_it_has_not_seen():
    errors, curves, calibrations = calibration_study(crooked(), draws=Draws(100))
    row = errors.iloc[0]
    assert row["raw"] == pytest.approx(1 / 6, abs=0.02)  # the mean of sqrt(s) - s
    assert row["calibrated_high"] < row["raw_low"] and row["change_high"] < 0
    assert calibrations["d", "body"](np.array(0.25)) == pytest.approx(0.5, abs=0.06)
    assert set(curves["scores"]) == {"raw", "calibrated"}


def test_hits_of_the_images_judged_on_do_not_reach_the_calibration():
    hits = crooked()
    judged = ~split_half(hits["source_image"])
    other = hits.assign(hit=np.where(judged, ~hits["hit"], hits["hit"]))
    curves = [calibration_study(table, draws=Draws(2))[2]["d", "body"] for table in (hits, other)]
    np.testing.assert_array_equal(curves[0].rates, curves[1].rates)
    np.testing.assert_array_equal(curves[0].scores, curves[1].scores)


def test_calibrations_come_back_from_their_table():
    before = {("d", group): Calibration.fit(np.array([0.1, 0.4, 0.9]), np.array([0, 1, 1])) for group in "ab"}
    after = calibrations_of(calibration_table(before))
    assert after.keys() == before.keys()
    for case, calibration in after.items():
        np.testing.assert_array_equal(calibration.scores, before[case].scores)
        np.testing.assert_array_equal(calibration.rates, before[case].rates)

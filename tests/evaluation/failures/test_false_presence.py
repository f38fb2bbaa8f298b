"""Parts of people that are invented: counted over everybody, with honest intervals."""

import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.evaluation.failures.false_presence import DECISIONS, false_presence
from hicp_lib.evaluation.failures.placed_keypoints import placed_keypoints
from hicp_lib.evaluation.statistics.resampling import Draws
from tests.evaluation.failures.test_presence import N_PEOPLE, NAME, study


def shares(truth, found, source, **options):
    table = false_presence(truth, found, placed_keypoints(truth, found, source), source, **options)
    assert set(table["part"]) == {"head"} and (table["n"] == N_PEOPLE).all()
    return table.set_index("decision")


def test_heads_put_into_the_picture_are_invented_and_those_beyond_it_are_not():
    table = shares(*study(0.8, lambda i: i % 4 == 0), draws=Draws(50))
    assert table.loc[DECISIONS[0], "value"] == 0.25
    assert table.loc[DECISIONS[0], "low"] < 0.25 < table.loc[DECISIONS[0], "high"]
    assert (table["n_found"] == N_PEOPLE).all()


def test_a_score_below_the_threshold_invents_nothing_and_none_seen_is_not_never():
    row = shares(*study(0.2, lambda i: True), draws=Draws(50)).loc[DECISIONS[0]]
    assert (row["value"], row["low"]) == (0, 0) and row["high"] == pytest.approx(1 - 0.025 ** (1 / N_PEOPLE))


def test_calibrated_scores_know_that_a_head_is_never_there_where_it_never_is():
    assert shares(*study(0.8, lambda i: True)).loc[DECISIONS[1], "value"] == 0


def test_one_keypoint_makes_a_head():
    truth, found, source = study(0.8, lambda i: False)
    for people in found["headless", NAME].values():
        people.keypoints_px[0, 3] = 320, 240
    assert shares(truth, found, source).loc[DECISIONS[0], "value"] == 1


def test_somebody_who_is_not_found_counts_and_is_made_up_nothing_for():
    truth, found, source = study(0.8, lambda i: True)
    found["headless", NAME] |= {i: Detections.none() for i in range(30)}
    row = shares(truth, found, source).loc[DECISIONS[0]]
    assert row["value"] == 0.25 and row["n_found"] == 10

"""Scores of what is not there to be seen, and the paper's remarks as measures."""

import numpy as np
import pytest

from hicp_lib.evaluation.failures.error_kinds import all_errors
from hicp_lib.evaluation.failures.false_confidence import MEASURES, paper_remarks, scores_by_state
from hicp_lib.evaluation.failures.placed_keypoints import placed_keypoints
from hicp_lib.evaluation.statistics.resampling import Draws
from tests.evaluation.made_people import HIDDEN


def test_scores_are_set_against_hits_apart_for_every_state(world):
    source, truth, found = world
    found["headless", "mediapipe-pose"][5].scores[0, :5] = 0.95
    found["headless", "mediapipe-pose"][5].keypoints_px[0, :5] += 400
    table = scores_by_state(placed_keypoints(truth, found, source), draws=Draws(5)).set_index("state")
    assert table.loc["outside", ["score", "value", "n"]].tolist() == pytest.approx([0.95, 0, 5])
    assert table.loc["visible", "value"] == table.loc["hidden", "value"] == 1


def test_every_remark_of_the_paper_is_measured_and_what_was_not_run_is_said(world):
    source, truth, found = world
    run = {"headless": found["headless", "mediapipe-pose"][5]}["headless"]
    run.scores[0, [5, 6]] = 0.1  # shoulders
    run.keypoints_px[0, HIDDEN] = np.nan  # the left wrist is not given, the left hand is
    run.scores[0, HIDDEN] = 0
    found = {("headless", "mediapipe"): {5: run}}
    placed, errors = placed_keypoints(truth, found, source), all_errors(truth, found)
    table = paper_remarks(placed, errors, truth, found, draws=Draws(5))
    assert list(dict.fromkeys(table["measure"])) == list(MEASURES)
    value = table[table["status"] == "run"].set_index("measure")["value"]
    assert value["outside the picture: given"] == 1
    assert value["hands given without their wrist"] == 0.5
    assert value["mean score of shoulders, less that of the other joints"] == pytest.approx(-0.4)
    assert value["labelled keypoints given with a score of at least 0.3"] == pytest.approx(8 / 11)
    absent = table[table["status"] == "not run"]
    assert set(absent["detector"]) == set(MEASURES.values()) and absent["value"].isna().all()


def test_what_is_sure_begins_at_three_tenths_and_bins_at_fifths(world):
    source, truth, found = world
    run = found["headless", "mediapipe-pose"][5]
    scores = np.array([0.19, 0.2, 0.39, 0.4, 1.0])
    run.scores[0, :5] = scores  # outside the picture
    run.scores[0, 7:9] = 0.3, np.nextafter(0.3, 0)
    placed, errors = placed_keypoints(truth, found, source), all_errors(truth, found)
    bins = scores_by_state(placed, draws=Draws(5)).query("state == 'outside'")
    assert bins.set_index("bin")["n"].to_dict() == {0: 1, 1: 2, 2: 1, 4: 1}
    table = paper_remarks(placed, errors, truth, found, draws=Draws(5)).set_index("measure")
    run_rows = table[table["status"] == "run"]
    assert run_rows.loc["labelled keypoints given with a score of at least 0.3", "value"] == pytest.approx(
        10 / 11
    )
    assert run_rows.loc["labelled keypoints given with a score of at least 0.3", "n"] == 11
    below = run_rows.loc["outside the picture: mean score, less that of visible keypoints"]
    assert below["n"] == 5 and below["value"] == pytest.approx(scores.mean() - (0.6 + 8 * 0.5) / 10)


def test_nobody_is_not_run_under_whichever_name_the_detections_came(world):
    source, truth, found = world
    found = {("headless", "mmpose-imported"): found["headless", "mediapipe-pose"]}
    placed, errors = placed_keypoints(truth, found, source), all_errors(truth, found)
    absent = paper_remarks(placed, errors, truth, found, draws=Draws(5)).query("status == 'not run'")
    assert set(absent["detector"]) == set(MEASURES.values()) - {"mmpose"} and (absent["n"] == 0).all()

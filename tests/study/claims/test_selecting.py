"""What of a result table a selection takes, and what is missing there."""

import math

import numpy as np
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.detectors.registry import COMBINED
from hicp_lib.evaluation.ap.metric_table import compare
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.study.claims.selecting import MissingError, _plain, is_rendered, select
from hicp_lib.study.claims.statements import Comparison, Selection
from hicp_lib.study.claims.verdicts import NOT_REPRODUCED
from tests.evaluation.made_people import make_annotations, make_detections
from tests.study.claims.made_up import claim, of, rows, verdict

CHANGE = Selection("02", "loss", {}, "change", low="low", high="high")


def test_imported_detections_count_as_the_detectors(write):
    results = write(rows(**{"mmpose-imported": (1.0, 0.9, 1.1)}))
    (found,), absent = select(of("mmpose"), results)
    assert (found.value, absent) == (1.0, [])


def test_a_system_that_was_not_run_is_told(write):
    found, absent = select(of("mmpose", "a"), write(rows(a=(1, 1, 1))))
    assert [quantity.name for quantity in found] == ["a"] and absent == ["mmpose"]
    pair = Selection("02", "loss", {"detector": ["a"], "other": ["b", "mmpose"]}, "change")
    found, absent = select(pair, write([row | {"other": "b"} for row in rows(a=(1, 1, 1))]))
    assert len(found) == 1 and absent == ["mmpose"]


def test_of_two_that_are_missing_the_one_that_was_not_run_is_told(write):
    """What has no row only because the other was not run is not to blame."""
    results = write(rows(a=(1, 1, 1)) + [row | {"group": "hand"} for row in rows(mediapipe=(1, 1, 1))])
    assert select(of("mediapipe", "mmpose"), results)[1] == ["mmpose"]
    assert select(of("mediapipe"), results)[1] == ["mediapipe"]


def test_a_detector_that_has_no_number_does_not_leave_the_claim(write):
    found, absent = select(of("a", "b"), write(rows(a=(math.nan, math.nan, math.nan), b=(0.5, 0.4, 0.6))))
    assert [str(quantity) for quantity in found] == ["a nothing found", "b 0.5 [0.4, 0.6]"] and absent == []


def test_a_detector_that_finds_nobody_has_a_precision_of_nought_and_refutes_what_is_said_of_every(write):
    points = np.random.default_rng(3).uniform(50, 400, (12, 136, 2))
    seen = {i: make_detections(points[i]) for i in range(12)}
    found = {("basic", name): seen for name in ("mmpose", "alphapose", "detectron2")}
    found["basic", "posenet"] = {i: Detections.none() for i in range(12)}
    table = compare({"basic": make_annotations(points, range(12))}, found, draws=Draws(20))
    ap = {"group": "body", "metric": "AP"}
    every = claim(Comparison(">", Selection("02", "loss", ap, "value", low="low", high="high"), 0.5))
    said = verdict(every, write(table))
    assert (said.verdict, said.ours[:9]) == (NOT_REPRODUCED, "posenet 0")


def test_a_number_may_be_compared_with_another(write):
    """The column `other` names a detector, or a threshold."""
    results = write([row | {"other": 0.1} for row in rows(mmpose=(0.5, 0.4, 0.6))])
    (found,), absent = select(of("mmpose"), results)
    assert (found.value, absent) == (0.5, [])


def test_infinite_and_empty_numbers_are_no_numbers(write):
    table = rows(a=(1.0, 1, 1), b=(float("inf"), 1, 1)) + [{"group": "body", "detector": "c"}]
    found, _ = select(CHANGE, write(table))
    assert [math.isnan(quantity.value) for quantity in found] == [False, True, True]


def test_a_combination_is_taken_only_where_it_is_meant(write):
    results = write(rows(**{"a": (1, 1, 1), f"{COMBINED}a+hands": (2, 2, 2)}))
    assert [quantity.value for quantity in select(CHANGE, results)[0]] == [1]
    for meant in ("@combined", f"{COMBINED}a+hands", ["@combined"]):
        chosen = Selection("02", "loss", {"detector": meant}, "change")
        assert [quantity.value for quantity in select(chosen, results)[0]] == [2]
    with pytest.raises(MissingError, match="02/loss has no result for detector any combined"):
        select(Selection("02", "loss", {"detector": "@combined"}, "change"), write(rows(a=(1, 1, 1))))


def test_the_greatest_row_is_picked_and_scaled(write):
    results = write(rows(a=(-0.4, -0.5, -0.3), b=(0.2, 0.1, 0.3), c=(math.nan, 0, 0)))
    (found,), _ = select(Selection("02", "loss", {}, "change", True, "low", "high", 1000.0), results)
    assert (found.value, found.low, found.high, found.n) == pytest.approx((200, 100, 300, 2))


def test_what_is_not_there_says_so(write, tmp_path):
    with pytest.raises(MissingError, match="02/loss is not among the results of this run"):
        select(CHANGE, tmp_path)
    results = write(rows(a=(1, 1, 1)))
    with pytest.raises(MissingError, match="02/loss has no result for group hand"):
        select(Selection("02", "loss", {"group": "hand"}, "change"), results)
    with pytest.raises(InputError, match="asks for column 'AQ'; there are group, detector, change"):
        select(Selection("02", "loss", {}, "AQ"), results)


def test_a_simulated_recording_is_no_recording_of_a_lab(write, tmp_path):
    recordings = [tmp_path / "upper", tmp_path / "lower"]
    for folder in recordings:
        folder.mkdir()
    given = {"recording": str(recordings[0]), "recording_lower": str(recordings[1])}
    results = write(rows(a=(1, 1, 1)), given)
    assert not is_rendered(results, "02")
    (recordings[1] / "simulation.json").write_text("{}")
    assert is_rendered(results, "02")
    several = {"recording": [str(recordings[0])] * 2, "recording_lower": ""}
    assert not is_rendered(write(rows(a=(1, 1, 1)), several), "02")
    assert is_rendered(write(rows(a=(1, 1, 1)), several | {"recording_lower": [str(recordings[1])]}), "02")


def test_labels_are_shown_for_reading():
    assert [_plain(label) for label in (160.0, 0.25, "left_wrist", 3)] == ["160", "0.25", "left wrist", "3"]

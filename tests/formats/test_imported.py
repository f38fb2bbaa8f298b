"""Detections made elsewhere, in the comparison."""

import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.evaluation.ap.metric_table import compare
from hicp_lib.evaluation.cases import groups_of
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.formats.detections import write_detections
from hicp_lib.formats.imported import read_imported
from tests.evaluation.made_people import make_annotations, make_detections


@pytest.fixture
def points():
    return np.random.default_rng(0).uniform(50, 400, (6, 136, 2))


@pytest.fixture
def truth(points):
    people = make_annotations(points, range(6))
    return {"basic": people, "headless": people}


@pytest.fixture
def folder(tmp_path, points):
    """Basic found exactly with bodies and hands, Headless bodies alone and in the first image only."""
    write_detections(tmp_path / "mmpose" / "basic.json", {i: make_detections(points[i]) for i in range(6)})
    body = np.where(np.arange(136)[:, None] < 17, points[0], np.nan)
    found = make_detections(body)
    found.scores[:, 17:] = 0
    write_detections(tmp_path / "mmpose" / "headless.json", {0: found})
    return tmp_path


def test_imported_detections_are_compared_like_others(truth, folder):
    found = read_imported(folder, truth)
    assert list(found) == [("basic", "mmpose-imported"), ("headless", "mmpose-imported")]
    assert len(found["headless", "mmpose-imported"]) == 6
    table = compare(truth, found, draws=Draws(2)).set_index(["subset", "group", "metric"])["value"]
    assert table["basic", "body", "AP"] == table["basic", "hand", "AP"] == pytest.approx(1)
    assert table["headless", "body", "AR"] == pytest.approx(1 / 6)
    assert table["headless", "hand", "AR"] == 0


def test_groups_come_from_the_keypoints_that_are_given(truth, folder):
    name = "mmpose-imported"
    found = read_imported(folder, truth)
    assert groups_of(found, name) == ("body", "hand")
    assert groups_of({("headless", name): found["headless", name]}, name) == ("body",)
    # A detector that is run answers for all it claims, found or not.
    assert groups_of({("headless", "mediapipe"): found["headless", name]}, "mediapipe") == ("body", "hand")


def test_none_are_imported_unless_asked_for(truth):
    assert read_imported("", truth) == {}


def test_other_files_and_hidden_folders_are_passed_over(truth, folder):
    (folder / "notes.txt").write_text("")
    (folder / ".cache").mkdir()
    assert len(read_imported(folder, truth)) == 2


def test_what_is_refused(truth, folder):
    with pytest.raises(InputError, match="nowhere: cannot be read"):
        read_imported(folder / "nowhere", truth)
    with pytest.raises(InputError, match="holds no folder"):
        read_imported(folder / "mmpose", truth)
    (folder / "mmpose" / "headless.json").unlink()
    with pytest.raises(InputError, match="mmpose/headless.json: cannot be read"):
        read_imported(folder, truth)
    (folder / "a b").mkdir()
    with pytest.raises(InputError, match="a b: the folder's name is the detector's"):
        read_imported(folder, truth)

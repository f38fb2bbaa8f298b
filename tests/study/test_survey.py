"""The paper's Tables I and II: who is in them, and what is said of them."""

import math

import pytest

from hicp_lib.core.checkout import CHECKOUT
from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.files import read_json
from hicp_lib.detectors.registry import DETECTORS
from hicp_lib.detectors.weights.published import published
from hicp_lib.study.paper_tables import PAPER_SYSTEMS, surveyed_data_sets, surveyed_detectors


def test_every_detector_is_told_and_the_papers_come_first():
    table = surveyed_detectors([])
    assert table["detector"].tolist()[: len(PAPER_SYSTEMS)] == list(PAPER_SYSTEMS)
    assert sorted(table["detector"]) == sorted(DETECTORS)
    for row in table.to_dict("records"):
        facts = DETECTORS[row["detector"]].facts
        assert (row["paradigm"], row["keypoints"]) == (facts.paradigm, facts.keypoints)
        if facts.n_parameters is None:
            assert math.isnan(row["parameters [M]"]) and math.isnan(row["operations [G]"])
        else:
            assert row["parameters [M]"] == facts.n_parameters / 1e6
            assert row["operations [G]"] == facts.n_operations / 1e9


def test_what_was_not_run_says_what_would_run_it():
    here = surveyed_detectors(["mediapipe", "alphapose-imported"]).set_index("detector")["here"]
    assert here[["mediapipe", "alphapose"]].tolist() == ["run", "run"]
    assert here["mediapipe-hands"] == "run, within mediapipe"
    fetched, named = here["mmpose"].removeprefix("not run; hicp models fetch ").split(", then ")
    assert published()[fetched].use == "mmpose --model"
    assert named.startswith("hicp models use --detector mmpose")
    assert here["openpose"].startswith("not run; hicp models use --detector openpose")
    assert here["posenet"].startswith("not run; hicp detect --detector posenet")


def test_why_a_system_was_not_run_is_true_of_what_can_be_fetched():
    ready = {name.partition("-")[0] for name, one in published().items() if one.use == "mmpose --model"}
    exported = {name.partition("-")[0] for name, one in published().items() if "export it" in one.note}
    assert ready == {"rtmw", "dwpose", "rtmpose"}
    assert exported == {"hrnet", "detectron2", "torchvision"}
    assert not [name for name in published() if name.startswith(("openpose", "alphapose"))]


@pytest.mark.parametrize("page", ["README.md", "notebooks/02_evaluation_2d.ipynb"])
def test_why_a_system_was_not_run_is_said_the_same_everywhere(page):
    said = read_json(DATA_DIR / "paper.json")["not_run"].partition(" With a network, ")[2]
    assert said in " ".join((CHECKOUT / page).read_text().split())


def test_our_own_data_sets_stand_beside_the_others():
    assert surveyed_data_sets()["data set"].tolist()[-2:] == ["HiCP (paper)", "HiCP rendered (this study)"]

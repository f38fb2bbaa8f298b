"""Cases: every detector on every subset, for the groups it gives, with labels and source images."""

import numpy as np
import pandas as pd

from hicp_lib.core.keypoints import HANDS
from hicp_lib.evaluation.cases import all_cases, groups_of, labelled, per_case
from tests.evaluation.made_people import make_annotations, make_detections

POINTS = np.random.default_rng(0).uniform(50, 400, (1, 136, 2))


def found_by(detector: str, with_hands: bool = True):
    points = POINTS.copy()
    points[:, HANDS] = points[:, HANDS] if with_hands else np.nan
    return {("basic", detector): {0: make_detections(points)}}


def test_known_detectors_have_their_groups_and_others_those_they_give():
    found = found_by("mediapipe-pose") | found_by("mine") | found_by("bare", with_hands=False)
    assert groups_of(found, "mediapipe-pose") == ("body",)
    assert groups_of({}, "combined:mediapipe-pose+mediapipe-hands") == ("body", "hand")
    assert groups_of(found, "mine") == ("body", "hand") and groups_of(found, "bare") == ("body",)
    assert list(all_cases(found)) == [
        ("basic", "mediapipe-pose", "body"), ("basic", "mine", "body"), ("basic", "mine", "hand"),
        ("basic", "bare", "body"),
    ]  # fmt: skip
    assert list(all_cases(found, ["each hand"])) == [("basic", "mine", "each hand")]


def test_labels_come_before_the_columns():
    table = labelled(pd.DataFrame({"a": [1, 2]}), subset="basic", group="body")
    assert table.to_dict("list") == {"subset": ["basic"] * 2, "group": ["body"] * 2, "a": [1, 2]}
    assert list(table) == ["subset", "group", "a"]


def test_a_measure_of_every_case_says_which_source_image_it_is_of():
    truth = {"basic": make_annotations(POINTS, [0], extras=[{"source_image_id": 7}])}

    def measure(annotations, detections, group):
        return pd.DataFrame({"image_id": [0], "n": [len(detections[0])], "asked": [group]})

    table = per_case(measure, truth, found_by("mine"))
    assert list(table) == ["subset", "detector", "group", "source_image", "image_id", "n", "asked"]
    assert table["group"].tolist() == table["asked"].tolist() == ["body", "hand"]
    assert table["source_image"].tolist() == [7, 7] and table.index.tolist() == [0, 1]
    assert per_case(measure, truth, found_by("mine"), {"mine": ("hand",)})["group"].tolist() == ["hand"]

"""Classes of what a picture shows, on hand-made skeletons."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hicp_lib.core.keypoints import INDEX, N_KEYPOINTS
from hicp_lib.datasets.visibility import (
    CLASSES,
    MIN_PEOPLE,
    NONE,
    RULES,
    class_counts,
    people_classes,
    visibility_class,
    visible_parts,
)
from hicp_lib.evaluation.failures.by_visibility import compare_classes
from hicp_lib.evaluation.statistics.resampling import Draws
from tests.evaluation.made_people import make_annotations, make_detections

HEAD = ["nose", "left_eye"]
SHOULDERS, HIPS = ["left_shoulder", "right_shoulder"], ["left_hip", "right_hip"]
LEFT, RIGHT = ["left_elbow", "left_wrist"], ["right_elbow", "right_wrist"]
LEGS = ["left_knee", "left_ankle"]
POINTS = np.random.default_rng(1).uniform(50, 400, (N_KEYPOINTS, 2))


def flags(names, value=2.0) -> np.ndarray:
    visibility = np.zeros((1, N_KEYPOINTS))
    visibility[0, [INDEX[name] for name in names]] = value
    return visibility


@pytest.mark.parametrize(
    "names, expected",
    [
        (HEAD + SHOULDERS + LEFT + RIGHT + HIPS + LEGS, "whole upper body"),
        (HEAD + SHOULDERS + LEFT + RIGHT, "whole upper body"),
        (HEAD + SHOULDERS + LEFT + RIGHT[:1], NONE),
        (HEAD, "only head"),
        (["face_8"], "only head"),
        (HEAD + SHOULDERS, NONE),
        (SHOULDERS + LEFT + RIGHT + HIPS + LEGS, "no head"),
        (SHOULDERS + LEFT + RIGHT + HIPS[:1], "no head"),
        (LEFT, "only left arm"),
        (["left_shoulder", "left_wrist"], "only left arm"),
        (RIGHT, "only right arm"),
        (LEFT + HIPS, NONE),
        (["left_shoulder"], NONE),
        (SHOULDERS + LEFT + RIGHT, "both arms"),
        (LEFT + RIGHT[1:], "both arms without shoulders"),
        (LEFT + RIGHT + HIPS, "both arms without shoulders"),
        (LEFT + RIGHT + HIPS + LEGS, NONE),
        (LEGS + HIPS, "only legs"),
        (["left_heel"], NONE),
        ([], NONE),
    ],
)
def test_skeletons_are_of_their_class_whether_seen_or_hidden(names, expected):
    assert visibility_class(flags(names)).tolist() == [expected]
    assert visibility_class(flags(names, 1.0)).tolist() == [expected]


@given(st.lists(st.sampled_from(HEAD + SHOULDERS + HIPS + LEFT + RIGHT + LEGS), max_size=13))
def test_no_more_than_one_rule_fits_anybody(names):
    parts = visible_parts(flags(names))
    fits = [
        all(parts[p][0] for p in seen) and not any(parts[p][0] for p in un) for seen, un in RULES.values()
    ]
    assert sum(fits) <= 1


@given(st.lists(st.sampled_from(HEAD + SHOULDERS + HIPS + LEFT + RIGHT + LEGS), max_size=13))
def test_a_mirrored_person_is_of_the_mirrored_class(names):
    swap = {"left": "right", "right": "left"}

    def mirrored(text, between):
        return between.join(swap.get(word, word) for word in text.split(between))

    other = visibility_class(flags([mirrored(name, "_") for name in names]))[0]
    assert mirrored(visibility_class(flags(names))[0], " ") == other


def test_people_are_counted_per_class_and_subset():
    seen = np.concatenate([flags(HEAD)] * MIN_PEOPLE + [flags(LEGS)])
    n = len(seen)
    people = make_annotations(np.stack([POINTS] * n), range(n), visibility=seen, crowd=[0])
    classes = people_classes({"basic": people, "close": people.take([0, 1])})
    counts = class_counts(classes).set_index("class")
    assert counts.index.tolist() == list(CLASSES)
    assert counts.loc["only head"].to_dict() == {
        "basic": MIN_PEOPLE - 1,
        "close": 1,
        "people": MIN_PEOPLE,
        "judged": "yes",
    }
    assert counts.loc["only legs", "people"] == 1 and counts.loc["only legs", "judged"] == "too few"
    assert counts["people"].sum() == len(classes) == n


def test_classes_are_evaluated_apart_and_small_ones_not_at_all():
    n = MIN_PEOPLE + 1
    seen = np.concatenate([flags(HEAD)] * MIN_PEOPLE + [flags(LEGS)])
    people = make_annotations(np.stack([POINTS] * n), range(n), visibility=seen)
    # In one subset the detector is right, in the other it finds nobody.
    right = {i: make_detections(POINTS[None]) for i in range(n)}
    found = {("basic", "mediapipe-pose"): right, ("close", "mediapipe-pose"): {}}
    table = compare_classes({"basic": people, "close": people}, found, draws=Draws(20))
    table = table[table["metric"] == "AR50"].set_index("class")
    assert table["n_people"].to_dict() == {"only head": 2 * MIN_PEOPLE, "only legs": 2}
    assert table.loc["only head", "value"] == pytest.approx(0.5)
    assert np.isnan(table.loc["only legs", ["value", "low", "high"]].astype(float)).all()


def test_detectors_are_ordered_on_the_same_pictures_of_a_class():
    n = MIN_PEOPLE
    people = make_annotations(np.stack([POINTS] * n), range(n), visibility=np.concatenate([flags(HEAD)] * n))
    right = {i: make_detections(POINTS[None]) for i in range(n)}
    half = {i: right[i] for i in range(n // 2)}
    found = {("basic", "mediapipe-pose"): right, ("basic", "movenet-thunder"): half}
    table = compare_classes({"basic": people}, found, draws=Draws(200))
    assert set(table[table["other"] == ""]["detector"]) == {"mediapipe-pose", "movenet-thunder"}
    less = table[table["metric"] == "AR50"].set_index("pair")
    ahead = less.loc["mediapipe-pose less movenet-thunder"]
    assert ahead["class"] == "only head" and ahead["value"] == pytest.approx(0.5) and ahead["n_people"] == n
    assert 0 < ahead["low"] < 0.5 < ahead["high"] < 1
    assert less.loc["movenet-thunder less mediapipe-pose", "value"] == pytest.approx(-0.5)


def test_twenty_people_are_judged_and_nineteen_are_not():
    assert MIN_PEOPLE == 20
    people = pd.DataFrame({"subset": "basic", "class": ["no head"] * 20 + ["only legs"] * 19})
    judged = class_counts(people).set_index("class")["judged"]
    assert judged["no head"] == "yes" and judged["only legs"] == judged["only head"] == "too few"

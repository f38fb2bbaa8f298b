"""Kinds of error, on hand-made skeletons whose kinds are known."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import COCO_17, INDEX, SIGMAS
from hicp_lib.evaluation.failures.error_kinds import KINDS, all_errors, keypoint_errors, kind_proportions
from tests.evaluation.made_people import make_annotations, make_detections

AREA = 20_000.0
# Keypoints far from one another: no error can be taken for another keypoint by chance.
GRID = np.stack(np.meshgrid(np.arange(12), np.arange(12)), axis=-1).reshape(-1, 2)[:136] * 1000.0
WRIST, OTHER_WRIST = INDEX["left_wrist"], INDEX["right_wrist"]


def distance_px(keypoint: int, term: float) -> float:
    """Distance at which the OKS term has a value: 2 sigma sqrt(-2 A ln term)."""
    return 2 * SIGMAS["halpe"][keypoint] * np.sqrt(-2 * AREA * np.log(term))


def kind_of(points, keypoint=WRIST, people=None):
    """The kind of one keypoint of a detection of the person of id 1."""
    people = make_annotations(GRID[None], [0]) if people is None else people
    table = keypoint_errors(people, {0: make_detections(points[None])})
    return table[table["annotation_id"] == 1].set_index("keypoint").loc[keypoint, "kind"]


@pytest.mark.parametrize(
    "term, kind", [(1.0, "good"), (0.86, "good"), (0.84, "jitter"), (0.51, "jitter"), (0.49, "miss")]
)
def test_nearness_to_the_truth_decides_between_good_jitter_and_miss(term, kind):
    points = GRID.copy()
    points[WRIST] += [distance_px(WRIST, term), 0]
    assert kind_of(points) == kind


@pytest.mark.parametrize("term, kind", [(1.0, "inversion"), (0.51, "inversion"), (0.49, "miss")])
def test_on_the_other_side_it_is_an_inversion(term, kind):
    points = GRID.copy()
    points[WRIST] = GRID[OTHER_WRIST] + [0, distance_px(WRIST, term)]
    assert kind_of(points) == kind


def test_on_another_joint_of_the_person_it_is_a_miss():
    points = GRID.copy()
    points[WRIST] = GRID[INDEX["left_knee"]]
    points[INDEX["nose"]] = GRID[INDEX["left_eye"]]
    assert kind_of(points) == "miss" and kind_of(points, INDEX["nose"]) == "miss"


@pytest.mark.parametrize("keypoint", [WRIST, OTHER_WRIST])
def test_on_somebody_elses_wrist_it_is_a_swap_whoever_they_are(keypoint):
    people = make_annotations(np.stack([GRID, GRID + 400]), [0, 0], crowd=[1], extras=[{}, {"other": True}])
    points = GRID.copy()
    points[WRIST] = GRID[keypoint] + 400
    assert kind_of(points, people=people) == "swap"


def test_between_two_wrists_the_nearer_one_counts():
    other = GRID + 400
    other[WRIST] = GRID[OTHER_WRIST] + [6, 0]
    people = make_annotations(np.stack([GRID, other]), [0, 0], crowd=[1], extras=[{}, {"other": True}])
    points = GRID.copy()
    for offset, kind in ((1, "inversion"), (5, "swap")):
        points[WRIST] = GRID[OTHER_WRIST] + [offset, 0]
        assert kind_of(points, people=people) == kind


def test_what_is_near_the_truth_is_no_inversion():
    close = GRID.copy()
    close[OTHER_WRIST] = close[WRIST] + [1, 0]
    points = close.copy()
    points[WRIST] = close[OTHER_WRIST]
    assert kind_of(points, people=make_annotations(close[None], [0])) == "good"


def test_keypoints_not_given_and_people_not_found_are_told_apart():
    points = GRID.copy()
    points[WRIST] = np.nan
    assert kind_of(points) == "not given"
    for found in ({}, {0: make_detections(GRID[None] + 5_000)}):
        table = keypoint_errors(make_annotations(GRID[None], [0]), found)
        assert len(table) == 17 and (table["kind"] == "not found").all() and table["score"].isna().all()


def test_only_labelled_keypoints_of_people_who_count_are_judged():
    visibility = np.full((3, 136), 2.0)
    visibility[0, WRIST] = 0
    people = make_annotations(
        np.stack([GRID, GRID + 300, GRID + 600]), [0, 0, 0], visibility=visibility, crowd=[1],
        extras=[{}, {}, {"other": True}],
    )  # fmt: skip
    table = keypoint_errors(people, {0: make_detections(np.stack([GRID, GRID + 300]))})
    assert set(table["annotation_id"]) == {1}
    assert set(COCO_17) - set(table["keypoint"]) == {WRIST}
    assert table["hit"].all() and (table["score"] == 0.5).all()


def shares_of_four_in(n: int):
    """Four kinds of people, `n` in all: found with one keypoint off, found, found, not found."""
    points = np.stack([GRID] * n)
    found = points.copy()
    found[::4, WRIST] += 500
    run = {i: make_detections(found[i : i + 1]) for i in range(n) if i % 4 < 3}
    errors = all_errors({"basic": make_annotations(points, range(n))}, {("basic", "mediapipe-pose"): run})
    return kind_proportions(errors, "subset").set_index("kind")


def test_shares_of_kinds_add_up_to_one():
    table = shares_of_four_in(20)
    assert table.index.tolist() == list(KINDS) and set(table["n_people"]) == {20}
    share = table["share"]
    assert share["miss"] == pytest.approx(1 / 68) and share["not found"] == pytest.approx(1 / 4)
    assert share.sum() == pytest.approx(1)


def test_few_people_are_counted_and_not_judged():
    table = shares_of_four_in(16)
    assert table["share"].isna().all() and set(table["n_people"]) == {16}


def test_a_detection_goes_to_whom_it_fits_and_not_to_those_nothing_is_known_of():
    visibility = np.full((2, 136), 2.0)
    visibility[0] = 0  # somebody around the person, without a labelled keypoint
    people = make_annotations(
        np.stack([GRID, GRID]), [0, 0], visibility=visibility, crowd=[0], extras=[{"other": True}, {}],
        boxes_px=[[0, 0, 12_000, 12_000]] * 2,
    )  # fmt: skip
    surer = make_detections(np.stack([GRID + 5_000, GRID]), [0.9, 0.5])
    assert (keypoint_errors(people, {0: surer})["kind"] == "good").all()


def test_shares_by_what_is_no_column_are_refused():
    with pytest.raises(InputError, match="by 'classes': expected one of"):
        kind_proportions(pd.DataFrame({"detector": [], "group": [], "kind": []}), "classes")

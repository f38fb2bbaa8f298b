"""Keypoints outside the picture: what is known of them, and what a detector makes of them."""

import numpy as np
import pytest
from made_people import make_annotations, make_detections

from hicp_lib.detectors.base import Detections
from hicp_lib.evaluation.error_kinds import all_errors
from hicp_lib.evaluation.false_confidence import MEASURES, paper_remarks, scores_by_state
from hicp_lib.evaluation.placed_keypoints import from_the_cut, landed, placed_keypoints
from hicp_lib.evaluation.without_head import change_per_keypoint, invented_heads, invented_shares
from hicp_lib.evaluation.worst_cases import worst_cases
from hicp_lib.keypoints import HEAD, INDEX, N_KEYPOINTS
from hicp_lib.plots import failures as draw

# A person in a source image; the crop starts at (100, 200) and shows what is below the head.
POINTS = np.random.default_rng(3).uniform([120, 220], [700, 600], (N_KEYPOINTS, 2))
POINTS[HEAD] = np.random.default_rng(4).uniform([300, 150], [400, 190], (len(HEAD), 2))
CROP = [100, 200, 740, 680]
HIDDEN, UNKNOWN = INDEX["left_wrist"], INDEX["right_ankle"]


@pytest.fixture
def world():
    """Source annotations; the same person in Headless; a detection that is right, also outside."""
    source_flags = np.full((1, N_KEYPOINTS), 2.0)
    source_flags[0, UNKNOWN] = 0
    source = make_annotations(POINTS[None], [7], visibility=source_flags, first_id=5)
    flags = source_flags.copy()
    flags[0, HEAD], flags[0, HIDDEN] = 0, 1
    about = {"source_id": 5, "source_image_id": 7, "crop_px": CROP, "cut_side": "top"}
    truth = {"headless": make_annotations(POINTS[None] - CROP[:2], [5], visibility=flags, extras=[about])}
    found = {("headless", "mediapipe-pose"): {5: make_detections(POINTS[None] - CROP[:2])}}
    return source, truth, found


def by_keypoint(table, column):
    return table.set_index("keypoint")[column]


def test_states_come_from_the_crop_and_from_the_image_it_was_cut_from(world):
    source, truth, found = world
    state = by_keypoint(placed_keypoints(truth, found, source), "state")
    assert state[0] == "outside" and state[HIDDEN] == "hidden" and state[UNKNOWN] == "unknown"
    assert state[INDEX["left_hip"]] == "visible"


def test_what_is_right_outside_the_picture_is_a_hit_and_what_is_unknown_is_neither(world):
    source, truth, found = world
    hit = by_keypoint(placed_keypoints(truth, found, source), "hit")
    assert hit[0] == 1 and np.isnan(hit[UNKNOWN])
    found["headless", "mediapipe-pose"][5].keypoints_px[0, 0] += 300
    found["headless", "mediapipe-pose"][5].keypoints_px[0, 1] = np.nan
    found["headless", "mediapipe-pose"][5].scores[0, 1] = 0
    table = placed_keypoints(truth, found, source)
    assert by_keypoint(table, "hit")[0] == 0 and np.isnan(by_keypoint(table, "hit")[1])
    assert by_keypoint(table, "given").tolist() == [k != 1 for k in range(17)]


def test_where_nobody_is_found_every_table_and_figure_is_empty_but_there(world):
    source, truth, _ = world
    found = {("headless", "mediapipe-pose"): {5: Detections.none()}}
    placed = placed_keypoints(truth, found, source)
    assert placed.empty and placed["given"].dtype.kind == "b"
    assert invented_shares(placed, 0.3, 10).empty
    assert "(0)" in draw.invented_heads(invented_heads(placed), "drawn").figure.axes[0].get_title("left")
    assert draw.scores_by_state(scores_by_state(placed, 10), "drawn").table.empty
    remarks = paper_remarks(placed, all_errors(truth, found), truth, found, 10)
    assert remarks["measure"].nunique() == len(MEASURES)


def test_places_are_named_by_the_picture_border(world):
    source, truth, found = world
    points = found["headless", "mediapipe-pose"][5].keypoints_px
    points[0, :4] = [[320, 240], [5, 240], [-3, 240], [320, 479]]
    place = by_keypoint(placed_keypoints(truth, found, source).assign(place=lambda t: landed(t)), "place")
    assert place[:4].tolist() == ["inside", "at the border", "outside", "at the border"]


@pytest.mark.parametrize("side, place", [("top", (0.3, -0.1)), ("bottom", (0.3, 1.1)), ("left", (-0.1, 0.3)),
                                         ("right", (1.1, 0.3))])  # fmt: skip
def test_pictures_are_turned_so_that_the_cut_is_above(world, side, place):
    table = placed_keypoints(world[1], world[2], world[0]).iloc[:1]
    turned = from_the_cut(table.assign(x=place[0], y=place[1], cut_side=side))
    assert turned.to_numpy()[0] == pytest.approx([0.3, -0.1])


def test_heads_made_up_are_counted_and_placed(world):
    source, truth, found = world
    found["headless", "mediapipe-pose"][5].keypoints_px[0, 4] = np.nan
    found["headless", "mediapipe-pose"][5].scores[0, 4] = 0
    placed = placed_keypoints(truth, found, source)
    assert sorted(invented_heads(placed)["keypoint"]) == [0, 1, 2, 3]
    shares = invented_shares(placed, 0.3, n_resamples=5).set_index("what")["value"]
    assert shares["given at all"] == pytest.approx(4 / 5)
    assert shares["of those given: put outside"] == 1 and shares["of the sure ones: right"] == 1


def test_the_heads_worth_is_taken_on_pairs(world):
    _, truth, found = world
    basic = make_annotations(POINTS[None], [5], extras=[{"source_image_id": 7}])
    truth["basic"] = truth["headless"].__class__(**{**basic.__dict__, "ids": truth["headless"].ids})
    found["basic", "mediapipe-pose"] = {5: make_detections(POINTS[None])}
    wrist = INDEX["left_wrist"]
    found["headless", "mediapipe-pose"][5].keypoints_px[0, wrist] += 300
    change = change_per_keypoint(all_errors(truth, found), n_resamples=5).set_index("keypoint")["change"]
    assert change["left_wrist"] == -1 and change.drop("left_wrist").eq(0).all()
    assert not {"nose", "right_ankle"} & set(change.index)


def test_scores_are_set_against_hits_apart_for_every_state(world):
    source, truth, found = world
    found["headless", "mediapipe-pose"][5].scores[0, :5] = 0.95
    found["headless", "mediapipe-pose"][5].keypoints_px[0, :5] += 400
    table = scores_by_state(placed_keypoints(truth, found, source), n_resamples=5).set_index("state")
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
    table = paper_remarks(placed, errors, truth, found, n_resamples=5)
    assert list(dict.fromkeys(table["measure"])) == list(MEASURES)
    value = table[table["status"] == "run"].set_index("measure")["value"]
    assert value["outside the picture: given"] == 1
    assert value["hands given without their wrist"] == 0.5
    assert value["mean score of shoulders, less that of the other joints"] == pytest.approx(-0.4)
    assert value["labelled keypoints given with a score of at least 0.3"] == pytest.approx(8 / 11)
    absent = table[table["status"] == "not run"]
    assert set(absent["detector"]) == set(MEASURES.values()) and absent["value"].isna().all()


def test_worst_cases_are_the_surest_mistakes_and_the_overlooked(world):
    people = make_annotations(np.stack([POINTS] * 3), [0, 1, 2])
    points = np.stack([POINTS] * 2)
    points[0, 9:11] += 5_000
    points[1, 9] += 5_000
    found = {("basic", "mediapipe-pose"): {i: make_detections(points[i : i + 1]) for i in range(2)}}
    table = worst_cases(all_errors({"basic": people}, found))
    assert table[["case", "rank", "image_id"]].to_numpy().tolist() == [
        ["surest mistakes", 1, 0], ["surest mistakes", 2, 1], ["overlooked", 1, 2],
    ]  # fmt: skip
    assert table["badness"].tolist() == pytest.approx([1.0, 0.5, 17])

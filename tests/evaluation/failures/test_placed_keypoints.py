"""Keypoints outside the picture: what is known of them, and what a detector makes of them."""

import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import INDEX
from hicp_lib.evaluation.failures.error_kinds import all_errors
from hicp_lib.evaluation.failures.false_confidence import MEASURES, paper_remarks, scores_by_state
from hicp_lib.evaluation.failures.placed_keypoints import landed, placed_keypoints
from hicp_lib.evaluation.failures.presence import false_presence
from hicp_lib.evaluation.failures.without_head import hallucinated_heads
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.study.plots import failures as draw
from tests.evaluation.made_people import HIDDEN, UNKNOWN


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
    invented = false_presence(truth, found, placed, source, Draws(10))
    assert invented["n_found"].eq(0).all() and invented["value"].eq(0).all()
    assert draw.false_presence(invented, "drawn").table["part"].tolist() == ["head", "head"]
    heads = draw.invented_heads(hallucinated_heads(placed), "", truth["headless"], {}, "drawn")
    assert "Nothing to draw" in heads.figure.texts[0].get_text()
    assert draw.scores_by_state(scores_by_state(placed, Draws(10)), "drawn").table.empty
    remarks = paper_remarks(placed, all_errors(truth, found), truth, found, Draws(10))
    assert remarks["measure"].nunique() == len(MEASURES)


def test_places_are_named_by_the_picture_border(world):
    source, truth, found = world
    points = found["headless", "mediapipe-pose"][5].keypoints_px
    points[0, :4] = [[320, 240], [5, 240], [-3, 240], [320, 479]]
    place = by_keypoint(placed_keypoints(truth, found, source).assign(place=lambda t: landed(t)), "place")
    assert place[:4].tolist() == ["inside", "at the border", "outside", "at the border"]


def test_the_border_is_a_twentieth_of_the_picture_and_its_edge_belongs_to_it(world):
    table = placed_keypoints(world[1], world[2], world[0]).iloc[:5].assign(given=True, y=0.5)
    x = [0.0, -1e-9, np.nextafter(0.05, 0), 0.05, 1 - 0.049]
    assert landed(table.assign(x=x)).tolist() == [
        "at the border", "outside", "at the border", "inside", "at the border",
    ]  # fmt: skip


def test_places_are_shares_of_the_picture_from_its_outer_edge(world):
    source, truth, found = world
    found["headless", "mediapipe-pose"][5].keypoints_px[0, :2] = [[-0.5, -0.5], [639.5, 479.5]]
    table = placed_keypoints(truth, found, source).set_index("keypoint")
    assert table.loc[[0, 1], ["x", "y"]].to_numpy().tolist() == [[0, 0], [1, 1]]
    assert table.loc[0, "source_image"] == 7

"""What the head is worth, and heads made up."""

import numpy as np
import pytest

from hicp_lib.core.keypoints import INDEX
from hicp_lib.evaluation.failures.error_kinds import all_errors
from hicp_lib.evaluation.failures.placed_keypoints import placed_keypoints
from hicp_lib.evaluation.failures.without_head import (
    change_per_keypoint,
    hallucinated_heads,
    hallucinated_proportions,
)
from tests.evaluation.made_people import POINTS, make_annotations, make_detections


def test_heads_made_up_are_counted_and_placed(world):
    source, truth, found = world
    found["headless", "mediapipe-pose"][5].keypoints_px[0, 4] = np.nan
    found["headless", "mediapipe-pose"][5].scores[0, 4] = 0
    placed = placed_keypoints(truth, found, source)
    assert sorted(hallucinated_heads(placed)["keypoint"]) == [0, 1, 2, 3]
    shares = hallucinated_proportions(placed, 0.3, n_resamples=5).set_index("what")["value"]
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


def test_only_sure_heads_are_asked_whether_they_are_right(world):
    source, truth, found = world
    run = found["headless", "mediapipe-pose"][5]
    run.scores[0, :5] = [0.3, 0.29, 0.9, 0.9, 0.9]
    run.keypoints_px[0, 4] = 320, 240  # wrong, and within the picture
    placed = placed_keypoints(truth, found, source)
    table = hallucinated_proportions(placed, 0.3, n_resamples=5).set_index("what")
    assert table["value"].to_dict() == pytest.approx(
        {
            "given at all": 1,
            "given with a score of at least 0.3": 4 / 5,
            "of those given: put outside": 4 / 5,
            "of those given: put at the border": 0,
            "of those given: put inside": 1 / 5,
            "of the sure ones: right": 3 / 4,
        }
    )
    assert table["n"].tolist() == [5, 5, 5, 5, 5, 4] and (table["n_images"] == 1).all()

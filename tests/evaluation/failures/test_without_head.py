"""What the head is worth, and heads made up."""

import numpy as np

from hicp_lib.core.keypoints import INDEX
from hicp_lib.evaluation.failures.error_kinds import all_errors
from hicp_lib.evaluation.failures.placed_keypoints import placed_keypoints
from hicp_lib.evaluation.failures.without_head import change_per_keypoint, hallucinated_heads
from hicp_lib.evaluation.statistics.resampling import Draws
from tests.evaluation.made_people import POINTS, make_annotations, make_detections


def test_heads_made_up_are_counted_and_placed(world):
    source, truth, found = world
    found["headless", "mediapipe-pose"][5].keypoints_px[0, 4] = np.nan
    found["headless", "mediapipe-pose"][5].scores[0, 4] = 0
    placed = placed_keypoints(truth, found, source)
    heads = hallucinated_heads(placed)
    assert sorted(heads["keypoint"]) == [0, 1, 2, 3] and (heads["landed"] == "outside").all()


def test_the_heads_worth_is_taken_on_pairs(world):
    _, truth, found = world
    basic = make_annotations(POINTS[None], [5], extras=[{"source_image_id": 7}])
    truth["basic"] = truth["headless"].__class__(**{**basic.__dict__, "ids": truth["headless"].ids})
    found["basic", "mediapipe-pose"] = {5: make_detections(POINTS[None])}
    wrist = INDEX["left_wrist"]
    found["headless", "mediapipe-pose"][5].keypoints_px[0, wrist] += 300
    change = change_per_keypoint(all_errors(truth, found), draws=Draws(5)).set_index("keypoint")["change"]
    assert change["left_wrist"] == -1 and change.drop("left_wrist").eq(0).all()
    assert not {"nose", "right_ankle"} & set(change.index)

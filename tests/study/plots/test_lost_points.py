"""The keypoint that is lost close by: chosen by rule, and ringed where it truly is."""

import numpy as np
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.core.images import write_png
from hicp_lib.core.keypoints import INDEX
from hicp_lib.evaluation.failures.error_kinds import all_errors
from hicp_lib.study.plots.lost_points import lost_points
from tests.evaluation.made_people import make_annotations

WRIST, KNEE = INDEX["left_wrist"], INDEX["left_knee"]
POINTS = np.stack(np.meshgrid(np.arange(12), np.arange(12)), axis=-1).reshape(-1, 2)[:136] * 25.0 + 20


@pytest.fixture
def study(tmp_path):
    """A person in both pictures; "b" loses wrist and knee, of which it was surer of the wrist."""
    truth = {subset: make_annotations(POINTS[None], [0]) for subset in ("basic", "headless")}
    for subset, people in truth.items():
        write_png(
            tmp_path / subset / "images" / people.images[0].file_name, np.zeros((340, 340, 3), np.uint8)
        )
    moved, scores = POINTS.copy(), np.full((1, 136), 0.5)
    moved[[WRIST, KNEE]] += 150
    scores[0, WRIST] = 0.9
    found = {(s, d): {0: Detections(POINTS[None], scores, np.ones(1))} for s in truth for d in ("a", "b")}
    found["headless", "b"] = {0: Detections(moved[None], scores, np.ones(1))}
    folders = {subset: tmp_path / subset for subset in truth}
    return all_errors(truth, found), folders, truth, found


def test_it_is_the_one_that_the_detector_was_surest_of(study):
    figure = lost_points(*study, "made up")
    whole, close = figure.figure.axes
    assert whole.get_title() == "b\nleft wrist" and "left wrist" in figure.alt and "knee" not in figure.alt
    u, v = POINTS[WRIST].astype(int)
    for axis in (whole, close):
        ring = axis.images[0].get_array()[v, u + 20]
        assert ring.min() > 200
    assert "made up" in figure.caption

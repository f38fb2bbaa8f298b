"""Hits over what people are like: bins hold about as many keypoints, and levels are theirs."""

import numpy as np
import pytest

from hicp_lib.evaluation.failures.error_kinds import all_errors
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.study.observed import N_BINS, observed_curves
from hicp_lib.study.plots.doses import dose_curves
from tests.evaluation.made_people import make_annotations, make_detections

N = 60
POINTS = np.random.default_rng(3).uniform(50, 400, (136, 2))


@pytest.fixture
def curves():
    """The first half of the people is larger, and found."""
    scales = np.where(np.arange(N) < N / 2, 1.0, 0.5) + np.arange(N) / 1000
    people = make_annotations(scales[:, None, None] * POINTS, range(N))
    run = {i: make_detections(scales[i] * POINTS[None]) for i in range(N // 2)}
    truth = {"basic": people}
    return observed_curves(all_errors(truth, {("basic", "mediapipe-pose"): run}), truth, Draws(5))


def test_bins_hold_as_many_keypoints_and_small_people_are_missed(curves):
    heights = curves[curves["dose"] == "height"].sort_values("level")
    assert heights["n"].tolist() == [N // N_BINS * 17] * N_BINS
    assert heights["value"].tolist() == [0, 0, 0.5, 1, 1]


def test_what_is_alike_in_everybody_is_one_bin(curves):
    labelled = curves[curves["dose"] == "labelled"]
    assert labelled[["level", "value", "n"]].values.tolist() == [[17, 0.5, N * 17]]


def test_the_curves_are_drawn_and_their_data_named(curves):
    figure = dose_curves(curves, "body", "labelled keypoints hit", "made-up people")
    assert "made-up people. Lowest: mediapipe-pose 0.00 (height" in " ".join(figure.caption.split())
    assert len([axis for axis in figure.figure.axes if axis.lines]) == curves["dose"].nunique()

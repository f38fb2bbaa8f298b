"""Figure of the error budget: where its marks lie."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.evaluation.space.error_budget import AGAINST_MOCAP, ALL
from hicp_lib.study.plots.error_budget import error_budget


def test_marks_lie_at_the_errors_and_gains_in_centimetres():
    rows = [
        ("paper", part, *row)
        for part in ("wrist", "finger")
        for row in (
            (ALL, "total", 0.05),
            (AGAINST_MOCAP, "total", 0.04),
            ("skin depth", "alone", 0.03),
            ("skin depth", "gain", 0.02),
        )
    ]
    table = pd.DataFrame(rows, columns=["method", "part", "source", "kind", "value_m"])
    table = table.assign(low_m=table["value_m"] - 0.01, high_m=np.nan)
    medians = pd.DataFrame(
        {"detector": "mmpose", "keypoint": ["left_wrist", "left_elbow"], "median_m": [0.027, 0.04]}
    )
    figure = error_budget(table.assign(n_people=12, view="upper"), medians, "made up")
    wrists, fingers = figure.figure.axes
    drawn = [(line.get_marker(), list(line.get_xdata())) for line in wrists.get_lines()]
    for marker, at_cm in (("o", [5, 4]), ("o", [3]), ("D", [2]), ("|", [2.7])):
        assert (marker, pytest.approx(at_cm)) in drawn
    assert [label.get_text() for label in wrists.get_yticklabels()] == [ALL, AGAINST_MOCAP, "skin depth"]
    assert "wrists, paper lifting: skin depth with 3.0 cm" in figure.alt
    assert "12 people" in figure.caption and "mmpose" in figure.caption and "made up" in figure.caption

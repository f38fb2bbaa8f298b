"""Figure of the error budget: where its marks lie."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.evaluation.space.error_budget import AGAINST_MOCAP, ALL
from hicp_lib.study.plots.error_budget import error_budget


def test_marks_lie_at_the_errors_and_gains_in_centimetres():
    rows = [
        ("paper", part, source, alone_m, gain_m)
        for part in ("wrist", "finger")
        for source, alone_m, gain_m in (
            (ALL, 0.05, 0.0),
            (AGAINST_MOCAP, 0.04, 0.01),
            ("skin depth", 0.03, 0.02),
        )
    ]
    table = pd.DataFrame(rows, columns=["method", "part", "source", "alone_m", "gain_m"])
    for name in ("alone", "gain"):
        table[f"{name}_low_m"], table[f"{name}_high_m"] = table[f"{name}_m"] - 0.01, np.nan
    medians = pd.DataFrame(
        {"detector": "mmpose", "keypoint": ["left_wrist", "left_elbow"], "median_m": [0.027, 0.04]}
    )
    figure = error_budget(table.assign(n_people=12, view="upper"), medians, "made up")
    wrists, fingers = figure.figure.axes
    marked = {
        line.get_marker(): line.get_xdata().tolist() for line in wrists.get_lines() if len(line.get_xdata())
    }
    assert marked["o"] == pytest.approx([5, 4, 3]) and marked["D"] == pytest.approx([2])
    assert marked["|"] == pytest.approx([2.7])
    assert [label.get_text() for label in wrists.get_yticklabels()] == [ALL, AGAINST_MOCAP, "skin depth"]
    assert "wrists, paper lifting: skin depth with 3.0 cm" in figure.alt
    assert "12 people" in figure.caption and "mmpose" in figure.caption and "made up" in figure.caption

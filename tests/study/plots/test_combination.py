"""Figures of the combination: what they carry and say."""

import numpy as np
import pandas as pd

from hicp_lib.evaluation.calibration.curves import calibration_study
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.study.plots import combination


def test_steps_are_drawn_for_every_body_and_subset():
    rows = [
        (body, subset, variant, 0.3 + 0.1 * (body == "mine"), 0.2, 0.4, step, -0.1, 0.2, 0.5, 0.4, 0.6)
        for body in ("theirs", "mine")
        for subset in ("basic", "headless")
        for variant, step in (("plain", np.nan), ("+ squares", 0.1))
    ]
    ends = ("", "_low", "_high")
    columns = ["body", "subset", "variant", *(f"{m}{end}" for m in ("AP", "step", "share") for end in ends)]
    table = pd.DataFrame(rows, columns=columns)
    figure = combination.ingredients(table, "made up")
    axes = np.reshape(figure.figure.axes, (2, 2))
    assert [label.get_text() for label in axes[0, 0].get_yticklabels()] == ["plain", "+ squares"]
    assert [axis.get_title(loc="left") for axis in axes[:, 0]] == ["bodies by theirs", "bodies by mine"]
    dots = [np.array(line.get_xdata(), float) for line in axes[1, 0].lines if line.get_marker() in "os"]
    np.testing.assert_allclose(dots, np.full((2, 2), 0.4))
    assert {line.get_marker() for line in axes[1, 0].lines} >= {"o", "s"}
    assert "0.40 to 0.40 on headless, bodies by mine" in figure.alt and "made up" in figure.caption
    assert figure.table is table


def test_reliability_is_drawn_for_raw_and_calibrated_scores():
    rng = np.random.default_rng(0)
    score = rng.random(400)
    hits = pd.DataFrame(
        {"detector": "mediapipe", "group": "body", "image_id": 0, "keypoint": 0,
         "source_image": rng.integers(0, 20, 400), "score": score, "hit": rng.random(400) < score**2}
    )  # fmt: skip
    errors, curves, _ = calibration_study(hits, draws=Draws(20))
    figure = combination.reliability_curves(curves, errors, 0.85, "made up")
    drawn = [len(container.lines[0].get_xdata()) for container in figure.figure.axes[0].containers]
    assert drawn == [
        (curves[curves["scores"] == kind]["count"] >= 30).sum() for kind in ("raw", "calibrated")
    ]
    assert 0 < sum(drawn) < len(curves)
    assert [text.get_text() for text in figure.figure.legends[0].get_texts()] == ["raw", "calibrated"]
    assert f"{errors['raw'].iloc[0]:.2f} to {errors['calibrated'].iloc[0]:.2f}" in figure.alt

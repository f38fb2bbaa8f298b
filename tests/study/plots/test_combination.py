"""Figures of the combination: what they carry and say."""

import numpy as np
import pandas as pd

from hicp_lib.evaluation.calibration.curves import calibration_study
from hicp_lib.study.plots import combination


def test_ingredients_show_every_variant_on_every_subset():
    rows = [
        (subset, variant, 0.3, 0.2, 0.4, 0.5, 0.4, 0.6)
        for subset in ("basic", "headless")
        for variant in ("whole image", "wrist squares")
    ]
    ends = ("", "_low", "_high")
    columns = ["subset", "variant", *(f"{name}{end}" for name in ("AP", "share") for end in ends)]
    table = pd.DataFrame(rows, columns=columns)
    figure = combination.ingredients(table, "made up")
    assert [label.get_text() for label in figure.figure.axes[0].get_yticklabels()] == [
        "whole image",
        "wrist squares",
    ]
    assert "wrist squares 0.30 on headless" in figure.alt and "made up" in figure.caption
    assert figure.table is table


def test_reliability_is_drawn_for_raw_and_calibrated_scores():
    rng = np.random.default_rng(0)
    score = rng.random(400)
    hits = pd.DataFrame(
        {"detector": "mediapipe", "group": "body", "image_id": 0, "keypoint": 0,
         "source_image": rng.integers(0, 20, 400), "score": score, "hit": rng.random(400) < score**2}
    )  # fmt: skip
    errors, curves, _ = calibration_study(hits, n_resamples=20)
    figure = combination.reliability_curves(curves, errors, 0.85, "made up")
    _, lower = figure.figure.axes
    assert [text.get_text() for text in figure.figure.legends[0].get_texts()] == ["raw", "calibrated"]
    assert sum(bar.get_height() for bar in lower.patches) == 2 * errors["n_keypoints"].iloc[0]
    assert f"{errors['raw'].iloc[0]:.2f} to {errors['calibrated'].iloc[0]:.2f}" in figure.alt

"""The picture of one person with and without the head shows the median person, by rule."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.core.images import write_png
from hicp_lib.study.plots.one_person import same_person
from tests.evaluation.made_people import make_annotations

LOSSES = {1: 0.9, 2: 0.1, 3: 0.4}  # by image: the third is in the middle


@pytest.fixture
def given(tmp_path) -> dict:
    truth, folders = {}, {}
    for subset in ("basic", "headless"):
        folders[subset] = tmp_path / subset
        truth[subset] = make_annotations(np.full((3, 136, 2), 30.0), [1, 2, 3])
        for image in truth[subset].images.values():
            write_png(folders[subset] / "images" / image.file_name, np.zeros((80, 60, 3), np.uint8))
    found = {(subset, name): {} for subset in truth for name in ("posenet", "mediapipe")}
    found["basic", "posenet"] = {3: Detections(np.full((1, 136, 2), 30.0), np.ones((1, 136)), np.ones(1))}
    return {"folders": folders, "truth": truth, "found": found, "note": "made-up people"}


def oks(losses: dict[int, float]) -> pd.DataFrame:
    rows = [
        {"subset": subset, "group": group, "detector": name, "image_id": image_id, "oks": value}
        for image_id, loss in losses.items()
        for name in ("posenet", "mediapipe")
        for group in ("body", "hand")
        for subset, value in (("basic", 0.95), ("headless", 0.95 - loss), ("near", 0.0))
    ]
    return pd.DataFrame(rows)


def test_shown_is_the_person_with_the_median_loss(given):
    figure = same_person(oks(LOSSES), **given)
    assert "Of 3 people the one with the median loss" in figure.caption and "made-up" in figure.caption
    assert "whole, posenet 0.95 and mediapipe 0.95; head cut off, posenet 0.55" in figure.alt
    titles = [axis.get_title() for axis in figure.figure.axes]
    assert titles == ["posenet\nOKS 0.95", "mediapipe\nOKS 0.95", "OKS 0.55", "OKS 0.55"]
    drawn = [axis.images[0].get_array().any() for axis in figure.figure.axes]
    assert drawn == [True, False, False, False]


def test_who_is_in_one_data_set_only_is_not_shown(given):
    table = oks(LOSSES)
    alone = (table["image_id"] == 3) & (table["subset"] == "headless")
    assert "head cut off, posenet 0.05" in same_person(table[~alone], **given).alt
    assert "Nothing to draw" in same_person(table[table["subset"] == "basic"], **given).caption

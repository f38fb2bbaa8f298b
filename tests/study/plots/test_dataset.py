"""Layouts of keypoints: their points are counted and drawn."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.files import read_json
from hicp_lib.core.images import write_png
from hicp_lib.core.keypoints import TO_HALPE
from hicp_lib.study.plots.dataset import crop_sizes, labelled_share, layouts, pairs
from tests.evaluation.made_people import make_annotations


def test_every_layout_has_a_person_with_the_points_that_have_a_counterpart():
    figure, made_of = layouts(), read_json(DATA_DIR / "survey.json")["layouts"]
    assert figure.table["points"].tolist() == [17, 25 + 42 + 70, 17 + 6 + 68 + 42, 26 + 68 + 42, 33 + 42]
    for axis, conventions in zip(figure.figure.axes, made_of.values(), strict=False):
        n_drawn = sum(len(line.get_xdata()) for line in axis.lines if line.get_marker() != "None")
        assert n_drawn == sum(int((TO_HALPE[name] >= 0).sum()) for name in conventions)
    hand = figure.figure.axes[-1]
    assert sum(len(line.get_xdata()) for line in hand.lines if line.get_marker() != "None") == 21
    markers = {line.get_marker() for axis in figure.figure.axes for line in axis.lines} - {"None"}
    assert len(markers) == 4
    assert "MMPose: COCO-WholeBody 133" in figure.alt


def test_the_person_faces_the_reader():
    body = layouts().figure.axes[0].lines
    points = next(line for line in body if line.get_marker() == "o")
    left_shoulder, right_shoulder = points.get_xdata()[5:7]
    assert left_shoulder > right_shoulder


def test_what_is_labelled_is_the_share_of_people_of_either_side():
    flags = np.full((2, 136), 2.0)
    flags[0, 9] = 0  # one of four wrists
    table = labelled_share(
        {"basic": make_annotations(np.ones((2, 136, 2)), [1, 2], visibility=flags)}, "x"
    ).table
    shares = table.set_index("part")["share"]
    assert shares["wrists"] == 0.75 and shares.drop("wrists").eq(1).all() and len(shares) == 11


def test_pairs_say_how_many_body_keypoints_the_cut_leaves(tmp_path):
    flags = np.full((1, 136), 2.0)
    whole = make_annotations(np.full((1, 136, 2), 9.0), [1], visibility=flags.copy())
    flags[0, :5] = 0
    cut = make_annotations(np.full((1, 136, 2), 9.0), [1], visibility=flags)
    write_png(tmp_path / "1.png", np.zeros((20, 20, 3), np.uint8))
    figure = pairs({"basic": (whole, tmp_path), "headless": (cut, tmp_path)}, [1], "made up")
    assert "basic 17.0 and headless 12.0" in figure.alt


@pytest.mark.parametrize("limit, small", [(20_000, 1), (1, 0)])
def test_crops_below_the_limit_are_counted_and_ticks_are_plain_numbers(limit, small):
    edges = {"left": 0, "top": 0, "right": [100, 200, 400], "bottom": 110}
    table = pd.DataFrame({f"basic_crop_{edge}_px": values for edge, values in edges.items()})
    figure = crop_sizes(table, limit, "made up")
    assert f"{small} of 3 crops" in figure.alt and "median is 22,000 px" in figure.alt
    labels = [label.get_text() for label in figure.figure.axes[0].get_xticklabels()]
    assert labels == ["20,000"]

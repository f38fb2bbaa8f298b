"""Figures of boxes and shares: every case has its mark, with few people and none, too."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.evaluation.ap.loss_shares import SHARES, box_variants, loss_shares
from hicp_lib.evaluation.ap.metric_table import draw_cases, metric_table
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.study.plots import evaluation
from tests.evaluation.made_people import make_annotations, make_detections

PAIR = ("movenet-lightning", "movenet-multipose")
PLACES = ("whole images", "basic", "headless", "near")


@pytest.fixture(params=[(0, 4), (2, 4), (9, 12)], ids=lambda request: f"{request[0]} of {request[1]} found")
def drawn(request):
    n_found, n_people = request.param
    points = np.random.default_rng(3).uniform(50, 400, (n_people, 136, 2))
    people = make_annotations(points, range(n_people))
    run = {i: make_detections(points[i]) for i in range(n_found)}
    found = {(place, label): run for place in PLACES for label in box_variants(*PAIR)}
    return draw_cases(dict.fromkeys(PLACES, people), found, Draws(20), groups=["body"])


def dots(axis) -> list:
    marked = [line for line in axis.get_lines() if line.get_marker() in ("^", "o", "D")]
    return [line for line in marked if len(line.get_xdata()) == 1]


def values(axis) -> list[float]:
    return sorted(float(line.get_xdata()[0]) for line in dots(axis))


def test_a_mark_for_each_source_of_the_box_and_place(drawn):
    table = metric_table(drawn)
    figure = evaluation.box_sources(table, "made-up people")
    (axis,) = figure.figure.axes
    assert "made-up people" in figure.caption and figure.table is table
    rows = table[table["metric"] == "AP"]
    assert values(axis) == pytest.approx(sorted(rows["value"]))
    assert len({(line.get_marker(), line.get_markerfacecolor()) for line in dots(axis)}) >= len(PLACES)
    assert len({line.get_ydata()[0] for line in dots(axis)}) == len(rows)  # none hides another
    assert "+0.00 on near" in figure.alt and len(figure.alt) < 600  # the same is found in every box


def test_a_panel_for_each_share_and_none_for_the_difference_of_two_detectors(drawn):
    table = loss_shares(drawn, *PAIR)
    figure = evaluation.loss_shares(table, "made-up people")
    assert [axis.get_xlabel() for axis in figure.figure.axes] == [f"loss of AP,\n{share}" for share in SHARES]
    shown = table[~table["detector"].str.contains(" less ")]
    for axis, share in zip(figure.figure.axes, SHARES, strict=True):
        assert values(axis) == pytest.approx(sorted(shown.loc[shown["share"] == share, "value"]))
    assert isinstance(figure.table, pd.DataFrame) and " less " not in figure.alt


def test_no_share_is_cut_off_whatever_stands_in_the_panel_before(drawn):
    table = loss_shares(drawn, *PAIR)
    last = table["share"] == SHARES[-1]
    table.loc[last, ["value", "low", "high"]] = table.loc[last, ["value", "low", "high"]] - 2
    figure = evaluation.loss_shares(table, "made-up people")
    for axis in figure.figure.axes:
        low, high = axis.get_xlim()
        assert all(low < value < high for value in values(axis))

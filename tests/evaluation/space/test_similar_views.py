"""What changes between nearly equal views."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.rotations import about
from hicp_lib.evaluation.space.similar_views import similar_pairs, similar_views
from tests.evaluation.still_person import make_points

NONE = [np.nan] * 3


def poses(*offsets_m, turned_deg=0.0):
    T = np.tile(np.eye(4), (len(offsets_m), 1, 1))
    T[:, 0, 3] = offsets_m
    T[-1, :3, :3] = about(2, np.radians(turned_deg))
    return T


def test_views_are_alike_in_place_and_direction():
    assert similar_pairs(poses(0, 0.04, 0.08, 1)).tolist() == [[0, 1], [1, 2]]
    assert similar_pairs(poses(0, 0, turned_deg=4)).tolist() == [[0, 1]]
    assert similar_pairs(poses(0, 0, turned_deg=6)).tolist() == []


def test_a_part_flickers_where_one_of_two_alike_views_shows_it():
    # Views 0 and 1 are alike, 2 and 3, 4 and 5; between the pairs lies a metre.
    T = {"upper": poses(0, 0, 1, 1, 2, 2)}
    points = make_points([[0, 0, 0], [0.03, 0, 0.04], [0, 0, 0], NONE, NONE, NONE], ["left_wrist"])
    table = similar_views(points, T, n_resamples=0).set_index(["part", "measure"])
    rate, moves = (table.loc["left wrist", name] for name in ("flicker rate", "moves [m]"))
    assert rate["value"] == 1 / 2 and rate["n"] == 2  # the third pair shows it in neither
    assert moves["value"] == pytest.approx(0.05) and moves["n"] == 1
    assert np.isnan(table.loc["left elbow", "flicker rate"]["value"])


def test_the_interval_comes_from_drawing_views():
    rng = np.random.default_rng(0)
    offsets = np.where(rng.random(40)[:, None] < 0.5, np.nan, 0.0) * np.ones(3)
    T = {"upper": poses(*np.repeat(np.arange(20), 2))}
    row = similar_views(make_points(offsets, ["left_wrist"]), T, n_resamples=400)
    row = row[(row["part"] == "left wrist") & (row["measure"] == "flicker rate")].iloc[0]
    assert row["low"] < row["value"] < row["high"] and 0.3 < row["high"] - row["low"] < 0.9


def test_views_that_are_all_different_say_nothing():
    table = similar_views(make_points([[0, 0, 0]] * 3), {"upper": poses(0, 1, 2)}, n_resamples=5)
    assert table["value"].isna().all() and (table["n"] == 0).all()
    assert isinstance(table, pd.DataFrame)

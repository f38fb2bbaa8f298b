"""What changes between nearly equal views."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.rotations import about
from hicp_lib.evaluation.space.sightings import similar_pairs, similar_views
from hicp_lib.evaluation.space.stability import LiftedViews
from hicp_lib.evaluation.statistics.resampling import Draws
from tests.evaluation.still_person import alone, make_points

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
    table = similar_views(LiftedViews(points, alone(upper=6)), T, draws=Draws(0)).set_index(
        ["part", "measure"]
    )
    rate, moves = (table.loc["left wrist", name] for name in ("flicker rate", "moves [m]"))
    assert rate["value"] == 1 / 2 and rate["n"] == 2  # the third pair shows it in neither
    assert moves["value"] == pytest.approx(0.05) and moves["n"] == 1
    assert np.isnan(table.loc["left elbow", "flicker rate"]["value"])


def test_the_interval_comes_from_drawing_views():
    rng = np.random.default_rng(0)
    offsets = np.where(rng.random(40)[:, None] < 0.5, np.nan, 0.0) * np.ones(3)
    T = {"upper": poses(*np.repeat(np.arange(20), 2))}
    row = similar_views(
        LiftedViews(make_points(offsets, ["left_wrist"]), alone(upper=40)), T, draws=Draws(400)
    )
    row = row[(row["part"] == "left wrist") & (row["measure"] == "flicker rate")].iloc[0]
    assert row["low"] < row["value"] < row["high"] and 0.3 < row["high"] - row["low"] < 0.9


def test_views_that_are_all_different_say_nothing():
    table = similar_views(
        LiftedViews(make_points([[0, 0, 0]] * 3), alone(upper=3)), {"upper": poses(0, 1, 2)}, draws=Draws(5)
    )
    assert table["value"].isna().all() and (table["n"] == 0).all()
    assert isinstance(table, pd.DataFrame)


def test_only_views_of_one_person_make_pairs():
    people = {"upper": np.array([0, 0, 1, 1])}
    points = make_points([[0, 0, 0], NONE, [0, 0, 0], [0, 0, 0]], ["left_wrist"], subjects=people["upper"])
    table = similar_views(LiftedViews(points, people), {"upper": poses(0, 0, 0, 0)}, draws=Draws(0))
    rate, moves = (row for _, row in table[table["part"] == "left wrist"].iterrows())
    assert (rate["value"], rate["n"], rate["n_people"]) == (1 / 2, 2, 2)
    assert (moves["value"], moves["n"], moves["n_people"]) == (0, 1, 1)


def test_a_person_drawn_twice_weighs_twice():
    """Half of 40 people flicker: the interval is that of a share of 40."""
    people = np.repeat(np.arange(40), 2)
    offsets_m = [NONE if k % 4 == 1 else [0, 0, 0] for k in range(80)]
    points = make_points(offsets_m, ["left_wrist"], subjects=people)
    table = similar_views(
        LiftedViews(points, {"upper": people}), {"upper": poses(*np.zeros(80))}, draws=Draws(2000)
    )
    row = table.set_index(["part", "measure"]).loc["left wrist", "flicker rate"]
    assert row["value"] == 1 / 2
    # A pair is drawn with both of its views or with neither: half of the people drawn, on average, have one.
    assert (row["high"] - row["low"]) / (2 * 2.02 * np.sqrt(0.25 / 40)) == pytest.approx(1.4, abs=0.25)

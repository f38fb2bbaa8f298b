"""A detector as its errors: what was put into made-up sightings comes out again."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.keypoints import INDEX, N_KEYPOINTS, RIGHT_HAND
from hicp_lib.experiments.avoidance.closed_loop import start_posture, true_keypoints
from hicp_lib.experiments.avoidance.error_model import (
    ELSEWHERE_M,
    GROUPS,
    ErrorModel,
    fit,
    found_groups,
    in_sight,
    lossy,
    modelled,
)
from hicp_lib.experiments.avoidance.reaching import NEAR_S, Moment
from hicp_lib.experiments.laboratory import in_root
from hicp_lib.simulation.body.identities import Subject

HAND = [*GROUPS].index("right hand")
MOMENT = Moment("sitting, hand", Subject(), NEAR_S)


def test_the_hand_that_reaches_is_in_sight_and_the_feet_are_not():
    seen = dict(zip(GROUPS, in_sight(MOMENT, start_posture()), strict=True))
    assert seen["right hand"] and not seen["face"] and not seen["legs"]
    before = in_sight(Moment("standing, passing", Subject(), 0.0), start_posture())
    assert not before.any()


@pytest.mark.parametrize(("off_m", "found"), [(ELSEWHERE_M - 0.01, True), (ELSEWHERE_M + 0.01, False)])
def test_a_group_is_found_near_it_whatever_its_side(off_m, found):
    truth = np.random.default_rng(0).uniform(-1, 1, (N_KEYPOINTS, 3)) * 0.01
    truth[RIGHT_HAND] += [1.0, 0, 0]
    points, sure = np.full((2, N_KEYPOINTS, 3), np.nan), np.zeros((2, N_KEYPOINTS), bool)
    left = slice(94, 115)
    points[1, left], sure[1, left] = truth[RIGHT_HAND] + [0, off_m, 0], True
    offsets = dict(zip(GROUPS, found_groups(points, sure, truth), strict=True))
    assert np.isfinite(offsets["right hand"]).all() == found
    if found:
        np.testing.assert_allclose(offsets["right hand"], [0, off_m, 0], atol=1e-9)
    assert np.isnan(offsets["head"]).all()


def sightings(found: np.ndarray, offsets_m: np.ndarray) -> pd.DataFrame:
    """Of the right hand in runs (r, n images), always in sight; nothing else is ever found."""
    rows = []
    for run, image in np.ndindex(found.shape):
        for group in GROUPS:
            there = group == "right hand" and found[run, image]
            x, y, z = offsets_m[run, image] if there else [np.nan] * 3
            rows.append((run, 1000 * run + image, group, group == "right hand", x, y, z))
    return pd.DataFrame(rows, columns=["run", "image", "group", "in_sight", "x_m", "y_m", "z_m"])


def test_a_model_has_the_rates_the_bias_and_the_scatter_of_what_was_seen():
    rng = np.random.default_rng(1)
    found, offsets = np.zeros((12, 60), bool), np.zeros((12, 60, 3))
    for run in range(12):
        lasting = rng.normal(0, 0.02, 3)
        for image in range(60):
            before = image > 0 and found[run, image - 1]
            found[run, image] = rng.random() < (0.9 if before else 0.3)
            offsets[run, image] = [0.05, 0, 0] + lasting + rng.normal(0, 0.01, 3)
    model = fit(sightings(found, offsets))
    after_loss, after_find = model.found_share[HAND, 1]
    assert after_find == pytest.approx(0.9, abs=0.04) and after_loss == pytest.approx(0.3, abs=0.08)
    assert model.bias_m[HAND, 0] == pytest.approx(0.05, abs=0.02)
    assert np.sqrt(np.diag(model.passing_m2[HAND])) == pytest.approx([0.01] * 3, rel=0.15)
    assert np.sqrt(np.diag(model.lasting_m2[HAND])) == pytest.approx([0.02] * 3, rel=0.6)
    assert model.burst_images == pytest.approx(1 / 0.3, rel=0.3)
    assert (model.found_share[:HAND] < 0.05).all()


def test_keypoints_are_drawn_with_the_model_s_errors():
    shares, flat = np.zeros((len(GROUPS), 2, 2)), np.zeros((len(GROUPS), 3))
    shares[HAND, 1] = 0.6
    flat[HAND] = 0.03, 0, 0
    model = ErrorModel(shares, flat, np.zeros((len(GROUPS), 3, 3)), np.zeros((len(GROUPS), 3, 3)), 1.0)
    perceive = modelled(model, np.random.default_rng(0))
    seen = [perceive(MOMENT, start_posture(), start_posture()) for _ in range(200)]
    truth_m = in_root(MOMENT.person.keypoints_m)
    found = [s for s in seen if s.scores.any()]
    assert len(found) / len(seen) == pytest.approx(0.6, abs=0.1)
    tip = INDEX["right_index_4"]
    np.testing.assert_allclose(found[0].keypoints_m[0, tip], truth_m[tip] + [0.03, 0, 0], atol=1e-6)
    assert set(np.flatnonzero(found[0].scores[0])) == set(RIGHT_HAND)


@pytest.mark.parametrize(("share", "burst"), [(0.0, 3.0), (0.3, 2.0), (0.9, 3.0)])
def test_losses_have_their_share_and_come_in_bursts(share, burst):
    perceive = lossy(true_keypoints, share, burst, np.random.default_rng(2))
    lost = np.array([not len(perceive(MOMENT, None, None).scores) for _ in range(3000)])
    assert lost.mean() == pytest.approx(share, abs=0.05)
    if share:
        starts = (lost[1:] & ~lost[:-1]).sum()
        assert lost.sum() / starts == pytest.approx(max(burst, share / (1 - share)), rel=0.2)

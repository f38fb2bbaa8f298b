"""Hips in the abdomen, broken fingers, tilted shoulders, on bodies whose anatomy is known."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.keypoints import LEFT_HAND, NAMES
from hicp_lib.evaluation.space.plausibility import IN_ABDOMEN_M, backwards, implausible
from hicp_lib.evaluation.space.stability import PARTS, LiftedViews
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.simulation.body.hands import HANDS_DEG, sample_hand
from hicp_lib.simulation.body.joints import pose_from_joints
from hicp_lib.simulation.body.model import load_body, pose_body
from tests.evaluation.still_person import alone

SHOULDER_M, HIP_M = np.array([0.2, 0.0, 0.5]), np.array([0.2, 0.0, 0.0])


def rows_of(keypoints_m, frame=0, detector="mine", score=0.9):
    columns = ["view", "detector", "method", "frame", "person", "keypoint", "score", "x_m", "y_m", "z_m"]
    table = [
        ("upper", detector, "paper", frame, 0, name, score, *place_m) for name, place_m in keypoints_m.items()
    ]
    return pd.DataFrame(table, columns=columns).assign(u_px=0.0, v_px=0.0)


def body(hip_up_m=0.0, right_shoulder_up_m=0.0):
    left = {"left_shoulder": SHOULDER_M, "left_hip": HIP_M + [0, 0, hip_up_m]}
    mirrored = np.array([-1, 1, 1])
    right = {
        "right_shoulder": SHOULDER_M * mirrored + [0, 0, right_shoulder_up_m], "right_hip": HIP_M * mirrored
    }  # fmt: skip
    return left | right


def table_of(*bodies):
    truth = rows_of(body())
    truths = pd.concat([truth.assign(frame=k) for k in range(len(bodies))])
    points = pd.concat([rows_of(one, k) for k, one in enumerate(bodies)])
    table = implausible(LiftedViews(points, alone(upper=len(bodies)), {"upper": truths}), draws=Draws(0))
    return table.set_index(["measure", "part"])


def test_a_hip_in_the_abdomen_is_too_near_to_its_shoulder():
    raised_m = 0.5 - IN_ABDOMEN_M + 0.01
    gone = {name: place for name, place in body(raised_m).items() if name != "left_hip"}
    table = table_of(body(), body(raised_m), body(raised_m - 0.02), gone)
    left, right = (table.loc["hips in the abdomen", f"{side} hip"] for side in ("left", "right"))
    assert left["value"] == pytest.approx(1 / 3) and left["n_images"] == 3
    assert right["value"] == left["of_truth"] == 0 and right["n_images"] == 4


def test_the_shoulder_line_is_held_against_the_horizontal():
    table = table_of(body(right_shoulder_up_m=0.4), body(right_shoulder_up_m=-0.4), body(), body())
    row = table.loc["shoulder line tilt [rad]", "shoulders"]
    assert row["value"] == pytest.approx(np.pi / 8) and row["of_truth"] == 0


def seen_from_everywhere(hand_m, n=60, seed=0):
    """A hand (21, 3) as orthographic images from n directions, (n, 21, 2)."""
    turns = np.linalg.qr(np.random.default_rng(seed).normal(size=(n, 3, 3)))[0]
    return 1000 * (hand_m @ turns)[..., :2]


def posed_hands(kind, n=20):
    rng, model = np.random.default_rng(1), load_body()
    for _ in range(n):
        joints = {f"left_{name}": angle for name, angle in sample_hand(rng, kind).items()}
        yield pose_body(model, 0, pose_from_joints(joints)).keypoints_m[LEFT_HAND]


@pytest.mark.parametrize("kind", HANDS_DEG)
def test_no_hand_that_people_have_looks_broken_from_anywhere(kind):
    broken = [backwards(seen_from_everywhere(hand_m)).mean() for hand_m in posed_hands(kind)]
    assert np.mean(broken) < 0.02


def test_a_finger_bent_back_at_its_end_looks_broken_from_most_sides():
    hand_m = np.zeros((21, 3))
    for finger in range(5):
        bends = np.radians([0, 50, -10]) if finger == 2 else np.zeros(3)  # 50 forward, then 60 back
        along = np.cumsum([[np.cos(a), 0, np.sin(a)] for a in bends], axis=0)
        hand_m[1 + 4 * finger :][:4] = [0, 0.02 * finger, 0] + 0.03 * np.vstack([[0, 0, 0], along])
    seen_px = seen_from_everywhere(hand_m, 400)
    assert backwards(seen_px).mean() > 0.6
    seen_px[:, 9:13] = np.nan  # without that finger, and without any
    assert (backwards(seen_px) == 0).all()
    assert np.isnan(backwards(np.full((1, 21, 2), np.nan))).all()


def test_broken_fingers_are_told_of_each_hand():
    straight = np.stack([np.arange(21.0), np.zeros(21)], axis=1)
    zigzag = straight.copy()
    zigzag[5:9, 1] = [0, 2, 0, 2]
    hands = {"left": zigzag, "right": straight}
    rows = [
        ("upper", "mine", "paper", 0, 0, name, 0.9, np.nan, np.nan, np.nan, *hands[name.split("_")[0]][k])
        for part in ("left hand", "right hand") for k, name in enumerate(PARTS[part])
    ]  # fmt: skip
    columns = ["view", "detector", "method", "frame", "person", "keypoint", "score"]
    points = pd.DataFrame(rows, columns=[*columns, "x_m", "y_m", "z_m", "u_px", "v_px"])
    table = implausible(LiftedViews(points, alone(upper=2)), draws=Draws(0)).set_index("part")
    assert table.loc["left hand", "value"] == 1 and table.loc["right hand", "value"] == 0
    assert (table["n_images"] == 1).all() and table["of_truth"].isna().all()
    assert PARTS["left hand"] == tuple(NAMES[i] for i in LEFT_HAND)


def test_people_are_drawn_who_have_such_bodies():
    people = np.repeat(np.arange(12), 5)
    bodies = [rows_of(body(0.2 if person < 4 else 0.0), k) for k, person in enumerate(people)]
    table = implausible(LiftedViews(pd.concat(bodies), {"upper": people}), draws=Draws(300))
    row = table.set_index(["measure", "part"]).loc["hips in the abdomen", "left hip"]
    assert row["value"] == pytest.approx(1 / 3) and (row["n_images"], row["n_people"]) == (60, 12)
    assert row["high"] - row["low"] > 0.45  # of twelve, not of sixty


def test_that_nobody_has_it_is_not_certain_of_others():
    n_people, n_frames = 12, 4
    frames = range(n_people * n_frames)
    points = pd.concat([rows_of(body(), k) for k in frames])
    whose = {"upper": np.repeat(np.arange(n_people), n_frames)}
    table = implausible(LiftedViews(points, whose), draws=Draws(50)).set_index("measure")
    hips = table.loc["hips in the abdomen"]
    assert (hips["value"] == 0).all() and (hips["low"] == 0).all()
    assert hips["high"].to_numpy() == pytest.approx(1 - 0.025 ** (1 / n_people))
    tilt = table.loc["shoulder line tilt [rad]"]
    assert tilt["value"] == tilt["high"] == 0  # an angle, not a share

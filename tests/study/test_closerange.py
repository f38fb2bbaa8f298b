"""What was asked of the network for close range, and what is kept of its training and evaluation."""

import pandas as pd
import pytest

from hicp_lib.core.images import read_image
from hicp_lib.evaluation.failures.presence import MEASURES
from hicp_lib.study.closerange import FOLDER, criteria, trained

LIGHTNING, HANDS = "movenet-lightning", "combined:movenet-thunder+mediapipe-hands"


def differences(**values):
    rows = [
        ("headless", "body", LIGHTNING, values.get("body", 0.1)),
        ("basic", "body", LIGHTNING, 0.5),
        ("headless", "body", "movenet-thunder", 0.01),
        ("headless", "hand", HANDS, values.get("hand", 0.2)),
        ("headless", "hand", "combined:posenet+mediapipe-hands", values.get("hand", 0.2) + 0.1),
        ("headless", "hand", "mediapipe", 0.0),
    ]
    table = pd.DataFrame(rows, columns=["subset", "group", "other", "value"])
    return table.assign(low=table["value"] - 0.02, high=table["value"] + 0.02)


def extended(ours=0.6, other=0.5):
    rows = [("closerange", ours), (LIGHTNING, other), ("movenet-thunder", other - 0.1)]
    table = pd.DataFrame(rows, columns=["detector", "value"]).assign(subset="headless", measure=MEASURES[2])
    wrong = table.assign(measure=MEASURES[1], value=1 - table["value"])
    return pd.concat([table, wrong, table.assign(subset="basic", value=0.9)], ignore_index=True)


def photographs(basic=-0.01, headless=0.0):
    rows = [
        ("basic", LIGHTNING, basic),
        ("headless", LIGHTNING, headless),
        ("headless", "movenet-thunder", -0.2),
    ]
    return pd.DataFrame(rows, columns=["subset", "other", "value"]).assign(low=-0.1, high=0.1)


def test_all_that_was_asked_can_be_met():
    asked = criteria(differences(), extended(), photographs())
    assert asked["met"].all() and len(asked) == 5
    assert asked["asked"].tolist() == [0.03, 0.10, 0.0, -0.02, -0.02]
    assert asked["other"].tolist() == [LIGHTNING, HANDS, LIGHTNING, LIGHTNING, LIGHTNING]


@pytest.mark.parametrize(
    "made, missed",
    [
        ((differences(body=0.02), extended(), photographs()), 0),
        ((differences(hand=0.09), extended(), photographs()), 1),
        ((differences(), extended(0.45), photographs()), 2),
        ((differences(), extended(), photographs(basic=-0.03)), 3),
        ((differences(), extended(), photographs(headless=-0.03)), 4),
    ],
)
def test_each_of_it_can_be_missed(made, missed):
    assert criteria(*made)["met"].tolist() == [row != missed for row in range(5)]


def test_what_is_kept_is_whole():
    curve, ablations = trained("curve"), trained("ablations")
    assert curve["step"].is_monotonic_increasing and curve["body"].iloc[-1] > curve["body"].iloc[0]
    assert {"body", "hand"} <= set(ablations["group"]) and ablations["variant"].nunique() > 3
    asked = criteria(trained("differences"), trained("extended"), trained("photographs"))
    assert asked["value"].notna().all()
    assert read_image(FOLDER / "squares.jpg").shape[2] == 3

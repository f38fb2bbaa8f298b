"""What runs of avoidance are judged to be worth, on runs made up so that the answers are known."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.keypoints import INDEX
from hicp_lib.experiments.avoidance.closed_loop import Latency, Trial
from hicp_lib.experiments.avoidance.error_model import GROUPS
from hicp_lib.experiments.avoidance.reaching import LEAVES_S
from hicp_lib.experiments.avoidance.runs import PUBLISHED_GAINS, Job, Run
from hicp_lib.robot.home import HOME_M
from hicp_lib.robot.loop import AVOIDING, FREE
from hicp_lib.study.avoidance import (
    curves,
    false_retreats,
    keypoint_errors,
    measured_times,
    metrics,
    model_check,
    over_people,
    reasons,
    sightings,
)

T = np.arange(190) * 0.04
NAME = "sitting, hand"


def made_up(condition: str, least_m: float, retreats: bool, seen_until_s: float | None = None) -> Run:
    """The person is `least_m` away from 2 to 3.6 s; the hand is off its post from 1.8 s to 0.5 s after."""
    away = (T >= 1.8) & (T < LEAVES_S[1] + 0.5) & retreats
    distance = np.interp(T, [1.0, 2.0, 3.6, 4.6], [0.6, least_m, least_m, 0.6])
    cycles = pd.DataFrame(
        {
            "t_s": T,
            "distance_m": distance,
            "hand_error_m": np.where(away, 0.1, 0.0),
            "status": np.where(away, AVOIDING, FREE),
        }
    )
    rows = []
    if seen_until_s is not None:
        for t in np.arange(0, 7.6, 0.1):
            points, scores = np.full((1, 136, 3), np.nan), np.zeros((1, 136))
            truth = np.full((136, 3), 5.0)
            truth[INDEX["right_wrist"]] = HOME_M["left"]
            if t < seen_until_s:
                points[0, INDEX["left_wrist"]] = np.array(HOME_M["left"]) + [0.03, 0, 0]
                scores[0, INDEX["left_wrist"]] = 0.9
            arrays = {
                "keypoints_m": points,
                "scores": scores,
                "truth_m": truth,
                "keypoints_px": points[..., :2],
                "in_sight": np.ones(len(GROUPS)),
            }
            flat = {key: array.ravel().tolist() for key, array in arrays.items()}
            time_ms = 5000.0 if t == 0 else 90.0 + 20 * (t > 5.65)
            rows.append({"t_s": t, "time_ms": time_ms, "jpeg": b""} | flat)
    return Run(
        Job(Trial(NAME), condition, Latency(inference_s=0.1 if rows else 0.0)), cycles, pd.DataFrame(rows)
    )


@pytest.fixture(scope="module")
def runs() -> list[Run]:
    return [
        made_up("no avoidance", 0.01, False),
        made_up("ground truth", 0.06, True),
        made_up("ground truth" + PUBLISHED_GAINS, 0.015, True),
        made_up("sees", 0.03, True, seen_until_s=7.6),
        made_up("loses", 0.01, False, seen_until_s=2.2),
        made_up("blind", 0.01, False, seen_until_s=0.0),
    ]


def test_metrics_of_runs_with_known_answers(runs):
    table = metrics(runs)
    assert table.loc[2, ["detector", "gains"]].tolist() == ["ground truth", "published"]
    table = table.drop(index=2).set_index("detector")
    truth, none, loses = table.loc["ground truth"], table.loc["no avoidance"], table.loc["loses"]
    assert truth["min_distance_m"] == pytest.approx(0.06)
    assert none["under_5cm_s"] == pytest.approx(1.6 + 2 * 0.04 / 0.59, abs=0.05)
    assert truth["under_5cm_s"] == 0
    assert truth["back_s"] == pytest.approx(0.5, abs=0.041)
    assert truth["retreat_m"] == pytest.approx(0.1)
    crossing_s = 1.0 + (0.6 - 0.2) / 0.54
    assert truth["reaction_s"] == pytest.approx(1.8 - crossing_s, abs=0.05)
    assert np.isnan(none["back_s"]) and np.isnan(none["reaction_s"])
    assert table.loc["sees", "seen_share"] == 1 and table.loc["blind", "seen_share"] == 0
    near_until_s = 3.88  # they are not looked at for longer
    assert loses["blind_s"] == pytest.approx(near_until_s - 2.1, abs=0.05)


@pytest.mark.parametrize(
    ("keypoint", "off_m", "score", "share"),
    [
        ("nose", 0.14, 0.9, 1.0),
        ("nose", 0.16, 0.9, 0.0),
        ("nose", 0.14, 0.2, 0.0),
        ("left_wrist", 0.0, 0.9, 0.0),
    ],
)
def test_a_head_is_found_by_a_sure_keypoint_of_the_head_on_the_head(runs, keypoint, off_m, score, share):
    points, scores, truth = np.full((1, 136, 3), np.nan), np.zeros((1, 136)), np.full((136, 3), 5.0)
    truth[INDEX["left_ear"]] = 1.0  # on the head, if not the keypoint's own place
    points[0, INDEX[keypoint]] = truth[INDEX["left_ear"]] + [off_m, 0, 0]
    scores[0, INDEX[keypoint]] = score
    seen = runs[3]
    arrays = {"keypoints_m": points, "scores": scores, "truth_m": truth}
    flat = {name: [array.ravel().tolist()] * len(seen.frames) for name, array in arrays.items()}
    assert metrics([Run(seen.job, seen.cycles, seen.frames.assign(**flat))])["head_share"].item() == share


def test_a_retreat_from_nobody_is_false():
    run = made_up("ground truth", 0.06, True)
    cycles = run.cycles.assign(status=np.where((T > 0.2) & (T < 0.4), AVOIDING, run.cycles["status"]))
    assert metrics([Run(run.job, cycles, run.frames)])["false_retreats"].item() == 1
    assert metrics([run])["false_retreats"].item() == 0


def test_failures_of_first_reaches_are_counted_by_their_reason(runs):
    table = metrics(runs)
    found = reasons(table).set_index("detector")
    assert set(found.index) == {"ground truth", "sees", "loses", "blind"}
    assert found.loc["ground truth", "gains"] == "published" and (found["n_people"] == 1).all()
    assert "too slow" in found.loc["ground truth", "why"] and "too late" in found.loc["sees", "why"]
    assert "lost for more" in found.loc["loses", "why"] and "never found" in found.loc["blind", "why"]
    heads = pd.concat([table[table["detector"] == "sees"].assign(script="sitting, head", head_share=share)
                       for share in (0.49, 0.5)])  # fmt: skip
    assert ["head" in why for why in reasons(heads)["why"]] == [True, False]


def people(values_m, **columns) -> pd.DataFrame:
    table = pd.DataFrame({"script": "a", "detector": "b", "gains": "ours", "min_distance_m": values_m})
    return table.assign(subject=range(len(table)), **columns)


def test_clearances_are_told_over_people_with_their_intervals():
    told = over_people(people([0.04] * 3 + [0.05] * 5 + [0.1] * 4), ["detector", "gains"]).iloc[0]
    assert told["value"] == pytest.approx(0.77 / 12) and told["low"] < told["value"] < told["high"]
    assert told["kept_5cm"] == 9 / 12 and told["kept_10cm"] == 4 / 12 and told["n_people"] == 12
    # Wilson's interval of 9 in 12
    assert [told["kept_5cm_low"], told["kept_5cm_high"]] == pytest.approx([0.468, 0.911], abs=1e-3)
    assert np.isnan(over_people(people([0.04, 0.2]), ["detector"])["low"]).all()


def test_who_the_arm_moved_for_is_a_share_of_bystanders():
    told = false_retreats(people([0.4] * 4, retreat_m=[0.0, 0.004, 0.006, 0.1])).iloc[0]
    assert told["value"] == 0.5 and told["retreat_m"] == 0.1 and told["low"] < 0.5 < told["high"]


def test_a_model_is_checked_on_the_same_people_at_the_same_speed():
    rendered = people([0.0, 0.0], reach_m=[0.03, 0.05], latency_s=0.1)
    swept = people([0.0, 0.0], reach_m=[0.04, 0.05], latency_s=0.1, follow_m_s=0.8, lost_share=0.0)
    other = swept.assign(reach_m=1.0, follow_m_s=0.0)
    told = model_check(rendered, pd.concat([other, swept]), 0.8).iloc[0]
    assert told[["rendered_m", "modelled_m", "apart_m"]].tolist() == pytest.approx(
        [0.04, 0.045, 0.01 / 2**0.5]
    )


def test_a_curve_has_what_was_swept_and_the_rest_as_stated():
    at = [(0.0, 0.1, 0.0), (0.8, 0.1, 0.0), (0.0, 0.3, 0.0), (0.0, 0.1, 0.9)]
    swept = pd.DataFrame(at, columns=["follow_m_s", "latency_s", "lost_share"]).assign(detector="b")
    found = curves(swept, {"b": Latency(queue_s=0.1)})
    assert {column: rows.index.tolist() for column, rows in found.items()} == {
        "latency_s": [0, 2], "lost_share": [0, 3], "follow_m_s": [0, 1],
    }  # fmt: skip


def test_sightings_say_what_was_found_where(runs):
    table = sightings([runs[3], runs[4]])
    arms = table[(table["group"] == "right arm") & (table["run"] == 1)]
    assert arms["x_m"].notna().sum() == 22 and arms["in_sight"].all()
    np.testing.assert_allclose(arms["x_m"].dropna(), 0.03, atol=1e-6)
    assert table[table["group"] == "head"]["x_m"].isna().all()


def test_errors_do_not_mind_the_side(runs):
    errors = keypoint_errors(runs)
    np.testing.assert_allclose(errors["error_m"], 0.03, atol=1e-6)
    assert errors["near"].all() and set(errors["detector"]) == {"sees", "loses"}


def test_times_are_told_beside_the_stated_delay(runs):
    shown = measured_times(runs).set_index("detector")
    assert shown.index.tolist() == ["sees", "loses", "blind"]
    # 75 images, of which the 19 from 5.7 s on took 110 ms; the first one is left out.
    assert shown.loc["sees"].tolist() == pytest.approx([0.1, 0.1, 90, 110, 56 / 75])
    assert measured_times(runs[:1]).empty

"""What runs of avoidance are judged to be worth, on runs made up so that the answers are known."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.keypoints import INDEX
from hicp_lib.experiments.avoidance.closed_loop import Trial
from hicp_lib.experiments.avoidance.reaching import LEAVES_S
from hicp_lib.experiments.avoidance.runs import IDEAL, Job, Run
from hicp_lib.robot.home import HOME_M
from hicp_lib.robot.loop import AVOIDING, FREE
from hicp_lib.study.avoidance import (
    against_no_avoidance,
    error_quantiles,
    keypoint_errors,
    measured_times,
    metrics,
    separations,
)

T = np.arange(380) * 0.02
NAME = "sitting, hand"


def made_up(condition: str, least_m: float, retreats: bool, seen_until_s: float | None = None) -> Run:
    """The person is `least_m` away from 2 to 4 s; the hand is off its post from 1.8 s to 0.5 s after."""
    away = (T >= 1.8) & (T < LEAVES_S[1] + 0.5) & retreats
    distance = np.interp(T, [1.0, 2.0, 4.0, 5.0], [0.6, least_m, least_m, 0.6])
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
            }
            flat = {key: array.ravel().tolist() for key, array in arrays.items()}
            time_ms = 5000.0 if t == 0 else 90.0 + 20 * (t > 5.65)
            rows.append({"t_s": t, "time_ms": time_ms, "jpeg": b""} | flat)
    return Run(Job(Trial(NAME), condition, 0.1 if rows else 0.0), cycles, pd.DataFrame(rows))


@pytest.fixture(scope="module")
def runs() -> list[Run]:
    none, truth, published = IDEAL
    return [
        made_up(none, 0.01, False),
        made_up(truth, 0.06, True),
        made_up(published, 0.015, True),
        made_up("sees", 0.03, True, seen_until_s=7.6),
        made_up("loses", 0.01, False, seen_until_s=2.2),
        made_up("blind", 0.01, False, seen_until_s=0.0),
    ]


def test_metrics_of_runs_with_known_answers(runs):
    table = metrics(runs).set_index("detector")
    truth, none, loses = table.loc["ground truth"], table.loc["no avoidance"], table.loc["loses"]
    assert truth["min_distance_m"] == pytest.approx(0.06)
    assert none["under_5cm_s"] == pytest.approx(2.0 + 2 * 0.04 / 0.59, abs=0.05)
    assert truth["under_5cm_s"] == 0
    assert truth["back_s"] == pytest.approx(0.5, abs=0.021)
    assert truth["retreat_m"] == pytest.approx(0.1) and truth["idle_error_m"] == 0
    crossing_s = 1.0 + (0.6 - 0.2) / 0.54
    assert truth["reaction_s"] == pytest.approx(1.8 - crossing_s, abs=0.03)
    assert np.isnan(none["back_s"]) and np.isnan(none["reaction_s"])
    assert table.loc["sees", "seen_share"] == 1 and table.loc["blind", "seen_share"] == 0
    near_until_s = 4.0 + (0.25 - 0.01) / 0.59
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
    run = made_up(IDEAL[1], 0.06, True)
    cycles = run.cycles.assign(status=np.where((T > 0.2) & (T < 0.4), AVOIDING, run.cycles["status"]))
    assert metrics([Run(run.job, cycles, run.frames)])["false_retreats"].item() == 1
    assert metrics([run])["false_retreats"].item() == 0


def test_the_verdict_names_the_failure(runs):
    verdicts = against_no_avoidance(metrics(runs)).set_index("detector")
    assert verdicts.loc["ground truth", "value"] == pytest.approx(6)
    assert verdicts["enough"].to_dict() == {
        "ground truth": True, "ground truth, published gains": False,
        "sees": True, "loses": False, "blind": False,
    }  # fmt: skip
    assert "never finds" in verdicts.loc["blind", "why"] and "lost in" in verdicts.loc["loses", "why"]
    assert "too slow" in verdicts.loc["ground truth, published gains", "why"]


def test_a_head_that_is_not_found_is_the_reason(runs):
    table = metrics([runs[0], runs[1], runs[3]]).assign(script="sitting, head", min_distance_m=0.01)
    of_heads = {share: table.assign(head_share=share, reaction_s=0.7) for share in (0.49, 0.5)}
    why = {share: against_no_avoidance(rows)["why"].iloc[-1] for share, rows in of_heads.items()}
    assert "the head that comes, and that is found in 49%" in why[0.49]
    assert why[0.5] == "found in 100% of the images, but the hand moves 0.7 s late"


def test_errors_do_not_mind_the_side_and_feed_the_separation(runs):
    errors = keypoint_errors(runs)
    np.testing.assert_allclose(errors["error_m"], 0.03, atol=1e-6)
    assert errors["near"].all() and set(errors["detector"]) == {"sees", "loses"}
    found = separations(runs, errors, 0.02)
    assert set(found) == {"sees", "loses"}
    assert found["sees"].human_uncertainty_m == pytest.approx(0.03)
    assert found["sees"].reaction_s == pytest.approx(0.12)
    shown = error_quantiles(errors)
    assert shown["detector"].tolist() == ["sees", "loses"]
    assert shown["n_keypoints"].tolist() == [76, 22]
    np.testing.assert_allclose(shown[["median_m", "p95_m"]], 0.03, atol=1e-6)


def test_times_are_told_beside_the_stated_delay(runs):
    shown = measured_times(runs).set_index("detector")
    assert shown.index.tolist() == ["sees", "loses", "blind"]
    # 75 images, of which the 19 from 5.7 s on took 110 ms; the first one is left out.
    assert shown.loc["sees"].tolist() == pytest.approx([0.1, 90, 56 / 75])
    assert measured_times(runs[:1]).empty

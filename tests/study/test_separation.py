"""The separation before a detector takes its terms from the runs, the body model and stated brakes."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.keypoints import BODY, LEFT_HAND, N_KEYPOINTS
from hicp_lib.experiments.avoidance.closed_loop import Latency, Trial
from hicp_lib.experiments.avoidance.runs import Job, Run
from hicp_lib.robot.home import home_posture
from hicp_lib.robot.kinematics import ARM_JOINTS, load_icub
from hicp_lib.robot.separation import Brakes
from hicp_lib.study.separation import beyond_keypoints_m, separations_before

SPEED_RAD_S = 0.3
WRISTS = np.isin(np.arange(N_KEYPOINTS), BODY)
ALL = np.ones(N_KEYPOINTS, bool)


@pytest.fixture(scope="module")
def runs() -> list[Run]:
    """The elbow turns evenly; one keypoint, the nose, is found 30 cm off the root."""
    t = np.arange(20) * 0.04
    angles = np.tile(home_posture(load_icub()).angles("left"), (len(t), 1))
    angles[:, ARM_JOINTS.index("elbow")] += SPEED_RAD_S * t
    cycles = pd.DataFrame({f"{joint}_rad": angles[:, k] for k, joint in enumerate(ARM_JOINTS)}).assign(t_s=t)
    points, scores = np.full((N_KEYPOINTS, 3), np.nan), np.zeros(N_KEYPOINTS)
    points[WRISTS], scores[WRISTS] = 0.3, 0.9
    frame = {
        "t_s": 0.0,
        "keypoints_m": points.ravel(),
        "scores": scores,
        "truth_m": np.zeros(3 * N_KEYPOINTS),
    }
    frames = pd.DataFrame([{name: np.ravel(value).tolist() for name, value in frame.items()}]).assign(t_s=0.0)
    latency = Latency(transport_s=0.03, inference_s=0.07)
    return [
        Run(Job(Trial("sitting, hand"), name, latency), cycles, frames) for name in ("mediapipe", "blind")
    ]


def errors(*values_m: float) -> pd.DataFrame:
    return pd.DataFrame({"detector": "mediapipe", "near": True, "error_m": values_m})


def test_terms_come_from_runs_brakes_and_latency(runs):
    brakes = Brakes(delay_s=0.05, deceleration_rad_s2=1.0)
    found = separations_before(runs, errors(0.04, 0.04), 0.02, brakes)
    assert list(found) == ["mediapipe"]
    mine = found["mediapipe"]
    assert mine.reaction_s == pytest.approx(0.12)
    assert mine.stopping_s == pytest.approx(0.05 + SPEED_RAD_S)
    wrist_to_palm_m, forearm_m = 0.0645, 0.138
    assert mine.robot_m_s == pytest.approx(SPEED_RAD_S * (wrist_to_palm_m + forearm_m), rel=0.05)
    assert mine.human_uncertainty_m == pytest.approx(0.04)
    assert mine.intrusion_m == pytest.approx(beyond_keypoints_m(WRISTS))
    assert mine.terms_m()["S_h: person, until the robot stands"] == pytest.approx(1.6 * (0.12 + 0.35))


def test_a_detector_without_hands_leaves_them_to_intrude():
    without, hands_m = beyond_keypoints_m(WRISTS), beyond_keypoints_m(ALL)
    assert 0.15 < without < 0.25 and hands_m < without
    one_hand = np.isin(np.arange(N_KEYPOINTS), LEFT_HAND)  # either side stands for both
    assert 0.01 < beyond_keypoints_m(one_hand) < 0.08 < hands_m  # of the head, which reaches further
    assert beyond_keypoints_m(~ALL) == np.inf

"""The separation required by ISO 10218-2:2025 for each detector, from its runs of avoidance."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from hicp_lib.core.keypoints import HANDS, HEAD, N_KEYPOINTS, mirror
from hicp_lib.core.memo import memoised
from hicp_lib.experiments.avoidance.runs import IDEAL, Run
from hicp_lib.robot.kinematics import ARM_JOINTS, load_icub
from hicp_lib.robot.separation import ASSUMED, Brakes, Separation
from hicp_lib.simulation.body.identities import split_members
from hicp_lib.simulation.body.model import PosedBody, load_body, pose_body
from hicp_lib.study.avoidance import sure_keypoints

_NEARING = ((("hand",), np.r_[9, 10, HANDS]), (("face", "scalp"), HEAD))  # regions, and their keypoints
_EVERY = 4  # every n-th of their vertices is used


def separations_before(
    runs: Sequence[Run],
    errors: pd.DataFrame,
    period_s: float,
    brakes: Brakes = ASSUMED,
    robot_uncertainty_m: float = 0.01,
) -> dict[str, Separation]:
    """The separation that each detector would need; none for a detector without keypoints near the hand.

    Speeds of the hand and of the fastest joint are the highest in any of the runs. It takes a latency and a
    control period to react; then `brakes` stop the arm. The uncertainty of the person's position is the 95th
    percentile of the detector's errors near the hand, the intrusion `beyond_keypoints_m`.

    Parameters
    ----------
    runs : sequence of Run
    errors : pd.DataFrame
        As from `hicp_lib.study.avoidance.keypoint_errors`.
    period_s : float
        Of the controller.
    brakes : Brakes, optional
    robot_uncertainty_m : float, optional
        Of the robot's own place (assumed: joint offsets and the camera's mount).

    Returns
    -------
    dict of str to Separation
        By detector.
    """
    latencies_s = {run.job.detector: run.job.latency.total_s for run in runs if run.job.detector not in IDEAL}
    hand_m_s, joint_rad_s = np.max([_speeds(run.cycles) for run in runs], axis=0)
    place_m = errors[errors["near"]].groupby("detector")["error_m"].quantile(0.95)
    return {
        name: Separation(
            robot_m_s=hand_m_s,
            reaction_s=latency_s + period_s,
            stopping_s=brakes.stopping_s(joint_rad_s),
            brake_delay_s=brakes.delay_s,
            intrusion_m=beyond_keypoints_m(_found(runs, name)),
            human_uncertainty_m=float(place_m[name]),
            robot_uncertainty_m=robot_uncertainty_m,
        )
        for name, latency_s in latencies_s.items()
        if name in place_m.index
    }


def beyond_keypoints_m(found: np.ndarray) -> float:
    """Distance of the skin of hands or head, which come nearest, beyond the nearest of their keypoints.

    Our interpretation of the standard's intrusion distance for keypoints, over the development identities.
    Hands or a head without any detected keypoint are not included: nothing warns of them.

    Parameters
    ----------
    found : array of bool, shape (136,)

    Returns
    -------
    float
        Infinite without keypoints of either.

    Examples
    --------
    >>> wrist, all_of_them = np.arange(136) == 9, np.ones(136, bool)
    >>> round(beyond_keypoints_m(wrist), 1), round(beyond_keypoints_m(all_of_them), 1)
    (0.2, 0.1)
    """
    body, people, found = load_body(), _development_people(), found | found[mirror("halpe136")]
    gaps_m = [
        cKDTree(person.keypoints_m[keypoints[found[keypoints]]]).query(person.vertices_m[skin])[0].max()
        for regions, keypoints in _NEARING
        for skin in [np.flatnonzero(body.in_regions(*regions))[::_EVERY]]
        for person in people
        if found[keypoints].any()
    ]
    return float(max(gaps_m, default=np.inf))


@memoised()
def _development_people() -> list[PosedBody]:
    body = load_body()
    return [pose_body(body, name, {}) for name in split_members("development")["bodies"]]


def _found(runs: Sequence[Run], detector: str) -> np.ndarray:
    """Which keypoints a detector has ever given with a sufficient score, (136,)."""
    frames = (frame for run in runs if run.job.detector == detector for _, frame in run.frames.iterrows())
    sure = (sure_keypoints(frame)[1].any(axis=0) for frame in frames)
    return np.any([np.zeros(N_KEYPOINTS, bool), *sure], axis=0)


def _speeds(cycles: pd.DataFrame) -> tuple[float, float]:
    """The highest speed of the hand (m/s) and of any joint (rad/s)."""
    angles_rad, t_s = cycles[[f"{joint}_rad" for joint in ARM_JOINTS]].to_numpy(), cycles["t_s"].to_numpy()
    hand_m = load_icub().chains["left"].T_root_link("hand", angles_rad)[:, :3, 3]
    steps_s = np.diff(t_s)
    hand_m_s = np.linalg.norm(np.diff(hand_m, axis=0), axis=1) / steps_s
    return float(hand_m_s.max()), float((np.abs(np.diff(angles_rad, axis=0)) / steps_s[:, None]).max())

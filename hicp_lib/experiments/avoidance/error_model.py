"""A model of a detector's errors, estimated in rendered runs and sampled without rendering.

Keypoints form groups (`GROUPS`), each found or lost as a whole. Whether a group is found depends on whether
it is roughly visible, and on whether it was found in the image before. The keypoints of a found group share
an error vector: the detector's bias, a constant part (sampled once per person) and a part that changes from
image to image. All are estimated per group, in the robot's root frame. Detections more than `ELSEWHERE_M`
away from the person's own keypoints are not modelled and count as lost.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from hicp_lib.core.camera import transform
from hicp_lib.core.keypoints import FACE, HEAD, LEFT_HAND, N_KEYPOINTS, RIGHT_HAND, mirror
from hicp_lib.experiments.avoidance.closed_loop import MOUNT, Perceive
from hicp_lib.experiments.avoidance.reaching import Moment
from hicp_lib.experiments.avoidance.skin_distance import robot_spheres
from hicp_lib.experiments.laboratory import COLOUR, in_root
from hicp_lib.robot.kinematics import load_icub
from hicp_lib.robot.loop import Perception
from hicp_lib.robot.posture import Posture

GROUPS = {
    "head": np.setdiff1d(HEAD, FACE), "face": FACE, "trunk": np.array([5, 6, 11, 12, 18, 19]),
    "left arm": np.array([7, 9]), "right arm": np.array([8, 10]),
    "left hand": LEFT_HAND, "right hand": RIGHT_HAND, "legs": np.array([13, 14, 15, 16, *range(20, 26)]),
}  # fmt: skip
ELSEWHERE_M = 0.25
_CELL_PX = 16  # of the coarse image for occlusion
_FLESH_M = 0.08  # a keypoint this far behind the surface is still visible
_OFFSETS = ["x_m", "y_m", "z_m"]


def in_sight(moment: Moment, posture: Posture) -> np.ndarray:
    """Groups of which the robot sees about half or more: neither outside the image nor occluded.

    Parameters
    ----------
    moment : Moment
    posture : Posture
        The robot's.

    Returns
    -------
    array of bool, shape (n_groups,)
    """
    icub, person = load_icub(), moment.person
    places, _ = robot_spheres(icub, posture)
    points = [in_root(person.keypoints_m), in_root(person.vertices_m), places]
    T_camera_root = np.linalg.inv(icub.T_root_camera(posture.angles("head"), MOUNT))
    x, y, depth_m = transform(T_camera_root, np.concatenate(points)).T
    depth_m = np.where(depth_m > 0.05, depth_m, np.inf)
    u = (COLOUR.fx_px * x / depth_m + COLOUR.cx_px) // _CELL_PX
    v = (COLOUR.fy_px * y / depth_m + COLOUR.cy_px) // _CELL_PX
    columns, rows = COLOUR.width_px // _CELL_PX, COLOUR.height_px // _CELL_PX
    inside = (u >= 0) & (u < columns) & (v >= 0) & (v < rows) & np.isfinite(depth_m)
    cell = np.where(inside, v * columns + u, rows * columns).astype(int)
    nearest_m = np.full(rows * columns + 1, np.inf)
    np.minimum.at(nearest_m, cell[N_KEYPOINTS:], depth_m[N_KEYPOINTS:])
    seen = inside[:N_KEYPOINTS] & (depth_m[:N_KEYPOINTS] <= nearest_m[cell[:N_KEYPOINTS]] + _FLESH_M)
    return np.array([seen[group].mean() >= 0.5 for group in GROUPS.values()])


def found_groups(points_m: np.ndarray, is_sure: np.ndarray, truth_m: np.ndarray) -> np.ndarray:
    """Errors of each group of the true person in an image; NaN where it was not found.

    Left and right do not matter for distances: the nearer of the two is used.

    Parameters
    ----------
    points_m : array, shape (p, 136, 3)
        Of all detected people.
    is_sure : array of bool, shape (p, 136)
        Those with a sufficient score.
    truth_m : array, shape (136, 3)

    Returns
    -------
    array, shape (n_groups, 3)
        Mean over the group's keypoints.
    """
    offsets_m = np.full((len(GROUPS), 3), np.nan)
    for row, group in enumerate(GROUPS.values()):
        for names in (group, mirror("halpe136")[group]):
            for person, sure in zip(points_m[:, names], is_sure[:, names], strict=True):
                if sure.any():
                    off_m = (person - truth_m[group])[sure].mean(axis=0)
                    least_m = np.nan_to_num(np.linalg.norm(offsets_m[row]), nan=ELSEWHERE_M)
                    if np.linalg.norm(off_m) < least_m:
                        offsets_m[row] = off_m
    return offsets_m


@dataclass(frozen=True, eq=False)
class ErrorModel:
    """The estimates of `fit`, a row per group of `GROUPS`.

    Attributes
    ----------
    found_share : array, shape (n_groups, 2, 2)
        By whether it is visible, and whether it was found in the image before.
    bias_m : array, shape (n_groups, 3)
    lasting_m2, passing_m2 : array, shape (n_groups, 3, 3)
        Covariances between people, and from image to image.
    burst_images : float
        Average number of consecutive images without any detection of a person.
    """

    found_share: np.ndarray
    bias_m: np.ndarray
    lasting_m2: np.ndarray
    passing_m2: np.ndarray
    burst_images: float


def fit(sightings: pd.DataFrame) -> ErrorModel:
    """The model of one detector.

    Parameters
    ----------
    sightings : pd.DataFrame
        A row per image and group, in the order of time within a `run`: columns `run, group, in_sight` and the
        group's offset `x_m, y_m, z_m` (NaN: lost).

    Returns
    -------
    ErrorModel
    """
    table = sightings.assign(found=sightings["x_m"].notna())
    table["before"] = table.groupby(["run", "group"])["found"].shift(fill_value=False)
    shares, biases, lasting, passing = [], [], [], []
    for group in GROUPS:
        rows = table[table["group"] == group]
        n = rows.groupby(["in_sight", "before"])["found"].agg(["sum", "count"])
        n = n.reindex(pd.MultiIndex.from_product([(False, True)] * 2), fill_value=0)
        # Half a case of either kind, so that unobserved cases are not impossible.
        shares.append(((n["sum"] + 0.5 * rows["found"].mean()) / (n["count"] + 0.5)).to_numpy().reshape(2, 2))
        found = rows[rows["found"]]
        means = found.groupby("run")[_OFFSETS].transform("mean")
        biases.append(found[_OFFSETS].mean().fillna(0.0))
        lasting.append(_covariance(means))
        passing.append(_covariance(found[_OFFSETS] - means))
    lost = ~table.groupby(["run", "image"], sort=False)["found"].any()
    starts = lost & ~lost.groupby("run").shift(fill_value=False)
    burst = lost.sum() / max(starts.sum(), 1)
    offsets = np.array(biases), np.array(lasting), np.array(passing)
    return ErrorModel(np.array(shares), *offsets, max(float(burst), 1.0))


def _covariance(offsets_m: pd.DataFrame) -> np.ndarray:
    return np.cov(offsets_m.to_numpy(), rowvar=False) if len(offsets_m) > 1 else np.zeros((3, 3))


def modelled(model: ErrorModel, rng: np.random.Generator) -> Perceive:
    """A `Perceive` with a model's errors.

    The errors include those of the robot's joint readings.

    Parameters
    ----------
    model : ErrorModel
    rng : numpy.random.Generator
        For all random numbers.

    Returns
    -------
    callable
    """

    def draw_m(covariances_m2: np.ndarray) -> np.ndarray:
        return np.array([rng.multivariate_normal(np.zeros(3), c) for c in covariances_m2])

    is_found, lasting_m = np.zeros(len(GROUPS), bool), model.bias_m + draw_m(model.lasting_m2)

    def perceive(moment: Moment, posture: Posture, read: Posture) -> Perception:
        nonlocal is_found
        seen, rows = in_sight(moment, posture).astype(int), np.arange(len(GROUPS))
        is_found = rng.random(len(GROUPS)) < model.found_share[rows, seen, is_found.astype(int)]
        off_m = lasting_m + draw_m(model.passing_m2)
        truth_m = in_root(moment.person.keypoints_m)
        points_m, scores = np.full((1, N_KEYPOINTS, 3), np.nan), np.zeros((1, N_KEYPOINTS))
        for row in np.flatnonzero(is_found):
            group = [*GROUPS.values()][row]
            points_m[0, group], scores[0, group] = truth_m[group] + off_m[row], 1.0
        return Perception(moment.time_s, points_m, scores)

    return perceive


def lossy(whole: Perceive, lost_share: float, burst_images: float, rng: np.random.Generator) -> Perceive:
    """A `Perceive` that loses images of another one in bursts: in those, nobody is found.

    Parameters
    ----------
    whole : callable
        The other one.
    lost_share : float
        Of all images, below 1.
    burst_images : float
        Average number in a row; more if the share requires it.
    rng : numpy.random.Generator

    Returns
    -------
    callable
    """
    odds = lost_share / (1 - lost_share)
    ends, will_lose = 1 / max(burst_images, odds, 1.0), rng.random() < lost_share

    def perceive(moment: Moment, posture: Posture, read: Posture) -> Perception:
        nonlocal will_lose
        seen = whole(moment, posture, read)
        is_lost, will_lose = will_lose, rng.random() < (1 - ends if will_lose else odds * ends)
        return Perception(moment.time_s, seen.keypoints_m[:0], seen.scores[:0]) if is_lost else seen

    return perceive

"""Draw the robot's poses of the stability test: 100 per view, into data/relative_poses.csv.

    python tools/draw_relative_poses.py

Torso and neck are sampled uniformly within the ranges below, which are within the robot's software limits. A
pose is kept if the camera sees what the view requires of any person in the chair; arms and hands are not
considered, and may leave the image. The poses are then paired, each followed by the remaining one with the
nearest camera, so that the few poses of one person include nearly equal ones. Run once: results refer to the
file as it is.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.files import write_bytes
from hicp_lib.evaluation.space.sightings import NEAR_M, NEAR_RAD
from hicp_lib.experiments.laboratory import robot_camera
from hicp_lib.experiments.recordings.seated_person import VIEWS
from hicp_lib.robot.kinematics import HEAD_JOINTS, load_icub
from hicp_lib.simulation.rendering.camera import project_world

N_POSES = 100
SEED = 2022
MARGIN_PX = 12.0  # what has to be in view keeps this far from the image's border
_TORSO_DEG = {"torso_pitch": (-8, 12), "torso_roll": (-8, 8), "torso_yaw": (-18, 18)}
RANGES_DEG = {
    "upper": _TORSO_DEG | {"neck_pitch": (-16, 4), "neck_roll": (-12, 12), "neck_yaw": (-18, 18)},
    "lower": _TORSO_DEG | {"neck_pitch": (4, 22), "neck_roll": (-12, 12), "neck_yaw": (-18, 18)},
}
_HEAD_M = [(0.0, 0.95, 1.2)]
_SHOULDERS_M = [(-0.2, 1.1, 1.0), (0.2, 1.1, 1.0)]
_WAIST_M = [(-0.2, 1.05, 0.75), (0.2, 1.05, 0.75)]
# Points of the room, metres, that have to be in the image, and that must not: where the head and the trunk of
# somebody in the chair are.
FRAMING = {"upper": ([*_HEAD_M, *_SHOULDERS_M, *_WAIST_M], []), "lower": (_WAIST_M, _HEAD_M)}


def main() -> None:
    icub, rng = load_icub(limits="software"), np.random.default_rng(SEED)
    rows = [(view, *pose) for view in VIEWS for pose in in_pairs(icub, view, draw(icub, view, rng))]
    table = pd.DataFrame(rows, columns=["view", *(f"{joint}_deg" for joint in HEAD_JOINTS)])
    table.insert(1, "number", table.groupby("view").cumcount())
    write_bytes(DATA_DIR / "relative_poses.csv", table.to_csv(index=False).encode())


def draw(icub, view: str, rng: np.random.Generator) -> list[np.ndarray]:
    """Poses of a view, degrees, to a tenth."""
    low, high = np.array([RANGES_DEG[view][joint] for joint in HEAD_JOINTS], float).T
    limits_deg = np.degrees(icub.chains["head"].limits_rad)
    assert (low >= limits_deg[:, 0] - 1e-9).all() and (high <= limits_deg[:, 1] + 1e-9).all(), limits_deg
    poses, n_drawn = [], 0
    while len(poses) < N_POSES:
        n_drawn += 1
        pose = rng.uniform(low, high).round(1)
        if is_framed(icub.T_root_camera(np.radians(pose), VIEWS[view]), *FRAMING[view]):
            poses.append(pose)
    print(f"{view}: {N_POSES} of {n_drawn} drawn poses are framed")
    return poses


def is_framed(T_root_camera: np.ndarray, wanted_m: list, unwanted_m: list) -> bool:
    """Whether the wanted points are well inside the image, and the unwanted ones outside."""
    camera = robot_camera(T_root_camera)
    pixels_px = project_world(camera, np.array([*wanted_m, *unwanted_m]))[0]
    size, n = np.array([camera.width_px, camera.height_px]), len(wanted_m)
    well_inside = ((pixels_px > MARGIN_PX) & (pixels_px < size - MARGIN_PX)).all(axis=1)
    return bool(well_inside[:n].all() and not camera.contains(pixels_px[n:]).any())


def in_pairs(icub, view: str, poses: list[np.ndarray]) -> list[np.ndarray]:
    """The same poses, the nearest to each of every second behind it."""
    T_root_camera = icub.T_root_camera(np.radians(poses), VIEWS[view])
    left, ordered = list(range(len(poses))), []
    while left:
        first = left.pop(0)
        turns = T_root_camera[left, :3, :3]
        cosines = (np.einsum("ab,iab->i", T_root_camera[first, :3, :3], turns) - 1) / 2
        apart_m = np.linalg.norm(T_root_camera[left, :3, 3] - T_root_camera[first, :3, 3], axis=1)
        apart = np.maximum(apart_m / NEAR_M, np.arccos(np.clip(cosines, -1, 1)) / NEAR_RAD)
        ordered += [first, left.pop(int(apart.argmin()))]
    return [poses[k] for k in ordered]


if __name__ == "__main__":
    main()

"""Draw the robot's poses of the stability test: 100 per view, into data/relative_poses.csv.

    python tools/draw_relative_poses.py

Torso and neck are drawn evenly within the ranges below, which lie within the software limits of the
robot; a pose is kept if a development person (seed 0) is framed as the view asks. Run once: results refer to
the file as it is.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.files import write_bytes
from hicp_lib.core.keypoints import HANDS, INDEX
from hicp_lib.experiments.laboratory import robot_camera
from hicp_lib.experiments.recordings.seated_person import VIEWS, seated_person
from hicp_lib.robot.kinematics import HEAD_JOINTS, load_icub
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.rendering.camera import project_world

N_POSES = 100
SEED = 2022
MARGIN_PX = 12.0  # what has to be in view keeps this far from the image's border
_TORSO_DEG = {"torso_pitch": (-8, 12), "torso_roll": (-8, 8), "torso_yaw": (-18, 18)}
RANGES_DEG = {
    "upper": _TORSO_DEG | {"neck_pitch": (-16, 4), "neck_roll": (-12, 12), "neck_yaw": (-18, 18)},
    "lower": _TORSO_DEG | {"neck_pitch": (4, 22), "neck_roll": (-12, 12), "neck_yaw": (-18, 18)},
}
_ARMS = [INDEX[f"{side}_{joint}"] for side in ("left", "right") for joint in ("elbow", "wrist")]
_HEAD = [INDEX[name] for name in ("nose", "left_eye", "right_eye")]
# Which keypoints have to be in the image, and which must not.
FRAMING = {
    "upper": ([*_HEAD, *_ARMS, INDEX["left_shoulder"], INDEX["right_shoulder"]], []),
    "lower": ([*_ARMS, *HANDS], _HEAD),
}


def main() -> None:
    icub, rng = load_icub(limits="software"), np.random.default_rng(SEED)
    rows = [(view, *pose) for view in VIEWS for pose in draw(icub, view, rng)]
    table = pd.DataFrame(rows, columns=["view", *(f"{joint}_deg" for joint in HEAD_JOINTS)])
    table.insert(1, "number", table.groupby("view").cumcount())
    write_bytes(DATA_DIR / "relative_poses.csv", table.to_csv(index=False).encode())


def draw(icub, view: str, rng: np.random.Generator) -> list[np.ndarray]:
    """Poses of a view, degrees, to a tenth."""
    points_m = seated_person(Subject(split="development"))[1].keypoints_m
    low, high = np.array([RANGES_DEG[view][joint] for joint in HEAD_JOINTS], float).T
    limits_deg = np.degrees(icub.chains["head"].limits_rad)
    assert (low >= limits_deg[:, 0] - 1e-9).all() and (high <= limits_deg[:, 1] + 1e-9).all(), limits_deg
    poses, n_drawn = [], 0
    while len(poses) < N_POSES:
        n_drawn += 1
        pose = rng.uniform(low, high).round(1)
        if is_framed(icub.T_root_camera(np.radians(pose), VIEWS[view]), points_m, *FRAMING[view]):
            poses.append(pose)
    print(f"{view}: {N_POSES} of {n_drawn} drawn poses frame the person")
    return poses


def is_framed(
    T_root_camera: np.ndarray, points_m: np.ndarray, wanted: list[int], unwanted: list[int]
) -> bool:
    """Whether the wanted keypoints are well inside the image, and the unwanted ones outside."""
    camera = robot_camera(T_root_camera)
    pixels_px = project_world(camera, points_m)[0]
    size = np.array([camera.width_px, camera.height_px])
    well_inside = ((pixels_px > MARGIN_PX) & (pixels_px < size - MARGIN_PX)).all(axis=1)
    return bool(well_inside[wanted].all() and not camera.contains(pixels_px[unwanted]).any())


if __name__ == "__main__":
    main()

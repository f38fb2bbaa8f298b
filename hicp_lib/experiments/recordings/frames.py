"""Frames of a simulated recording, and its further files: ground truth, joints, settings, lists."""

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.camera import project, transform
from hicp_lib.core.files import read_json, write_json, write_table
from hicp_lib.core.keypoints import NAMES
from hicp_lib.experiments.laboratory import COLOUR, colour_and_depth, in_root, robot_camera
from hicp_lib.experiments.recordings.scenarios import Scenario, scenario
from hicp_lib.recordings.recording import EXACT_DEPTH_DIR, JOINTS_FILE, SIMULATION_FILE, TRUTH_FILE
from hicp_lib.recordings.writer import depth_name, rgb_name, write_index
from hicp_lib.robot.kinematics import HEAD_JOINTS, load_icub
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.rendering.camera import PlacedCamera
from hicp_lib.simulation.rendering.render import render
from hicp_lib.simulation.world.visibility import keypoint_visibility


def record_frame(name: str, subject: Subject, k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, dict]:
    """One frame of a scenario.

    Parameters
    ----------
    name : str
        Of the scenario; with another depth camera the colour image is the same.
    subject : Subject
    k : int
        The frame's number is `k`.

    Returns
    -------
    rgb : array, shape (480, 640, 3), dtype uint8
    depth_m, exact_m : array, shape (480, 640), dtype float32
        As measured by the depth camera, and without errors.
    truth : dict of str to list
        `keypoints_m` (136, 3) in the base frame and `visible` (136,).
    """
    plan, rng = scenario(name, subject.number), subject.stream(name.partition("@")[0], k)
    world, person = plan.stage(subject, float(plan.times_s(k + 1)[k]))
    camera = camera_at(plan, k)
    frame = render(world, camera)
    rgb, depth_m = colour_and_depth(frame, camera, rng, plan.depth_camera)
    _, visible = keypoint_visibility(frame.rays, camera, person.keypoints_m, 0)
    truth = {"keypoints_m": in_root(person.keypoints_m).round(6).tolist(), "visible": visible.tolist()}
    return rgb, depth_m, frame.depth_m, truth


def camera_at(plan: Scenario, k: int) -> PlacedCamera:
    """The colour camera at frame `k`."""
    (T_root_camera,) = load_icub().T_root_camera(plan.head_rad(k + 1)[k:], plan.mount)
    return robot_camera(T_root_camera)


def camera_poses(plan: Scenario, n: int) -> np.ndarray:
    """T_base_cam (n, 4, 4) of the first `n` frames."""
    return load_icub().T_root_camera(plan.head_rad(n), plan.mount)


PARTS_DIR = ".frames"  # ground truth of finished frames, and their settings
MOCAP_PART = "mocap.json"
DEPTH_UNITS_PER_M = 1000.0
START_S = 100.0  # the camera's clock at the first frame: clocks rarely start together


def files_of(out: Path, k: int) -> list[Path]:
    """All files of frame `k`: that of its truth, written last, then images."""
    depth = out / depth_name(k)
    return [out / PARTS_DIR / f"{k:06d}.json", out / rgb_name(k), depth, out / EXACT_DEPTH_DIR / depth.name]


def finish_recording(out: Path, plan: Scenario, n: int, stamp: dict) -> None:
    """Write everything but the frames of a recording.

    Parameters
    ----------
    out : Path
        Its folder.
    plan : Scenario
    n : int
        Number of frames.
    stamp : dict
        Settings of the frames.
    """
    times_s, T_base_cam = START_S + plan.times_s(n), camera_poses(plan, n)
    write_table(out / TRUTH_FILE, _truth(out, times_s, T_base_cam))
    write_table(out / JOINTS_FILE, _joints(plan, times_s))
    settings = {"n_frames": n, "rate_hz": plan.rate_hz, "mount": plan.mount}
    settings["depth_camera"] = asdict(plan.depth_camera)
    mocap = out / PARTS_DIR / MOCAP_PART
    known = read_json(mocap) if mocap.exists() else {}
    settings |= {name: value for name, value in known.items() if name != "sha256"}
    write_json(out / SIMULATION_FILE, stamp | settings, indent=1)
    write_index(out, COLOUR, DEPTH_UNITS_PER_M, times_s, (times_s, T_base_cam))


def _truth(out: Path, times_s: np.ndarray, T_base_cam: np.ndarray) -> pd.DataFrame:
    parts = [read_json(files_of(out, k)[0]) for k in range(len(times_s))]
    points_m = np.array([part["keypoints_m"] for part in parts])
    pixels_px = project(COLOUR, transform(np.linalg.inv(T_base_cam), points_m))
    frame = np.repeat(np.arange(len(parts)), len(NAMES))
    columns = {"frame": frame, "t_s": times_s[frame], "keypoint": np.tile(NAMES, len(parts))}
    columns |= dict(zip(("x_m", "y_m", "z_m"), points_m.reshape(-1, 3).T, strict=True))
    columns |= dict(zip(("u_px", "v_px"), pixels_px.reshape(-1, 2).T, strict=True))
    return pd.DataFrame(columns | {"visible": np.concatenate([part["visible"] for part in parts])})


def _joints(plan: Scenario, times_s: np.ndarray) -> pd.DataFrame:
    angles_rad = plan.head_rad(len(times_s))
    columns = {"frame": np.arange(len(times_s)), "t_s": times_s}
    names = (f"{joint}_rad" for joint in HEAD_JOINTS)
    return pd.DataFrame(columns | dict(zip(names, angles_rad.T, strict=True)))

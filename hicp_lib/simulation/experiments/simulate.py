"""Simulating recordings: what the robot's camera, its joints and motion capture would have recorded.

Frame k depends on scenario, seed and k only, so the number of processes changes nothing, and a
longer recording begins with the shorter one.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from dataclasses import asdict
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from tqdm import tqdm

from hicp_lib.errors import InputError
from hicp_lib.files import atomic_path, read_json, write_json
from hicp_lib.keypoints import NAMES
from hicp_lib.provenance import DATA_DIR, LIBRARY_DIR, files_sha256
from hicp_lib.rgbd.camera import project, transform
from hicp_lib.rgbd.recording import (
    EXACT_DEPTH_DIR,
    JOINTS_FILE,
    RGB_LIST,
    SIMULATION_FILE,
    TRUTH_FILE,
    Recording,
    open_recording,
)
from hicp_lib.rgbd.recording_writer import depth_name, rgb_name, write_depth, write_index, write_rgb
from hicp_lib.robot.kinematics import HEAD_JOINTS
from hicp_lib.simulation.experiments.frames import camera_poses, record_frame
from hicp_lib.simulation.experiments.laboratory import COLOUR
from hicp_lib.simulation.experiments.scenarios import Scenario, scenario
from hicp_lib.simulation.scenes import worker_pool
from hicp_lib.simulation.sensors.depth_camera import D435

DEPTH_UNITS_PER_M = 1000.0
START_S = 100.0  # what the camera's clock shows at the first frame: clocks never start together
_PARTS_DIR = ".frames"  # truth of finished frames, and what they were made with
# Besides the renderer: what decides what a simulated recording holds.
_LIBRARY_PATTERNS = (
    "simulation/**/*.py", "robot/kinematics.py", "robot/tables.py", "keypoints.py",
    "rgbd/camera.py", "rgbd/tum.py", "rgbd/recording*.py", "rgbd/qualisys.py", "rgbd/c3d.py",
)  # fmt: skip
_DATA_PATTERNS = ("body*", "icub.json", "relative_poses.csv")


def simulate_recording(
    out: str | Path,
    name: str,
    n_frames: int | None = None,
    seed: int = 0,
    workers: int | None = None,
    progress: bool = True,
) -> Recording:
    """Simulate a recording into a folder; finished frames of an interrupted run are kept.

    Parameters
    ----------
    name : "relative-upper", "relative-lower" or "mocap"
    n_frames : the scenario's own number when left out
    seed : non-negative; who is there, in what room, how they move, and all noise
    workers : processes; as many as there are processors when left out

    Raises
    ------
    InputError
        For an unknown scenario, numbers out of range, or a folder that holds something else.
    """
    out, plan = Path(out), scenario(name)
    n = plan.n_frames if n_frames is None else n_frames
    _check(out, plan, n, seed, workers)
    stamp = {"scenario": name, "seed": int(seed), "version": simulation_version()}
    _prepare(out, stamp)
    todo = [(str(out), name, int(seed), k) for k in range(n) if not _part_path(out, k).exists()]
    bar = tqdm(total=n, initial=n - len(todo), desc=name, unit="frame", disable=None if progress else True)
    for _ in _in_processes(todo, workers or os.cpu_count() or 1):
        bar.update()
    bar.close()
    _finish(out, plan, n, stamp)
    return open_recording(out)


@cache
def simulation_version() -> str:
    """SHA-256 over everything that decides what a simulated recording holds."""
    library = [path for pattern in _LIBRARY_PATTERNS for path in LIBRARY_DIR.glob(pattern)]
    data = [path for pattern in _DATA_PATTERNS for path in DATA_DIR.glob(pattern)]
    return files_sha256([*library, *data], LIBRARY_DIR.parent)


def _check(out: Path, plan: Scenario, n: int, seed: int, workers: int | None) -> None:
    limits = {
        "n_frames": (n, 1, plan.max_frames),
        "seed": (seed, 0, 2**32),
        "workers": (1 if workers is None else workers, 1, 1000),
    }
    for what, (value, low, high) in limits.items():
        if not isinstance(value, int | np.integer) or not low <= value <= high:
            raise InputError(f"{what} is {value!r}; {plan.name} takes a whole number from {low} to {high}")
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: is a file; give a folder for the recording")
    if out.is_dir() and any(out.iterdir()) and not (out / _PARTS_DIR).is_dir():
        raise InputError(f"{out}: holds files that were not simulated; give an empty or new folder")


def _prepare(out: Path, stamp: dict) -> None:
    """No recording until it is finished; drop what another scenario, seed or version left."""
    (out / RGB_LIST).unlink(missing_ok=True)
    stamp_file = out / _PARTS_DIR / "stamp.json"
    if stamp_file.exists() and read_json(stamp_file) == stamp:
        return
    for folder in ("rgb", "depth", EXACT_DEPTH_DIR, _PARTS_DIR):
        shutil.rmtree(out / folder, ignore_errors=True)
    write_json(stamp_file, stamp)


def _part_path(out: Path, k: int) -> Path:
    return out / _PARTS_DIR / f"{k:06d}.json"


def _in_processes(todo: list, workers: int) -> Iterator[None]:
    if workers == 1 or len(todo) < 2:
        yield from map(_record_one, todo)
        return
    with worker_pool(min(workers, len(todo))) as pool:
        yield from pool.imap_unordered(_record_one, todo, chunksize=2)


def _record_one(job: tuple[str, str, int, int]) -> None:
    """Write the images of a frame, then its truth: a frame counts as finished when that is there."""
    out, name, seed, k = Path(job[0]), *job[1:]
    rgb, depth_m, exact_m, truth = record_frame(name, seed, k)
    write_rgb(out / rgb_name(k), rgb)
    write_depth(out / depth_name(k), depth_m, DEPTH_UNITS_PER_M)
    exact = out / EXACT_DEPTH_DIR / Path(depth_name(k)).name
    write_depth(exact, exact_m, DEPTH_UNITS_PER_M)
    write_json(_part_path(out, k), truth)


def _finish(out: Path, plan: Scenario, n: int, stamp: dict) -> None:
    """Everything but the frames, then the lists that make it a recording."""
    times_s, T_base_cam = START_S + plan.times_s(n), camera_poses(plan, n)
    for path in [*(out / "rgb").iterdir(), *(out / "depth").iterdir(), *(out / EXACT_DEPTH_DIR).iterdir()]:
        if int(path.stem) >= n:
            path.unlink()
            _part_path(out, int(path.stem)).unlink(missing_ok=True)
    _write_table(out / TRUTH_FILE, _truth(out, times_s, T_base_cam))
    joints = pd.DataFrame(plan.head_rad(n), columns=[f"{joint}_rad" for joint in HEAD_JOINTS])
    joints.insert(0, "frame", np.arange(n))
    joints.insert(1, "t_s", times_s)
    _write_table(out / JOINTS_FILE, joints)
    settings = {
        "n_frames": int(n),
        "rate_hz": plan.rate_hz,
        "mount": plan.mount,
        "depth_camera": asdict(D435),
    }
    write_json(out / SIMULATION_FILE, stamp | settings, indent=1)
    write_index(out, COLOUR, DEPTH_UNITS_PER_M, times_s, T_base_cam)


def _truth(out: Path, times_s: np.ndarray, T_base_cam: np.ndarray) -> pd.DataFrame:
    parts = [read_json(_part_path(out, k)) for k in range(len(times_s))]
    points_m = np.array([part["keypoints_m"] for part in parts])
    pixels_px = project(COLOUR, transform(np.linalg.inv(T_base_cam), points_m))
    n_keypoints = len(NAMES)
    frame = np.repeat(np.arange(len(parts)), n_keypoints)
    columns = {"frame": frame, "t_s": times_s[frame], "keypoint": np.tile(NAMES, len(parts))}
    columns |= dict(zip(("x_m", "y_m", "z_m"), points_m.reshape(-1, 3).T, strict=True))
    columns |= dict(zip(("u_px", "v_px"), pixels_px.reshape(-1, 2).T, strict=True))
    return pd.DataFrame(columns | {"visible": np.concatenate([part["visible"] for part in parts])})


def _write_table(path: Path, table: pd.DataFrame) -> None:
    with atomic_path(path) as temporary:
        table.to_parquet(temporary, index=False)

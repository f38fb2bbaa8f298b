"""Simulating recordings: what the robot's camera, its joints and motion capture would have recorded.

Frame k depends on scenario, subject and k only, so the number of processes changes nothing, and a
longer recording begins with the shorter one.
"""

from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from tqdm import tqdm

from hicp_lib.core.cache import key
from hicp_lib.core.camera import project, transform
from hicp_lib.core.executor import Workers, resolved, run_jobs
from hicp_lib.core.files import read_json, write_json, write_table
from hicp_lib.core.keypoints import NAMES
from hicp_lib.experiments.laboratory import COLOUR, T_WORLD_ROOT, colour_and_depth, in_root, robot_camera
from hicp_lib.experiments.recordings.scenarios import Scenario, scenario
from hicp_lib.recordings import recording as rec
from hicp_lib.recordings.c3d import MAX_FRAMES as MAX_C3D_FRAMES
from hicp_lib.recordings.qualisys import write_c3d, write_tsv
from hicp_lib.recordings.writer import depth_name, write_depth, write_frame, write_index
from hicp_lib.robot.kinematics import HEAD_JOINTS, load_icub
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.rendering.camera import PlacedCamera
from hicp_lib.simulation.rendering.render import render
from hicp_lib.simulation.world.batch import check_numbers, check_output, keep_parts
from hicp_lib.simulation.world.visibility import keypoint_visibility

_MOCAP_FILES = (rec.MOCAP_FILE, str(Path(rec.MOCAP_FILE).with_suffix(".c3d")))
PARTS_DIR = ".frames"  # truth of finished frames, and what they were made with
MOCAP_PART = "mocap.json"
DEPTH_UNITS_PER_M = 1000.0
START_S = 100.0  # what the camera's clock shows at the first frame: clocks seldom start together


def simulate_recording(
    out: str | Path,
    name: str,
    n_frames: int | None = None,
    subject: Subject = Subject(),
    workers: Workers = None,
    progress: bool = True,
) -> rec.Recording:
    """Simulate a recording into a folder; finished frames of an interrupted run are kept.

    Parameters
    ----------
    out : str or Path
    name : str
        "relative-upper", "relative-lower" or "mocap".
    n_frames : int, optional
        The scenario's own number when left out.
    subject : Subject, optional
        Who is there, in what room, how they move, and all noise.
    workers : int or str, optional
        Processes, or the address of a Dask scheduler (`hicp_lib.core.executor.resolved`).
    progress : bool, optional
        Whether a terminal is shown a bar.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        For an unknown scenario, numbers out of range, or a folder that holds something else.
    """
    out, plan = Path(out), scenario(name, subject.number)
    n = plan.n_frames if n_frames is None else n_frames
    workers = resolved(workers)
    check_numbers(n_frames=(n, 1, plan.max_frames))
    check_output(out, PARTS_DIR, "for the recording", "simulated")
    (out / rec.RGB_LIST).unlink(missing_ok=True)  # it is no recording until it is finished
    who = {"subject": asdict(subject), "identity": asdict(subject.identity)}
    stamp = {"scenario": name, **who, "version": key([simulate_recording])}
    keep_parts(out, PARTS_DIR, stamp, ["rgb/*", "depth/*", f"{rec.EXACT_DEPTH_DIR}/*", *_MOCAP_FILES])
    missing = [k for k in range(n) if not part_path(out, k).exists()]
    one = partial(record_one, name=name, subject=subject)
    todo: list[tuple[str, Callable]]
    todo = [(str(part_path(Path(), k)), partial(one, k=k)) for k in missing]
    if plan.capture is not None and not _is_captured(out, n):  # the longest first
        capture = partial(_capture_all, name=name, subject=subject, n=int(n))
        todo.insert(0, (str(Path(PARTS_DIR, MOCAP_PART)), capture))
    done = run_jobs(todo, workers, folder=out)
    for _ in tqdm(done, name, len(todo), unit="frame", disable=not progress or None):
        pass
    finish_recording(out, plan, int(n), stamp)
    return rec.open_recording(out)


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
        As the depth camera measures it, and as it is.
    truth : dict of str to list
        `keypoints_m` (136, 3) in the base frame and `visible` (136,).
    """
    plan, rng = scenario(name, subject.number), subject.stream(name.partition("@")[0], k)
    world, person = plan.stage(subject, float(plan.times_s(k + 1)[k]))
    camera = camera_at(plan, k)
    frame = render(world, camera, rng)
    rgb, depth_m = colour_and_depth(frame, camera, rng, plan.depth_camera)
    _, visible = keypoint_visibility(frame.rays, camera, person.keypoints_m, 0)
    truth = {"keypoints_m": in_root(person.keypoints_m).round(6).tolist(), "visible": visible.tolist()}
    return rgb, depth_m, frame.depth_m, truth


def camera_at(plan: Scenario, k: int) -> PlacedCamera:
    """The colour camera as frame `k` is taken."""
    (T_root_camera,) = load_icub().T_root_camera(plan.head_rad(k + 1)[k:], plan.mount)
    return robot_camera(T_root_camera)


def camera_poses(plan: Scenario, n: int) -> np.ndarray:
    """T_base_cam (n, 4, 4) of the first `n` frames."""
    return load_icub().T_root_camera(plan.head_rad(n), plan.mount)


def record_one(out: Path, name: str, subject: Subject, k: int) -> None:
    """Write the images of a frame, then its truth: a frame counts as finished when that is there.

    Parameters
    ----------
    out : Path
        Folder of the recording.
    name : str
        Of the scenario.
    subject : Subject
    k : int
        The frame's number is `k`.
    """
    rgb, depth_m, exact_m, truth = record_frame(name, subject, k)
    write_frame(out, k, rgb, depth_m, DEPTH_UNITS_PER_M)
    write_depth(out / rec.EXACT_DEPTH_DIR / Path(depth_name(k)).name, exact_m, DEPTH_UNITS_PER_M)
    write_json(part_path(out, k), truth)


def _is_captured(out: Path, n: int) -> bool:
    part = out / PARTS_DIR / MOCAP_PART
    return part.exists() and read_json(part)["n_frames"] == n


def _capture_all(out: Path, name: str, subject: Subject, n: int) -> None:
    """Write motion capture of `n`"""
    part, plan = out / PARTS_DIR / MOCAP_PART, scenario(name)
    if plan.capture is None:
        return
    T_world_camera = T_WORLD_ROOT @ camera_poses(plan, 1)[0]
    exported, T_mocap_world, lead_s = plan.capture(subject, float(plan.times_s(n)[-1]), T_world_camera)
    tsv, c3d = (out / name for name in _MOCAP_FILES)
    write_tsv(tsv, exported)
    if len(exported.times_s) < MAX_C3D_FRAMES:  # a longer one is in the TSV file alone
        write_c3d(c3d, exported)
    T_base_mocap = np.linalg.inv(T_mocap_world @ T_WORLD_ROOT).tolist()
    write_json(part, {"n_frames": n, "T_base_mocap": T_base_mocap, "mocap_offset_s": START_S - lead_s})


def part_path(out: Path, k: int) -> Path:
    """File of the truth of frame `k`; written last, so a frame with it is finished."""
    return out / PARTS_DIR / f"{k:06d}.json"


def finish_recording(out: Path, plan: Scenario, n: int, stamp: dict) -> None:
    """Write all but the frames of a recording, and drop frames beyond.

    Parameters
    ----------
    out : Path
        Its folder.
    plan : Scenario
    n : int
        How many frames it has.
    stamp : dict
        What the frames were made with.
    """
    times_s, T_base_cam = START_S + plan.times_s(n), camera_poses(plan, n)
    for folder in ("rgb", "depth", rec.EXACT_DEPTH_DIR):
        for path in (out / folder).iterdir():
            if path.stem.isdigit() and int(path.stem) >= n:
                part_path(out, int(path.stem)).unlink(missing_ok=True)
                path.unlink()
    write_table(out / rec.TRUTH_FILE, _truth(out, times_s, T_base_cam))
    write_table(out / rec.JOINTS_FILE, _joints(plan, times_s))
    settings = {"n_frames": n, "rate_hz": plan.rate_hz, "mount": plan.mount}
    settings["depth_camera"] = asdict(plan.depth_camera)
    mocap = out / PARTS_DIR / MOCAP_PART
    settings |= read_json(mocap) if mocap.exists() else {}
    write_json(out / rec.SIMULATION_FILE, stamp | settings, indent=1)
    write_index(out, COLOUR, DEPTH_UNITS_PER_M, times_s, (times_s, T_base_cam))


def _truth(out: Path, times_s: np.ndarray, T_base_cam: np.ndarray) -> pd.DataFrame:
    parts = [read_json(part_path(out, k)) for k in range(len(times_s))]
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

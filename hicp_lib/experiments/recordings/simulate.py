"""Simulate recordings of the robot's camera, its joints and motion capture.

Frame k depends on scenario, subject and k only, so the number of processes does not matter, and a longer
recording starts with the shorter one.
"""

from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np
from tqdm import tqdm

from hicp_lib.core.cache import key
from hicp_lib.core.executor import Workers, resolved, run_jobs
from hicp_lib.core.folders import locked_folder
from hicp_lib.experiments.laboratory import T_WORLD_ROOT
from hicp_lib.experiments.recordings import frames
from hicp_lib.experiments.recordings.frames import camera_poses, record_frame
from hicp_lib.experiments.recordings.scenarios import scenario
from hicp_lib.recordings.c3d import MAX_FRAMES as MAX_C3D_FRAMES
from hicp_lib.recordings.c3d import write_c3d
from hicp_lib.recordings.qualisys import write_tsv
from hicp_lib.recordings.recording import EXACT_DEPTH_DIR, MOCAP_FILE, RGB_LIST, Recording, open_recording
from hicp_lib.recordings.writer import depth_name, write_depth, write_frame
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.world.batch import check_numbers, keep_parts, read_part, write_part


def simulate_recording(
    out: str | Path,
    name: str,
    n_frames: int | None = None,
    subject: Subject = Subject(),
    workers: Workers = None,
    progress: bool = True,
) -> Recording:
    """Simulate a recording into a folder; finished frames of an interrupted run are kept.

    Parameters
    ----------
    out : str or Path
    name : str
        "relative-upper", "relative-lower" or "mocap".
    n_frames : int, optional
        By default the scenario's own number.
    subject : Subject, optional
        Determines person, room, motion and noise.
    workers : int or str, optional
        Processes, or the address of a Dask scheduler (`hicp_lib.core.executor.resolved`).
    progress : bool, optional
        Whether to show a bar on a terminal.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        For an unknown scenario, numbers out of range, or a folder that holds something else or is being
        filled.
    """
    out, plan = Path(out), scenario(name, subject.number)
    n = plan.n_frames if n_frames is None else n_frames
    workers = resolved(workers)
    check_numbers(n_frames=(n, 1, plan.max_frames))
    with locked_folder(out):
        who = {"subject": asdict(subject), "identity": asdict(subject.identity)}
        stamp = {"scenario": name, **who, "version": key([simulate_recording])}
        once = [] if plan.capture is None else list(map(str, _mocap_files(Path())))
        keep_parts(out, frames.PARTS_DIR, RGB_LIST, stamp, int(n), partial(frames.files_of, out), once)
        missing = [k for k in range(n) if read_part(*frames.files_of(out, k)) is None]
        one = partial(record_one, name=name, subject=subject)
        todo: list[tuple[str, Callable]]
        todo = [(str(frames.files_of(Path(), k)[0]), partial(one, k=k)) for k in missing]
        if plan.capture is not None and not _is_captured(out, n):  # the longest first
            capture = partial(_capture_all, name=name, subject=subject, n=int(n))
            todo.insert(0, (str(_mocap_files(Path())[0]), capture))
        done = run_jobs(todo, workers, folder=out)
        for _ in tqdm(done, name, len(todo), unit="frame", disable=not progress or None):
            pass
        frames.finish_recording(out, plan, int(n), stamp)
    return open_recording(out)


def record_one(out: Path, name: str, subject: Subject, k: int) -> None:
    """Write the images of a frame, then its ground truth, which marks the frame as finished.

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
    write_frame(out, k, rgb, depth_m, frames.DEPTH_UNITS_PER_M)
    write_depth(out / EXACT_DEPTH_DIR / Path(depth_name(k)).name, exact_m, frames.DEPTH_UNITS_PER_M)
    write_part(truth, *frames.files_of(out, k))


def _mocap_files(out: Path) -> list[Path]:
    """The file that marks motion capture as finished, and its files."""
    c3d = Path(MOCAP_FILE).with_suffix(".c3d")
    return [out / frames.PARTS_DIR / frames.MOCAP_PART, out / MOCAP_FILE, out / c3d]


def _is_captured(out: Path, n: int) -> bool:
    part = read_part(*_mocap_files(out)[:2])
    return part is not None and part["n_frames"] == n


def _capture_all(out: Path, name: str, subject: Subject, n: int) -> None:
    """Write motion capture of `n` frames."""
    (part, tsv, c3d), plan = _mocap_files(out), scenario(name)
    if plan.capture is None:
        return
    T_world_camera = T_WORLD_ROOT @ camera_poses(plan, 1)[0]
    exported, T_mocap_world, lead_s = plan.capture(subject, float(plan.times_s(n)[-1]), T_world_camera)
    write_tsv(tsv, exported)
    if len(exported.times_s) < MAX_C3D_FRAMES:  # a longer one is only in the TSV file
        write_c3d(c3d, exported)
    T_base_mocap = np.linalg.inv(T_mocap_world @ T_WORLD_ROOT).tolist()
    known = {"n_frames": n, "T_base_mocap": T_base_mocap, "mocap_offset_s": frames.START_S - lead_s}
    write_part(known, part, tsv)

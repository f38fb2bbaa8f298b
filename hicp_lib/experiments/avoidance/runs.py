"""Runs of the closed loop, one per script and condition: simulated in parallel, kept in the cache.

A run is kept under a key of all it depends on: trial, condition, delay, the detector's settings and
weights, and the code and data of simulation, lifting, robot and detectors.
"""

from __future__ import annotations

import math
import multiprocessing
import os
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from multiprocessing.managers import SyncManager
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from hicp_lib.core.cache import key
from hicp_lib.core.detections import Detections, Detector
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import atomic_path, cache_dir
from hicp_lib.core.keypoints import N_KEYPOINTS
from hicp_lib.detectors.registry import make_detector
from hicp_lib.detectors.runtime.results import identity
from hicp_lib.experiments.avoidance.closed_loop import Trial, TrueKeypoints, simulate
from hicp_lib.experiments.avoidance.head_camera import Album, DetectorEyes, Sight
from hicp_lib.experiments.avoidance.reaching import in_root, script
from hicp_lib.robot.controller import PUBLISHED
from hicp_lib.simulation.batch import worker_pool

NO_AVOIDANCE, TRUE_KEYPOINTS = "no avoidance", "ground truth"
PUBLISHED_GAINS = "ground truth, published gains"
IDEAL = (NO_AVOIDANCE, TRUE_KEYPOINTS, PUBLISHED_GAINS)
"""Conditions without a detector; every other condition is a detector's name."""

_SHOWN_PX = (320, 240)  # kept images are for looking at


@dataclass(frozen=True)
class Job:
    """One run: `condition` is one of `IDEAL` or a detector's name.

    `delay_s` is stated, from the image to when the loop knows: one that is measured would differ by machine
    and by run, and all that is simulated with it.

    Raises
    ------
    InputError
        If the delay is no number of seconds.
    """

    trial: Trial
    condition: str
    delay_s: float = 0.0

    def __post_init__(self) -> None:
        if not (isinstance(self.delay_s, (int, float)) and 0 <= self.delay_s < math.inf):
            raise InputError(f"delay of {self.condition!r} is {self.delay_s!r}; expected seconds, 0 or more")


@dataclass(frozen=True, eq=False)
class Run:
    """What happened in a run.

    Attributes
    ----------
    job : what was run
    cycles : a row per control period, see `closed_loop.simulate`
    frames : a row per image: `t_s`, `time_ms` (what detector and lifting took, measured), `jpeg` (bytes),
        and as flat lists `keypoints_px`, `scores` and `keypoints_m` (root frame) of all people, and
        `truth_m` of the one there is
    """

    job: Job
    cycles: pd.DataFrame
    frames: pd.DataFrame


def run_all(jobs: Iterable[Job]) -> list[Run]:
    """The runs of all jobs, in their order; what is not in the cache is simulated on all cores."""
    jobs = list(jobs)
    folders = {job: _folder(job) for job in jobs}
    missing = [job for job, folder in folders.items() if not (folder / "cycles.parquet").is_file()]
    # The longest first, so that no core is left with one at the end: detectors, the fastest see most.
    missing.sort(key=lambda job: (job.condition in IDEAL, job.delay_s))
    if len(missing) > 1:
        with worker_pool(min(len(missing), os.cpu_count() or 1)) as pool, _manager() as manager:
            album = manager.dict()
            pool.starmap(_simulate_and_keep, [(job, folders[job], album) for job in missing], chunksize=1)
    elif missing:
        _simulate_and_keep(missing[0], folders[missing[0]], {})
    return [_read(job, folders[job]) for job in jobs]


def of_condition(runs: Iterable[Run], condition: str) -> list[Run]:
    """The runs of one condition, a script each."""
    return [run for run in runs if run.job.condition == condition]


def choose(runs: Iterable[Run], name: str, condition: str) -> Run:
    """The run of a script under a condition; the first of the condition if the script was not run.

    Raises
    ------
    InputError
        If there is no run of the condition.
    """
    found = sorted(of_condition(runs, condition), key=lambda run: run.job.trial.script != name)
    if not found:
        raise InputError(f"no run of {condition!r}; add it to the detectors")
    return found[0]


def image(frame: pd.Series) -> tuple[np.ndarray, Detections]:
    """The picture of a row of `Run.frames`, RGB uint8, and what was detected, in the picture's pixels."""
    bgr = cv2.imdecode(np.frombuffer(frame["jpeg"], np.uint8), cv2.IMREAD_COLOR)
    keypoints_px = (_array(frame["keypoints_px"], 2) + 0.5) * (_SHOWN_PX[0] / 640) - 0.5
    scores = _array(frame["scores"], 1)[..., 0]
    return np.ascontiguousarray(bgr[..., ::-1]), Detections(keypoints_px, scores, np.ones(len(scores)))


def keypoints_m(frame: pd.Series) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What was perceived (p, 136, 3) and its scores (p, 136), and the truth (136, 3), in the root frame."""
    return (
        _array(frame["keypoints_m"], 3),
        _array(frame["scores"], 1)[..., 0],
        _array(frame["truth_m"], 3)[0],
    )


def _manager() -> SyncManager:
    """Holds what processes share."""
    return multiprocessing.get_context("spawn").Manager()


def _simulate_and_keep(job: Job, folder: Path, album: Album) -> None:
    settings = {"settings": PUBLISHED} if job.condition == PUBLISHED_GAINS else {}
    sights: list[Sight] = []
    if job.condition in IDEAL:
        cycles = simulate(job.trial, TrueKeypoints(), avoids=job.condition != NO_AVOIDANCE, **settings)
    else:
        eyes = DetectorEyes(_detector(job.condition), job.delay_s, job.trial.seed, album)
        cycles, sights = simulate(job.trial, eyes), eyes.sights
    scene = script(job.trial.script, job.trial.seed)
    rows = [_frame(sight, in_root(scene.person_at(sight.perception.time_s).keypoints_m)) for sight in sights]
    _write(folder / "frames.parquet", pd.DataFrame(rows))
    _write(folder / "cycles.parquet", cycles)


def _frame(sight: Sight, truth_m: np.ndarray) -> dict:
    small = cv2.resize(sight.rgb, _SHOWN_PX, interpolation=cv2.INTER_AREA)
    _, jpeg = cv2.imencode(".jpg", np.ascontiguousarray(small[..., ::-1]), [cv2.IMWRITE_JPEG_QUALITY, 88])
    seen = sight.perception
    arrays = {
        "keypoints_px": sight.detections.keypoints_px,
        "scores": seen.scores,
        "keypoints_m": seen.keypoints_m,
        "truth_m": truth_m,
    }
    flat = {name: np.asarray(array, np.float32).ravel().tolist() for name, array in arrays.items()}
    return {"t_s": seen.time_s, "time_ms": sight.time_ms, "jpeg": jpeg.tobytes()} | flat


def _array(flat: np.ndarray, width: int) -> np.ndarray:
    return np.asarray(flat, float).reshape(-1, N_KEYPOINTS, width)


def _folder(job: Job) -> Path:
    known = {} if job.condition in IDEAL else _identity(job.condition)
    # Of the detectors only the one that looks has a say, and its identity says which.
    result_key = key([run_all], without=[make_detector.__module__], job=job, detector=known)
    return cache_dir() / "avoidance" / result_key[:24]


@cache
def _detector(name: str) -> Detector:
    """Made once in every process."""
    return make_detector(name)


@cache
def _identity(name: str) -> dict:
    return identity(_detector(name))


def _read(job: Job, folder: Path) -> Run:
    return Run(job, *(pd.read_parquet(folder / f"{name}.parquet") for name in ("cycles", "frames")))


def _write(path: Path, table: pd.DataFrame) -> None:
    with atomic_path(path) as temporary:
        table.to_parquet(temporary, index=False)

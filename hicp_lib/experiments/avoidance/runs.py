"""Runs of the closed loop, one per script and condition: simulated in parallel, cached.

A run is cached under a key of everything it depends on: trial, condition, latency, the detector's settings
and weights, and the code and data of simulation, lifting, robot and detectors.
"""

import multiprocessing
from collections.abc import Iterable
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from hicp_lib.core.cache import code_identity, key
from hicp_lib.core.children import safe_start
from hicp_lib.core.detections import Detections, Detector
from hicp_lib.core.errors import InputError
from hicp_lib.core.executor import resolved, run_jobs
from hicp_lib.core.files import cache_dir, write_table
from hicp_lib.core.images import decode_image
from hicp_lib.core.keypoints import N_KEYPOINTS
from hicp_lib.detectors.registry import make_detector
from hicp_lib.detectors.runtime.results import identity
from hicp_lib.experiments.avoidance import closed_loop as loop
from hicp_lib.experiments.avoidance.closed_loop import Latency, Trial
from hicp_lib.experiments.avoidance.error_model import in_sight
from hicp_lib.experiments.avoidance.head_camera import HeadCamera, ImageCache, Observation
from hicp_lib.experiments.avoidance.reaching import Moment
from hicp_lib.experiments.laboratory import COLOUR, in_root
from hicp_lib.robot.controller import PUBLISHED

NO_AVOIDANCE, TRUE_KEYPOINTS = "no avoidance", "ground truth"
IDEAL = (NO_AVOIDANCE, TRUE_KEYPOINTS)
"""Conditions without a detector; all others start with a detector's name."""
TRACKING = ", tracking"
"""Suffix of MediaPipe's name: each image is searched near the person's position in the one before."""
PUBLISHED_GAINS = ", published gains"
"""Suffix of a condition with the controller's published gains, instead of the project's own."""

_TABLES = ("cycles.parquet", "frames.parquet")
_SHOWN_PX = (320, 240)  # cached images are only for display
_JPEG_QUALITY = 88
_KEY_LENGTH = 24  # of a run's folder


@dataclass(frozen=True)
class Job:
    """One run.

    Attributes
    ----------
    trial : Trial
    condition : str
        One of `IDEAL` or a detector's name, with the suffixes `TRACKING` and `PUBLISHED_GAINS` if they apply.
    latency : Latency
        From the image to the loop.
    lifting : str
        Lifting method of detected keypoints, "robust" or "paper".
    """

    trial: Trial
    condition: str
    latency: Latency = Latency()
    lifting: str = "robust"

    @property
    def detector(self) -> str:
        """The condition without the suffix of the gains."""
        return self.condition.removesuffix(PUBLISHED_GAINS)

    @property
    def gains(self) -> str:
        """Name of the controller's gains."""
        return "published" if self.condition.endswith(PUBLISHED_GAINS) else "ours"


@dataclass(frozen=True, eq=False)
class Run:
    """Results of a run.

    Attributes
    ----------
    job : Job
        The job.
    cycles : pd.DataFrame
        A row per two control periods, see `closed_loop.simulate`.
    frames : pd.DataFrame
        A row per image: `t_s`, `time_ms` (measured time of detector and lifting), `jpeg` (bytes),
        and as flat lists `keypoints_px`, `scores` and `keypoints_m` (root frame) of all people,
        `truth_m` of the simulated person, and which of `error_model.GROUPS` were visible (`in_sight`).
    """

    job: Job
    cycles: pd.DataFrame
    frames: pd.DataFrame


def run_all(jobs: Iterable[Job]) -> list[Run]:
    """The runs of all jobs, in their order; runs that are not cached are simulated on all cores."""
    jobs, out = list(jobs), cache_dir() / "avoidance"
    folders = {job: out / _run_key(job) for job in jobs}
    missing = [job for job, folder in folders.items() if not (folder / _TABLES[0]).is_file()]
    # The longest first, to balance the load: detectors, of which the fastest process most images.
    missing.sort(key=lambda job: (job.detector in IDEAL, job.latency.inference_s))
    workers = resolved(None)
    is_shared = isinstance(workers, int) and len(missing) > 1
    with safe_start():
        shared = multiprocessing.get_context("spawn").Manager() if is_shared else nullcontext()
    with shared as manager:
        images = manager.dict() if manager else {}  # shared by the processes of this machine
        todo = {job: partial(_simulate, run=folders[job].name, job=job, images=images) for job in missing}
        named = [(f"{folders[job].name}/{_TABLES[0]}", call) for job, call in todo.items()]
        known = partial(_known, *sorted({job.detector for job in missing}))
        list(run_jobs(named, workers, folder=out, alike=known))
    return [Run(job, *(pd.read_parquet(folders[job] / name) for name in _TABLES)) for job in jobs]


def choose(runs: Iterable[Run], name: str, condition: str) -> Run:
    """The run of a script under a condition; the first of the condition if the script was not run.

    Parameters
    ----------
    runs : iterable of Run
    name : str
        Of the script.
    condition : str

    Returns
    -------
    Run

    Raises
    ------
    InputError
        If there is no run of the condition.
    """
    with_it = [run for run in runs if run.job.condition == condition]
    found = sorted(with_it, key=lambda run: run.job.trial.script != name)
    if not found:
        raise InputError(f"no run of {condition!r}; add it to the detectors")
    return found[0]


def image(frame: pd.Series) -> tuple[np.ndarray, Detections]:
    """The picture of a row of `Run.frames`, RGB uint8, and what was detected, in the picture's pixels."""
    keypoints_px = (_array(frame["keypoints_px"], 2) + 0.5) * (_SHOWN_PX[0] / COLOUR.width_px) - 0.5
    scores = _array(frame["scores"], 1)[..., 0]
    rgb = decode_image(frame["jpeg"], _TABLES[1])
    return rgb, Detections(keypoints_px, scores, np.ones(len(scores)))


def keypoints_m(frame: pd.Series) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Perceived keypoints (p, 136, 3) with scores (p, 136), and the truth (136, 3), in the root frame."""
    perceived_m, scores, (truth_m,) = (
        _array(frame[name], width) for name, width in (("keypoints_m", 3), ("scores", 1), ("truth_m", 3))
    )
    return perceived_m, scores[..., 0], truth_m


def moment_at(run: Run, time_s: float) -> Moment:
    """The moment of a run at a time; the person's position depends on the robot's motion."""
    row = run.cycles.iloc[int((run.cycles["t_s"] - time_s).abs().argmin())]
    hand_m = tuple(float(row[column]) for column in loop.HAND_COLUMNS)
    return Moment(run.job.trial.script, run.job.trial.subject, float(time_s), hand_m)


def _simulate(out: Path, run: str, job: Job, images: ImageCache) -> None:
    """Simulate a run and write its tables; it counts as finished when the first of them exists."""
    camera = None if job.detector in IDEAL else HeadCamera(_detector(job), job.lifting, images)
    perceive, avoids = camera.perceive if camera else loop.true_keypoints, job.detector != NO_AVOIDANCE
    settings = PUBLISHED if job.gains == "published" else None
    cycles = loop.simulate(job.trial, perceive, job.latency, avoids, settings)
    frames = pd.DataFrame([_frame(seen) for seen in camera.observations] if camera else [])
    for name, table in zip(reversed(_TABLES), (frames, cycles), strict=True):
        write_table(out / run / name, table)


def _frame(seen: Observation) -> dict:
    small = cv2.resize(seen.rgb, _SHOWN_PX, interpolation=cv2.INTER_AREA)
    options = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY]
    _, jpeg = cv2.imencode(".jpg", np.ascontiguousarray(small[..., ::-1]), options)
    arrays = {
        "keypoints_px": seen.detections.keypoints_px,
        "scores": seen.perception.scores,
        "keypoints_m": seen.perception.keypoints_m,
        "truth_m": in_root(seen.moment.person.keypoints_m),
        "in_sight": in_sight(seen.moment, seen.posture),
    }
    flat = {name: np.asarray(array, np.float32).ravel().tolist() for name, array in arrays.items()}
    return {"t_s": seen.perception.time_s, "time_ms": seen.time_ms, "jpeg": jpeg.tobytes()} | flat


def _array(flat: np.ndarray, width: int) -> np.ndarray:
    return np.asarray(flat, float).reshape(-1, N_KEYPOINTS, width)


def _run_key(job: Job) -> str:
    known = {} if job.detector in IDEAL else identity(_detector(job))
    # Only the used detector influences the run, and its identity is part of the key.
    return key([run_all], without=[make_detector.__module__], job=job, detector=known)[:_KEY_LENGTH]


def _known(*conditions: str) -> dict:
    """What runs under some conditions depend on, on this machine; a detector's tracking is in the code."""
    names = {condition.removesuffix(TRACKING) for condition in conditions} - {*IDEAL}
    return code_identity(__name__) | {name: identity(_kept_detector(name)) for name in sorted(names)}


def _detector(job: Job) -> Detector:
    """Made once per process; a tracking one is new for each run, which starts without a person."""
    if not job.detector.endswith(TRACKING):
        return _kept_detector(job.detector)
    every_s = loop.between_s(job.trial, job.latency)
    return make_detector(job.detector.removesuffix(TRACKING), tracking_hz=float(1 / every_s))


_kept_detector = cache(make_detector)

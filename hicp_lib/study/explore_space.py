"""What readers play in space: runs of avoidance, and lifted keypoints frame by frame.

Functions return what those of `hicp_lib.study.explore` do. A film is a script with its frames (a picture,
people found in it, bodies in space) and, where the robot moves, its steps. Places in space are whole
millimetres in the robot's base frame.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from PIL import Image

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import BODY, HANDS, N_KEYPOINTS, NAMES
from hicp_lib.evaluation.space.stability import position_array
from hicp_lib.experiments.avoidance.closed_loop import start_posture
from hicp_lib.experiments.avoidance.runs import Run, image
from hicp_lib.recordings.recording import Recording, read_rgb, read_truth
from hicp_lib.robot.kinematics import ARM_JOINTS, load_icub
from hicp_lib.robot.segments import body_segments
from hicp_lib.robot.skin import read_skin
from hicp_lib.study.avoidance import sure_keypoints
from hicp_lib.study.explore import Explored, flat, spread, styles, webp
from hicp_lib.study.page import as_script

_COLUMNS = 8  # of the sheet of a film's pictures
_WIDTH_PX = 240
TRUTH, _PERCEIVED = "truth", "perceived"
_THREATENED = 0.05  # activation from which a taxel is drawn
_STEP_S = 0.1
_FACELESS = np.isin(np.arange(N_KEYPOINTS), np.r_[BODY, HANDS]).astype(float)


def runs(chosen: Iterable[Run], n_people: int = 4) -> Explored:
    """Runs of avoidance: the person as they are and as perceived, the robot and its threatened taxels.

    Parameters
    ----------
    chosen : iterable of Run
        Those without images are left out.
    n_people : int, optional
        Of each script, at most.

    Returns
    -------
    dict of str to object
    dict of str to bytes
    """
    films: list[dict[str, Any]] = []
    files: dict[str, bytes] = {}
    people: dict[str, dict[int, int]] = {}
    for run in (run for run in chosen if len(run.frames)):
        name, trial = f"film-{len(films)}", run.job.trial
        numbers = people.setdefault(trial.script, {})
        person = numbers.setdefault(trial.subject.number, len(numbers) + 1)
        if person > n_people:
            continue
        films.append({"script": trial.script, "person": person, "detector": run.job.condition})
        frames = [(frame, image(frame)) for _, frame in run.frames.iterrows()]
        every = max(1, round(_STEP_S / run.cycles["t_s"].diff().median()))
        steps = [_step(cycle) for _, cycle in run.cycles.iloc[::every].iterrows()]
        files[f"{name}.js"] = as_script({"frames": [_seen(*of) for of in frames], "steps": steps})
        files[f"{name}.webp"] = _sheet([rgb for _, (rgb, _) in frames])
    radii_mm = [round(1000 * segment.radius_m) for segment in body_segments(load_icub(), start_posture())]
    return _films(films, [_PERCEIVED]) | {"radii": radii_mm}, files


def lifted(
    recording: Recording, found: Mapping[str, Sequence[Detections]], points: pd.DataFrame, n_frames: int = 48
) -> Explored:
    """Keypoints of a recording by each method of lifting, a film per detector.

    Parameters
    ----------
    recording : Recording
    found : mapping of str to sequence of Detections
        By detector, in every frame.
    points : pd.DataFrame
        As from `hicp_lib.lifting.table.lift_found`; the person with the best score is shown.
    n_frames : int, optional
        At most, evenly over the recording.

    Returns
    -------
    dict of str to object
    dict of str to bytes
    """
    frames, truth = spread(range(len(recording)), n_frames), read_truth(recording)
    true = {} if truth is None else {TRUTH: truth}
    times_s = (recording.times_s - recording.times_s[0]).round(3).tolist()
    films: list[dict[str, Any]] = []
    files = {"sheet.webp": _sheet([read_rgb(recording, frame) for frame in frames])}
    best = points[points["person"] == 0]
    for detector, seen in found.items():
        tables = dict(iter(best[best["detector"] == detector].groupby("method", sort=False))) | true
        places_m = {name: position_array(rows, NAMES, len(recording)) for name, rows in tables.items()}
        told = [
            {"t_s": times_s[frame], "found": _in_picture(seen[frame], recording.intrinsics.width_px)}
            | {"bodies": {name: _body(of[frame]) for name, of in places_m.items()}}
            for frame in frames
        ]
        files[f"film-{len(films)}.js"] = as_script({"frames": told})
        films.append({"detector": detector, "sheet": "sheet.webp"})
    return _films(films, list(best["method"].unique())), files


def _films(films: list[dict[str, Any]], bodies: Sequence[str]) -> dict[str, Any]:
    listed = [{"file": f"film-{k}.js", "sheet": f"film-{k}.webp"} | film for k, film in enumerate(films)]
    shown = {"films": listed, "bodies": bodies, "columns": _COLUMNS}
    return styles(film["detector"] for film in films) | shown


def _seen(frame: pd.Series, picture: tuple[np.ndarray, Detections]) -> dict[str, Any]:
    (rgb, found), (points_m, is_sure, truth_m) = picture, sure_keypoints(frame)
    bodies = {TRUTH: _body(truth_m), _PERCEIVED: flat(1000 * points_m, is_sure.astype(float), 0)}
    return {"t_s": round(frame["t_s"], 3), "found": _in_picture(found, rgb.shape[1]), "bodies": bodies}


def _step(cycle: pd.Series) -> dict[str, Any]:
    posture = start_posture().moved("left", np.array([cycle[f"{joint}_rad"] for joint in ARM_JOINTS]))
    ends_m = np.array([(part.start_m, part.end_m) for part in body_segments(load_icub(), posture)])
    activations = np.asarray(cycle["activations"])[None]
    threats = np.where(activations > _THREATENED, activations, 0)
    taxels = flat(1000 * read_skin().in_root(load_icub(), posture)[0][None], threats, 0)
    told = cycle[["t_s", "distance_m", "activation"]].astype(float).round(3).to_dict()
    return told | {"robot": (1000 * ends_m).round().astype(int).reshape(-1, 6), "taxels": taxels}


def _body(places_m: np.ndarray) -> list[list[float]]:
    return flat(1000 * places_m[None], _FACELESS[None], 0)


def _in_picture(found: Detections, width_px: int) -> list[list[float]]:
    return flat((found.keypoints_px + 0.5) * _WIDTH_PX / width_px, found.scores)


def _sheet(pictures: Sequence[np.ndarray]) -> bytes:
    """Pictures made small, in rows of `_COLUMNS`."""
    height_px, width_px = pictures[0].shape[:2]
    size = _WIDTH_PX, round(height_px / width_px * _WIDTH_PX)
    sheet = Image.new("RGB", (_COLUMNS * size[0], -(-len(pictures) // _COLUMNS) * size[1]))
    for k, picture in enumerate(pictures):
        small = Image.fromarray(picture).resize(size, Image.Resampling.LANCZOS)
        sheet.paste(small, (k % _COLUMNS * size[0], k // _COLUMNS * size[1]))
    return webp(sheet)

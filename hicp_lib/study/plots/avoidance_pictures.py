"""Pictures of a run: what the camera sees, above what an onlooker sees.

A taxel is the darker red and the larger the more it is threatened; those behind something shine through.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from hicp_lib.core.camera import transform
from hicp_lib.experiments.avoidance.closed_loop import start_posture
from hicp_lib.experiments.avoidance.head_camera import CAMERA, onlooker_view, robot_surfaces
from hicp_lib.experiments.avoidance.reaching import LEAVES_S, NEAR_S
from hicp_lib.experiments.avoidance.runs import Run, image, moment_at
from hicp_lib.experiments.laboratory import T_WORLD_ROOT
from hicp_lib.inspection.skeletons import draw_people
from hicp_lib.robot.kinematics import ARM_JOINTS, load_icub
from hicp_lib.robot.skin import read_skin
from hicp_lib.simulation.rendering.camera import project_world
from hicp_lib.study.avoidance import SURE, sure_keypoints
from hicp_lib.study.plots.avoidance import condition_colour
from hicp_lib.study.plots.people import picture_grid
from hicp_lib.study.plots.style import COLUMN_IN, Figure, in_style, new_figure, texts

_THREATENED = 0.05  # activation from which a taxel is drawn
_MOST = 0.5  # activation of the darkest


@in_style
def filmstrip(run: Run, times_s: Sequence[float], note: str) -> Figure:
    """Some moments of a run, one column each: the camera's picture, and an onlooker's.

    Parameters
    ----------
    run : Run
    times_s : sequence of float
        Of the moments.
    note : str
        What the data are, for the caption.
    """
    figure, axes = new_figure(2, len(times_s), COLUMN_IN, 0.9 + 9.6 / len(times_s), squeeze=False)
    for (above, below), time_s in zip(axes.T, times_s, strict=True):
        _draw_moment(above, below, run, time_s)
    told = {"script": run.job.trial.script, "condition": run.job.condition, "n": len(times_s), "note": note}
    return Figure(figure, *texts("filmstrip", **told, nearest_cm=100 * run.cycles["distance_m"].min()))


def nearest_views(runs: Sequence[Run], note: str) -> Figure:
    """The image each detector last took half-way through the time the person is near: a row per script.

    Parameters
    ----------
    runs : sequence of Run
        Those without images are left out.
    note : str
        What the data are, for the caption.
    """
    shown: dict[str, dict[str, np.ndarray]] = {}
    for run in runs:
        past = run.frames[run.frames["t_s"] <= (NEAR_S + LEAVES_S[0]) / 2] if len(run.frames) else run.frames
        if len(past):
            shown.setdefault(run.job.trial.script, {})[run.job.condition] = _drawn(run, past.iloc[-1])
    detectors = list(dict.fromkeys(name for pictures in shown.values() for name in pictures))
    return picture_grid(
        [[pictures.get(name) for name in detectors] for pictures in shown.values()],
        *texts("nearest_views", scripts=list(shown), detectors=detectors, min_score=SURE, note=note),
        row_titles=list(shown),
        titles=detectors,
        cell_in=COLUMN_IN / max(len(detectors), 2),
    )


def _draw_moment(camera, space, run: Run, time_s: float) -> None:
    cycle = run.cycles.iloc[int(np.argmin(np.abs(run.cycles["t_s"] - time_s)))]
    past = run.frames[run.frames["t_s"] <= time_s + 1e-9]
    frame = past.iloc[-1] if len(past) else None
    camera.axis("off")
    camera.set_title(f"{time_s:.1f} s")
    if frame is not None:
        camera.imshow(_drawn(run, frame))
    _draw_space(space, run, cycle, frame)
    space.set_title(f"{100 * cycle['distance_m']:.0f} cm, a = {cycle['activation']:.2f}")


def _drawn(run: Run, frame: pd.Series) -> np.ndarray:
    rgb, found = image(frame)
    return draw_people(rgb, found.keypoints_px, found.scores, condition_colour(run.job.condition), SURE, 2.0)


def _draw_space(axis, run: Run, cycle: pd.Series, frame: pd.Series | None) -> None:
    posture = start_posture().moved("left", np.array([cycle[f"{joint}_rad"] for joint in ARM_JOINTS]))
    robot = robot_surfaces(load_icub(), posture, whole=True)
    axis.imshow(onlooker_view(moment_at(run, cycle["t_s"]).world([]), robot))
    activations = np.asarray(cycle["activations"])
    threatened = np.flatnonzero(activations > _THREATENED)
    threatened = threatened[np.argsort(activations[threatened])]
    shares = np.minimum(activations[threatened] / _MOST, 1)
    places_m, _ = read_skin().in_root(load_icub(), posture)
    style = {"cmap": "YlOrRd", "vmin": 0, "vmax": 1, "lw": 0.4, "edgecolors": "#3D0008"}
    axis.scatter(*_seen_px(places_m[threatened]), c=shares, s=6 + 22 * shares, zorder=3, **style)
    if frame is not None:
        points_m, is_sure, _ = sure_keypoints(frame)
        colour = condition_colour(run.job.condition)
        axis.scatter(*_seen_px(points_m[is_sure]), s=9, color=colour, lw=0.4, edgecolors="white", zorder=4)
    axis.set(xlim=(-0.5, CAMERA.width_px - 0.5), ylim=(CAMERA.height_px - 0.5, -0.5))
    axis.axis("off")


def _seen_px(points_m: np.ndarray) -> np.ndarray:
    """Points (n, 3) of the root frame in the onlooker's picture, (2, n)."""
    pixels_px, _ = project_world(CAMERA, transform(T_WORLD_ROOT, points_m))
    return pixels_px.T

"""Figures of avoidance: moments of runs, clearances of people, and against what is swept; separation's terms.

A taxel is the darker red and the larger the more it is threatened; those behind something shine through.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from hicp_lib.core.camera import transform
from hicp_lib.experiments.avoidance.closed_loop import start_posture
from hicp_lib.experiments.avoidance.head_camera import CAMERA, onlooker_view, robot_surfaces
from hicp_lib.experiments.avoidance.reaching import LEAVES_S, NEAR_S
from hicp_lib.experiments.avoidance.runs import IDEAL, NO_AVOIDANCE, Run, image, moment_at
from hicp_lib.experiments.laboratory import T_WORLD_ROOT
from hicp_lib.inspection.skeletons import draw_people
from hicp_lib.robot.kinematics import ARM_JOINTS, load_icub
from hicp_lib.robot.separation import Separation, separation_table
from hicp_lib.robot.skin import read_skin
from hicp_lib.simulation.rendering.camera import project_world
from hicp_lib.study.avoidance import FIELD_M, MARKS_M, SURE, UNTIL, clearance, over_people, sure_keypoints
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import detector_colour, detector_marker
from hicp_lib.study.plots.people import picture_grid
from hicp_lib.study.plots.style import COLUMN_IN, Figure, in_style, new_figure, texts

_GAINS = {"ours": "-", "published": "--"}
_SCRIPT_MARKERS = "os^Dv"
_THREATENED = 0.05  # activation from which a taxel is drawn
_MOST = 0.5  # activation of the darkest


def condition_colour(name: str) -> str:
    """Black shades for the conditions without a detector, the detector's own colour otherwise."""
    return "#111111" if name.startswith(IDEAL) else detector_colour(name)


@in_style
def clearances(metrics: pd.DataFrame, note: str) -> Figure:
    """The least distance of every person in their first reach and in all, a row per condition.

    Parameters
    ----------
    metrics : pd.DataFrame
        As from `avoidance.metrics`.
    note : str
        What the data are, for the caption.
    """
    table, cases = clearance(metrics), metrics.groupby(["detector", "gains"], sort=False)
    conditions = [detector + f", {gains}" * (detector != NO_AVOIDANCE) for (detector, gains), _ in cases]
    height_in = 1.6 + 0.42 * len(conditions)
    figure, axes, panels = marks.panels(table, ["until"], COLUMN_IN, height_in, sharey=True, sharex=True)
    bar: dict[str, Any] = {"fmt": "|", "ms": 12, "mew": 2.5, "capsize": 0, "elinewidth": 2}
    for axis, means, until in panels:
        for place, ((detector, _), mine) in enumerate(cases):
            colour = condition_colour(detector)
            for script, marker in zip(mine["script"].unique(), _SCRIPT_MARKERS, strict=False):
                at_cm = 100 * mine.loc[mine["script"] == script, UNTIL[until]]
                pen = {"s": 22, "alpha": 0.45, "color": colour, "lw": 0, "marker": marker}
                axis.scatter(at_cm, [place + 0.18] * len(at_cm), label=None if place else script, **pen)
            marks.dots(axis, means.iloc[[place]], place - 0.15, factor=100, color=colour, **bar)
        for mark_m in MARKS_M:
            axis.axvline(100 * mark_m, color="#888888", lw=1, ls=":")
        axis.set(title=until, xlabel="least distance (cm)")
    marks.name_rows(axes[0, 0], conditions)
    marks.legend_below(figure, axes[0, 0])
    said = [f"{name} {100 * value:.1f}" for name, value in zip(conditions, table["value"], strict=False)]
    best = said[int(table["value"][: len(said)].argmax())] + " cm"
    return Figure(figure, *texts("clearances", note=note, means=said, best=best), table)


@in_style
def sweep_curves(sweeps: Mapping[str, pd.DataFrame], note: str) -> Figure:
    """Mean least distance against what was swept, with its interval over people: a panel each.

    Parameters
    ----------
    sweeps : mapping of str to DataFrame
        As from `sweeps.sweep`, by the column that was swept.
    note : str
        What the data are, for the caption.
    """
    labels = {"latency_s": ("latency (ms)", 1000), "lost_share": ("images lost (%)", 100)}
    labels["follow_m_s"] = ("the person's highest speed (cm/s)", 100)
    case = ["detector", "gains"]
    tables = {of: over_people(rows, [*case, of], "min_distance_m") for of, rows in sweeps.items()}
    table = pd.concat(tables, names=["swept"]).reset_index(level=0)
    figure, axes, panels = marks.panels(table, ["swept"], COLUMN_IN, 6.4, wrap=2, sharey=True)
    for axis, of_column, column in panels:
        label, factor = labels[column]
        for (detector, gains), rows in of_column.groupby(case, sort=False):
            colour, x = condition_colour(detector), factor * rows[column]
            options = {"color": colour, "ls": _GAINS[gains], "marker": detector_marker(detector)}
            axis.plot(x, 100 * rows["value"], label=f"{detector}, {gains}", **options)
            axis.fill_between(x, 100 * rows["low"], 100 * rows["high"], color=colour, alpha=0.1, lw=0)
        for mark_m in MARKS_M:
            axis.axhline(100 * mark_m, color="#888888", lw=1, ls=":")
        axis.set_xlabel(label)
    for axis in axes[:, 0]:
        axis.set(ylabel="least distance (cm)", ylim=(0, None))
    marks.legend_below(figure, axes)
    lines = table.assign(cm=100 * table["value"]).groupby(["swept", *case], sort=False)["cm"]
    ends = lines.agg(["first", "last"]).reset_index()
    ends = ends.assign(swept=[labels[of][0].rpartition(" (")[0] for of in ends["swept"]])
    most = ends.loc[[(ends["first"] - ends["last"]).idxmax()]]
    return Figure(figure, *texts("sweep_curves", note=note, ends=ends, most=most), table)


@in_style
def separation_terms(separations: Mapping[str, Separation], note: str) -> Figure:
    """The terms of the protective separation distance and their sum: a row each, a dot per detector."""
    table = separation_table(separations)
    rows = table.melt("term", var_name="detector", value_name="value")
    bare: dict[str, Any] = {"bounds": ("value",) * 3, "factor": 100, "ms": 6, "capsize": 0}
    pens = marks.detector_dots(separations)
    figure, ((axis,),), _ = marks.dot_chart(rows, "term", "detector", pens, COLUMN_IN, **bare)
    axis.axhline(len(table) - 1.5, color="#AAAAAA", lw=0.8)
    axis.axvline(100 * FIELD_M, color="#111111", lw=1, ls=":")
    axis.set(xlabel="share of the protective separation distance (cm)", xlim=(0, None))
    sums = [f"{name} {100 * separation.distance_m:.0f} cm" for name, separation in separations.items()]
    largest = rows[rows["term"] != "sum"].sort_values("value").drop_duplicates("detector", keep="last")
    told = {"note": note, "sums": sums, "field_cm": 100 * FIELD_M, "largest": largest}
    return Figure(figure, *texts("separation_terms", **told), table)


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
    told |= {
        "nearest_cm": 100 * run.cycles["distance_m"].min(),
        "away_cm": 100 * run.cycles["hand_error_m"].max(),
    }
    return Figure(figure, *texts("filmstrip", **told))


def nearest_views(runs: Sequence[Run], note: str) -> Figure:
    """The image each detector last took half-way through the time the person is near: a row per script.

    Parameters
    ----------
    runs : sequence of Run
        Those without images are left out.
    note : str
        What the data are, for the caption.
    """
    shown: dict[str, dict[str, tuple[Run, pd.Series]]] = {}
    for run in runs:
        past = run.frames[run.frames["t_s"] <= (NEAR_S + LEAVES_S[0]) / 2] if len(run.frames) else run.frames
        if len(past):
            shown.setdefault(run.job.trial.script, {})[run.job.condition] = run, past.iloc[-1]
    seen: dict[str, int] = {}
    for name, (_, frame) in (one for of_script in shown.values() for one in of_script.items()):
        seen[name] = seen.get(name, 0) + bool(image(frame)[1].scores.max(initial=0) >= SURE)
    rows = [[_drawn(*of[name]) if name in of else None for name in seen] for of in shown.values()]
    told = {"scripts": list(shown), "seen": pd.Series(seen), "min_score": SURE, "note": note}
    grid = rows, *texts("nearest_views", **told), list(shown), list(seen)
    return picture_grid(*grid, cell_in=COLUMN_IN / max(len(seen), 2))


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

"""Figures of avoidance: distance, activation and retreat over time, joints, and separation's terms."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from hicp_lib.experiments.avoidance.reaching import LEAVES_S, NEAR_S
from hicp_lib.experiments.avoidance.runs import IDEAL, NO_AVOIDANCE, PUBLISHED_GAINS, Run
from hicp_lib.experiments.avoidance.skin_distance import FAR_M
from hicp_lib.robot.kinematics import ARM_JOINTS
from hicp_lib.robot.separation import Separation, separation_table
from hicp_lib.study.avoidance import FIELD_M, WITHIN_M
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import detector_colour
from hicp_lib.study.plots.style import Figure, in_lines, in_style, in_words, new_figure

_STYLES = {NO_AVOIDANCE: ":", PUBLISHED_GAINS: "--"}
_ROWS = {"distance_m": "distance (cm)", "activation": "activation", "hand_error_m": "hand from post (cm)"}
_TERM_COLOURS = ("#0072B2", "#E69F00", "#D55E00", "#999999", "#009E73", "#CC79A7")
_ANGLES = [f"{joint}_rad" for joint in ARM_JOINTS]
_EVERY = 5  # control periods between rows of the tables


def condition_colour(name: str) -> str:
    """Black shades for the conditions without a detector, the detector's own colour otherwise."""
    return "#111111" if name in IDEAL else detector_colour(name)


@in_style
def over_time(runs: Sequence[Run], separations: Mapping[str, Separation], note: str) -> Figure:
    """Distance, highest activation and the hand's way over time: a column per script.

    Parameters
    ----------
    runs : sequence of Run
    separations : mapping of str to Separation
        By detector; drawn as dotted levels.
    note : str
        What the data are, for the caption.
    """
    by_script: dict[str, list[Run]] = {}
    for run in runs:
        by_script.setdefault(run.job.trial.script, []).append(run)
    size = {"width_in": 3.6 * len(by_script) + 0.6, "height_in": 7.2}
    figure, axes = new_figure(3, len(by_script), **size, sharex=True, sharey="row", squeeze=False)
    for column, (script, of_script) in zip(axes.T, by_script.items(), strict=True):
        column[0].set_title(script)
        _shade_near_phase(column)
        for run in of_script:
            _draw_run(column, run)
        for detector, separation in separations.items():
            level_cm = 100 * min(separation.distance_m, FAR_M)
            column[0].axhline(level_cm, color=condition_colour(detector), lw=1, ls=(0, (1, 2)))
        column[0].axhline(100 * FIELD_M, color="#888888", lw=0.8)
        column[-1].set_xlabel("time (s)")
    for axis, label in zip(axes[:, 0], _ROWS.values(), strict=True):
        axis.set_ylabel(label)
    axes[0, 0].set_ylim(0, 100 * FAR_M)
    marks.legend_below(figure, axes, ncols=2, fontsize=10)
    nearest: dict[str, list[str]] = {run.job.condition: [] for run in runs}
    for run in runs:
        nearest[run.job.condition].append(f"{100 * run.cycles['distance_m'].min():.1f}")
    return Figure(
        figure,
        "Distance between the person's skin and the robot, the highest activation of any taxel, and how far "
        "the hand is from its post. Grey: the person stays near; dotted levels: separation by ISO/TS 15066 "
        f"(not a safety function); grey line: {100 * FIELD_M:.0f} cm. Data: {note}.",
        "Lines over time, a column per script. Least distances in cm, in the order of the scripts: "
        + "; ".join(f"{name} {', '.join(values)}" for name, values in nearest.items()) + ".",
        _table(runs, [*_ROWS]),
    )  # fmt: skip


@in_style
def joint_motion(runs: Sequence[Run], note: str) -> Figure:
    """How far each joint turns from its rest: a panel per script, of one condition."""
    figure, axes = new_figure(1, len(runs), 3.6 * len(runs) + 0.6, 3.4, sharey=True, squeeze=False)
    turned_most = []
    for axis, run in zip(axes[0], runs, strict=True):
        angles_rad = run.cycles[_ANGLES].to_numpy()
        turned_deg = np.degrees(angles_rad - angles_rad[0])
        most = ARM_JOINTS[int(np.abs(turned_deg).max(axis=0).argmax())]
        turned_most.append(f"{most.replace('_', ' ')} ({run.job.trial.script})")
        _shade_near_phase([axis])
        for number, joint in enumerate(ARM_JOINTS):
            style = "--" if joint.startswith("torso") else "-"
            axis.plot(run.cycles["t_s"], turned_deg[:, number], style, lw=1.4, label=joint.replace("_", " "))
        axis.set(title=run.job.trial.script, xlabel="time (s)")
    axes[0, 0].set_ylabel("turned (degrees)")
    marks.legend_below(figure, axes, ncols=5, fontsize=10)
    return Figure(
        figure,
        "Joints of torso (dashed) and arm, from their angles at the post; "
        f"{runs[0].job.condition}. Data: {note}.",
        f"Lines over time. The joints that turn most: {in_words(turned_most)}.",
        _table(runs, _ANGLES),
    )  # fmt: skip


@in_style
def separation_terms(separations: Mapping[str, Separation], note: str) -> Figure:
    """The terms of the protective separation distance as stacked bars, one per detector."""
    figure, axis = new_figure(1, 1, 8.0, 1.2 + 0.6 * max(len(separations), 1))
    for place, separation in enumerate(separations.values()):
        start = 0.0
        for (term, value), colour in zip(separation.terms_m().items(), _TERM_COLOURS, strict=True):
            axis.barh(place, 100 * value, left=100 * start, color=colour, label=term if place == 0 else None)
            start += value
        axis.text(100 * start + 1, place, f"{100 * start:.0f} cm", va="center")
    axis.set_yticks(range(len(separations)), list(map(in_lines, separations)))
    axis.set_xlabel("protective separation distance (cm)")
    axis.margins(x=0.12)
    if separations:
        figure.legend(loc="outside lower center", ncols=2)
    sums = [f"{name} {100 * separation.distance_m:.0f} cm" for name, separation in separations.items()]
    return Figure(
        figure,
        "Terms of the separation that ISO 10218-2:2025 asks for; nothing here is a safety function. Data: "
        f"{note}.",
        f"Stacked bars: {in_words(sums)}.",
        separation_table(separations),
    )


def _draw_run(column, run: Run) -> None:
    name, t = run.job.condition, run.cycles["t_s"]
    for axis, what in zip(column, _ROWS, strict=True):
        scale = 100 if what.endswith("_m") else 1
        style, colour = _STYLES.get(name, "-"), condition_colour(name)
        axis.plot(t, scale * run.cycles[what], style, color=colour, lw=1.6, label=name)
    if name == NO_AVOIDANCE:
        for level in WITHIN_M:
            column[0].axhline(100 * level, color="#DDDDDD", lw=0.6)


def _shade_near_phase(axes) -> None:
    """Shade the time from when the person is as near as they go until they begin to leave."""
    for axis in axes:
        axis.axvspan(NEAR_S, LEAVES_S[0], color="#F0F0F0", lw=0)


def _table(runs: Sequence[Run], columns: list[str]) -> pd.DataFrame:
    parts = []
    for run in runs:
        about = {"script": run.job.trial.script, "detector": run.job.condition}
        parts.append(run.cycles.loc[::_EVERY, ["t_s", *columns]].assign(**about))
    return pd.concat(parts, ignore_index=True)[["script", "detector", "t_s", *columns]]

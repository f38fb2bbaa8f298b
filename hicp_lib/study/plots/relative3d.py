"""Figures of the relative 3D test: what the robot saw, median skeletons, stability, accuracy, causes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.ticker import LogLocator, NullLocator

from hicp_lib.core.detections import Detections
from hicp_lib.recordings.recording import Recording, read_rgb
from hicp_lib.study.plots.people import draw_people, picture_grid
from hicp_lib.study.plots.skeleton import BODY_LIMBS, HAND_LIMBS, limb_lines
from hicp_lib.study.plots.style import Figure, detector_colour, in_style, in_words, legend_entries, new_figure

TRUTH_COLOUR = "#111111"
_AXES = ("x_m", "y_m", "z_m")
# Seen by the robot, which looks along -x; the axis that is not drawn is the one looked along.
_LOOKS = {"as the robot looks": ("y_m", "z_m"), "from its left": ("x_m", "z_m"), "from above": ("y_m", "x_m")}
# Fewer images than this say little about a spread.
MIN_IMAGES = 5
_CAUSE_STYLES = (
    ("#888888", "o"), ("#0072B2", "s"), ("#D55E00", "^"),
    ("#009E73", "D"), ("#CC79A7", "v"), ("#111111", "*"),
)  # fmt: skip
_PART_MARKERS = {"shoulder": "^", "elbow": "s", "wrist": "o", "hand": "*"}


def camera_views(
    recordings: Mapping[str, Recording],
    found: Mapping[tuple[str, str], Sequence[Detections]],
    frames: Sequence[int],
    min_score: float,
    note: str,
) -> Figure:
    """Some frames of every view, as each detector sees them.

    Parameters
    ----------
    recordings : view -> recording
    found : (view, detector) -> detections of each frame
    frames : numbers of frames that every view has
    """
    rows = []
    for frame in frames:
        row = []
        for (view, detector), detections in found.items():
            people = detections[frame]
            colour = detector_colour(detector)
            image = read_rgb(recordings[view], frame)
            row.append(draw_people(image, people.keypoints_px, people.scores, colour, min_score))
        rows.append(row)
    seen = [
        f"{detector} {sum(len(detections[frame]) > 0 for frame in frames)} ({view})"
        for (view, detector), detections in found.items()
    ]
    return picture_grid(
        rows,
        row_titles=[f"image {frame}" for frame in frames],
        column_titles=[f"{view}\n{detector}" for view, detector in found],
        caption=f"Some images of every view, with keypoints of a score of at least {min_score}: {note}.",
        alt=f"{len(frames)} images per view and detector; with somebody found: {in_words(seen)}.",
        cell_in=min(3.2, 11 / len(found)),
    )


@in_style
def median_skeletons(medians: pd.DataFrame, truth: Mapping[str, pd.DataFrame] | None, note: str) -> Figure:
    """Median skeletons of every detector in the base frame, seen along its axes; dashed: the true one.

    Parameters
    ----------
    medians : table of `hicp_lib.evaluation.space.stability.median_positions`, one method
    truth : view -> table with `keypoint, x_m, y_m, z_m`; None where it is not known
    """
    fewest = min(MIN_IMAGES, medians["n"].max())
    medians = medians[medians["n"] >= fewest]
    views = list(dict.fromkeys(medians["view"]))
    figure, axes = new_figure(len(views), 3, 10.5, 3.1 * len(views) + 0.4, squeeze=False)
    limits = {name: (medians[name].min() - 0.05, medians[name].max() + 0.05) for name in _AXES}
    for row, view in zip(axes, views, strict=True):
        skeletons = dict(list(medians[medians["view"] == view].groupby("detector", sort=False)))
        lines = [(name, rows, detector_colour(name), "-") for name, rows in skeletons.items()]
        if truth is not None:
            lines.insert(0, ("truth", truth[view], TRUTH_COLOUR, "--"))
        for axis, (look, columns) in zip(row, _LOOKS.items(), strict=True):
            for name, rows, colour, style in lines:
                _draw_skeleton(axis, rows, columns, colour, style, name)
            axis.set(aspect="equal", title=f"{view} · {look}")
            axis.set(xlabel=f"{columns[0][0]} [m]", ylabel=f"{columns[1][0]} [m]")
            axis.set(xlim=limits[columns[0]], ylim=limits[columns[1]])
            axis.yaxis.set_inverted(columns[1] == "x_m")  # forward is up
    figure.legend(*legend_entries(axes), loc="outside lower center", ncols=4, fontsize=9)
    caption = (
        "Median skeletons: coordinate-wise median over the images of every keypoint that was found in at "
        f"least {fewest}, in the robot's base frame (x backward, y to its right, z up)"
        f"{'; dashed: the true skeleton' if truth is not None else ''}: {note}."
    )
    counts = medians.groupby(["detector", "view"], sort=False).size()
    said = in_words([f"{detector} {n} ({view})" for (detector, view), n in counts.items()])
    return Figure(
        figure, caption, f"Skeletons from three directions. Keypoints with a median: {said}.", medians
    )


def _draw_skeleton(axis, rows: pd.DataFrame, columns: tuple[str, str], colour, style, label) -> None:
    pen = {"color": colour, "linestyle": style, "alpha": 0.9}
    axis.plot(*limb_lines(rows, columns, BODY_LIMBS).T, lw=1.6, label=label, **pen)
    axis.plot(*limb_lines(rows, columns, HAND_LIMBS).T, lw=0.7, **pen)


@in_style
def spread_against_bias(table: pd.DataFrame, method: str, note: str) -> Figure:
    """How far apart the views are against how far off their median is, per part, detector and view.

    `table` from `hicp_lib.evaluation.space.stability.spread_and_bias` with truth, of which `method` is drawn.
    """
    table = table[table["method"] == method]
    table = table[table["n_images"] >= min(MIN_IMAGES, table["n_images"].max())]
    views = list(dict.fromkeys(table["view"]))
    figure, axes = new_figure(
        1, len(views), max(4.6 * len(views), 6), 4.9, sharex=True, sharey=True, squeeze=False
    )
    for view, axis in zip(views, axes[0], strict=True):
        for row in table[table["view"] == view].itertuples():
            side, kind = row.part.split()
            colour = detector_colour(row.detector)
            whiskers = {
                "xerr": [
                    [100 * (row.spread_m - row.spread_m_low)],
                    [100 * (row.spread_m_high - row.spread_m)],
                ],
                "yerr": [[100 * (row.bias_m - row.bias_m_low)], [100 * (row.bias_m_high - row.bias_m)]],
            }
            axis.errorbar(
                100 * row.spread_m, 100 * row.bias_m, **{k: np.maximum(v, 0) for k, v in whiskers.items()},
                fmt=_PART_MARKERS[kind], color=colour, mfc=colour if side == "left" else "white",
                markersize=8, elinewidth=0.7,
            )  # fmt: skip
        axis.set(xscale="log", yscale="log", title=view, xlabel="spread: distance to the median [cm]")
        for scale in (axis.xaxis, axis.yaxis):
            _plain_ticks(scale)
        axis.axline((1, 1), (2, 2), color="#888888", lw=1, ls="--")
    axes[0, 0].set(ylabel="bias: median to truth [cm]")
    _part_legend(figure, axes[0, 0], list(dict.fromkeys(table["detector"])))
    worse = table.assign(mostly=np.where(table["bias_m"] > table["spread_m"], "bias", "spread"))
    counts = worse.groupby(["detector", "mostly"], sort=False).size()
    said = in_words([f"{detector} {n} with more {kind}" for (detector, kind), n in counts.items()])
    caption = (
        "Stability against accuracy: median distance of the images to their median position, and how far "
        "that position is from the true one; above the dashed line a keypoint is more off than unsteady. "
        f"Whiskers are 95 % bootstrap intervals over images: {note}."
    )
    return Figure(figure, caption, f"Scatter of spread and bias on logarithmic axes. Parts: {said}.", table)


def _plain_ticks(axis) -> None:
    """Ticks of a logarithmic axis at 1, 2 and 5, written as plain numbers."""
    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())


def _part_legend(figure, axis, detectors: Sequence[str]) -> None:
    colours = [axis.plot([], [], "-", lw=4, color=detector_colour(name), label=name)[0] for name in detectors]
    shapes = [
        axis.plot([], [], marker, color="#444444", ls="", label=kind)[0]
        for kind, marker in _PART_MARKERS.items()
    ]
    sides = [
        axis.plot([], [], "o", color="#444444", mfc=fill, label=side)[0]
        for side, fill in (("left", "#444444"), ("right", "white"))
    ]
    figure.legend(handles=[*colours, *shapes, *sides], loc="outside lower center", ncols=5, fontsize=9)


@in_style
def spread_causes(table: pd.DataFrame, note: str) -> Figure:
    """Spread (upper row) and bias (lower row) of every part with one cause at a time.

    `table` from `hicp_lib.evaluation.space.spread_causes.spread_causes`.
    """
    cases = list(dict.fromkeys(zip(table["view"], table["detector"], strict=True)))
    parts = list(dict.fromkeys(table["part"]))
    size = {"width_in": max(2.9 * len(cases), 7), "height_in": 1.6 + 0.8 * len(parts)}
    figure, axes = new_figure(2, len(cases), sharey=True, sharex="row", squeeze=False, **size)
    for (view, detector), (upper, lower) in zip(cases, axes.T, strict=True):
        rows = table[(table["view"] == view) & (table["detector"] == detector)]
        _draw_causes(upper, rows, parts, "spread_m")
        _draw_causes(lower, rows, parts, "bias_m")
        upper.set(title=f"{view}\n{detector}", xlabel="spread: distance to the median [cm]")
        lower.set(xlabel="bias: median to truth [cm]")
    axes[0, 0].set(yticks=range(len(parts)), yticklabels=parts, ylim=(len(parts) - 0.5, -0.5))
    figure.legend(*legend_entries(axes), loc="outside lower center", ncols=3, fontsize=9)
    caption = (
        "Where spread and bias come from, one cause at a time, and all. Upper row: median (marker) and "
        "90th percentile (end of the line) of the distance to the median position; lower row: how far that "
        f"position is from the true one: {note}."
    )
    medians = table.groupby("cause", sort=False)[["spread_m", "bias_m"]].median()
    said = in_words(
        [
            f"{row.Index} {100 * row.spread_m:.1f} and {100 * row.bias_m:.1f} cm"
            for row in medians.itertuples()
        ]
    )
    return Figure(
        figure, caption, f"Dots per part and cause. Median spread and bias over parts: {said}.", table
    )


def _draw_causes(axis, rows: pd.DataFrame, parts: list[str], measure: str) -> None:
    causes = list(dict.fromkeys(rows["cause"]))
    for k, (cause, part) in enumerate(rows.groupby("cause", sort=False)):
        colour, marker = _CAUSE_STYLES[k]
        y = np.array([parts.index(item) for item in part["part"]]) + 0.13 * (k - (len(causes) - 1) / 2)
        if measure == "spread_m":
            axis.hlines(y, 100 * part["spread_m"], 100 * part["p90_m"], color=colour, lw=1.2)
        axis.plot(100 * part[measure], y, marker, color=colour, markersize=5, label=cause)
    axis.set(xscale="log")
    _plain_ticks(axis.xaxis)

"""Figures of the test against motion capture: fractions, distributions, trajectories, what errors depend on.

Tables are those of `hicp_lib.evaluation.space.mocap_error`, with one lifting method.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from hicp_lib.evaluation.space.mocap_error import TABLE_JOINTS, THRESHOLDS_M
from hicp_lib.study.plots.style import Figure, detector_colour, in_style, in_words, legend_entries, new_figure

REFERENCE_COLOUR = "#111111"
_MIN_N = 5  # fewer say little of a median
_AXES = {"x_m": "x (backward) [m]", "y_m": "y (right) [m]", "z_m": "z (up) [m]"}
_BY = {"distance_m": "distance from the camera [m]", "score": "score", "sight": "line of sight"}


@in_style
def fraction_curves(errors: pd.DataFrame, min_score: float, note: str) -> Figure:
    """Fraction of the frames with motion capture in which a joint was found within a distance of it."""
    errors = errors[errors["reference_x_m"].notna()]
    limits_m = np.arange(0, 0.2001, 0.0025)
    rows = []
    for (detector, keypoint), part in errors.groupby(["detector", "keypoint"], sort=False):
        found_m = np.where(part["score"] > min_score, part["error_m"], np.nan)
        shares = (found_m[:, None] <= limits_m).mean(axis=0)
        rows += [(detector, keypoint, *pair) for pair in zip(limits_m, shares, strict=True)]
    table = pd.DataFrame(rows, columns=["detector", "keypoint", "distance_m", "share"])
    figure, axes = _joint_axes(list(dict.fromkeys(table["keypoint"])), 3.2, 2.4)
    for (detector, keypoint), part in table.groupby(["detector", "keypoint"], sort=False):
        axis = axes[keypoint]
        axis.plot(
            100 * part["distance_m"], part["share"], color=detector_colour(detector), lw=2, label=detector
        )
    for axis in axes.values():
        axis.vlines([100 * limit for limit in THRESHOLDS_M], 0, 1, color="#AAAAAA", lw=0.8)
        axis.set(ylim=(0, 1.02), xlim=(0, 20), xlabel="distance [cm]", ylabel="share of frames")
        axis.label_outer()
    _legend(figure, list(axes.values()))
    caption = (
        f"Share of frames with motion capture in which a joint was found (score above {min_score:g}) within "
        f"a distance of the mean of its two markers; grey: 2.5, 5 and 10 cm, as in the paper: "
        f"{_lifting(errors)}, {note}."
    )
    within = table[np.isclose(table["distance_m"], 0.05)].groupby("detector", sort=False)["share"].mean()
    said = in_words([f"{detector} {share:.2f}" for detector, share in within.items()])
    return Figure(
        figure, caption, f"Rising curves per joint and detector. Mean share within 5 cm: {said}.", table
    )


@in_style
def error_distributions(errors: pd.DataFrame, paper: pd.DataFrame, min_score: float, note: str) -> Figure:
    """Distances from the markers per joint and detector, beside the medians the paper reports.

    `paper` from `hicp_lib.study.paper_tables.paper_medians`.
    """
    found = errors[(errors["score"] > min_score) & errors["error_m"].notna()]
    joints = [joint for joint in TABLE_JOINTS if joint in set(errors["keypoint"])]
    detectors, named = (list(dict.fromkeys(table["detector"])) for table in (errors, paper))
    paper = paper[paper["min_score"] == min_score]
    figure, axes = _joint_axes(joints, 4.6, 0.9 + 0.26 * (len(detectors) + len(named)))
    for joint, axis in axes.items():
        part = found[found["keypoint"] == joint]
        for y, detector in enumerate(detectors):
            _draw_box(
                axis, 100 * part.loc[part["detector"] == detector, "error_m"], y, detector_colour(detector)
            )
        medians = paper[paper["keypoint"] == joint].set_index("detector")["median_m"]
        for y, detector in enumerate(named, start=len(detectors)):
            axis.plot(100 * medians[detector], y, "D", color=detector_colour(detector), markersize=7)
        axis.axhline(len(detectors) - 0.5, color="#AAAAAA", lw=0.8)
        axis.set(xscale="log", xlim=(0.5, 100), xlabel="distance [cm]")
        axis.set(xticks=[1, 3, 10, 30, 100], xticklabels=["1", "3", "10", "30", "100"])
    labels = [*detectors, *(f"{name} (paper)" for name in named)]
    for axis in axes.values():
        axis.set(yticks=range(len(labels)), yticklabels=labels, ylim=(len(labels) - 0.5, -0.5))
        axis.label_outer()
    medians = (
        found[found["keypoint"].isin(joints)]
        .groupby(["detector", "keypoint"], sort=False)["error_m"]
        .median()
    )
    said = in_words([f"{d} {k.replace('_', ' ')} {100 * v:.1f} cm" for (d, k), v in medians.items()])
    caption = (
        f"Distance of lifted joints (score above {min_score:g}) from the mean of their two markers: box "
        f"25–75 %, whiskers 5–95 %, line the median: {_lifting(errors)}, {note}. Diamonds: the "
        "paper's medians, of its own detectors and lifting on its own recording."
    )
    table = found[["detector", "keypoint", "frame", "score", "error_m"]]
    return Figure(figure, caption, f"Box plots per joint. Medians: {said}.", table)


def _joint_axes(joints: list[str], width_in: float, height_in: float):
    """A figure with the sides as rows and the parts as columns, and its axes by joint."""
    sides, parts = (list(dict.fromkeys(joint.split("_")[k] for joint in joints)) for k in (0, 1))
    size = {"width_in": max(width_in * len(parts), 6.0), "height_in": 0.6 + height_in * len(sides)}
    figure, axes = new_figure(len(sides), len(parts), sharex=True, sharey=True, squeeze=False, **size)
    by_joint = {
        joint: axes[sides.index(side), parts.index(part)]
        for joint in joints
        for side, part in [joint.split("_")]
    }
    for joint, axis in by_joint.items():
        axis.set(title=joint.replace("_", " "))
    return figure, by_joint


def _lifting(table: pd.DataFrame) -> str:
    return f"{in_words(dict.fromkeys(table['method']))} lifting"


def _legend(figure, axes) -> None:
    handles, labels = legend_entries(np.array(list(axes)))
    figure.legend(handles, labels, loc="outside lower center", ncols=5, fontsize=9)


def _draw_box(axis, values_cm: pd.Series, y: float, colour: str) -> None:
    if values_cm.empty:
        return
    drawn = axis.boxplot(
        [values_cm], positions=[y], widths=0.6, orientation="horizontal", whis=(5, 95), showfliers=False,
        patch_artist=True, manage_ticks=False,
    )  # fmt: skip
    drawn["boxes"][0].set(facecolor=colour, alpha=0.6)
    drawn["medians"][0].set(color="black", lw=1.5)


@in_style
def trajectories(
    errors: pd.DataFrame, times_s: np.ndarray, keypoint: str, min_score: float, note: str
) -> Figure:
    """Coordinates of one joint over time: motion capture as a line with its gaps, what was lifted as dots.

    Parameters
    ----------
    times_s : array, shape (n_frames,), of the recording; shown from 0
    """
    errors = errors[errors["keypoint"] == keypoint]
    detectors = list(dict.fromkeys(errors["detector"]))
    figure, axes = new_figure(3, 1, 10.0, 6.4, sharex=True)
    for axis, (column, label) in zip(axes, _AXES.items(), strict=True):
        first = errors[errors["detector"] == detectors[0]].sort_values("frame")
        elapsed_s = times_s[first["frame"]] - times_s[0]
        line = first[f"reference_{column}"].to_numpy()
        axis.plot(elapsed_s, line, color=REFERENCE_COLOUR, lw=1.6, label="motion capture")
        for detector in detectors:
            found = errors[(errors["detector"] == detector) & (errors["score"] > min_score)]
            axis.plot(
                times_s[found["frame"]] - times_s[0], found[column], ".", color=detector_colour(detector),
                markersize=4, alpha=0.8, label=detector,
            )  # fmt: skip
        low, high = np.nanmin(line, initial=np.inf), np.nanmax(line, initial=-np.inf)
        if np.isfinite([low, high]).all():
            axis.set(ylim=(low - 0.15, high + 0.15))
        axis.set(ylabel=label)
    axes[-1].set(xlabel="time [s]")
    _legend(figure, axes.flat)
    name = keypoint.replace("_", " ")
    caption = (
        f"The {name} over time in the robot's base frame: motion capture (line, interrupted where a marker "
        f"was missing) and lifted keypoints with a score above {min_score:g}; points more than 15 cm beyond "
        f"the line's range are not shown: {_lifting(errors)}, {note}."
    )
    found = (
        errors[(errors["score"] > min_score) & errors["error_m"].notna()]
        .groupby("detector", sort=False)
        .size()
    )
    said = in_words([f"{detector} in {n} frames" for detector, n in found.items()])
    columns = ["detector", "frame", *_AXES, *(f"reference_{c}" for c in _AXES), "score", "error_m"]
    return Figure(
        figure, caption, f"Three curves over time. The {name} was found by {said}.", errors[columns]
    )


@in_style
def error_dependence(table: pd.DataFrame, note: str) -> Figure:
    """Median error of elbows and wrists by distance, score and line of sight.

    `table` from `hicp_lib.evaluation.space.mocap_error.errors_by`, one after the other for every column.
    """
    table = table[table["part"].isin(["elbow", "wrist"]) & (table["n"] >= _MIN_N)]
    columns, parts = (list(dict.fromkeys(table[name])) for name in ("by", "part"))
    figure, axes = new_figure(
        len(parts), len(columns), 3.7 * len(columns), 2.9 * len(parts), squeeze=False, sharey=True
    )
    for part, row in zip(parts, axes, strict=True):
        for column, axis in zip(columns, row, strict=True):
            rows = table[(table["part"] == part) & (table["by"] == column)]
            _draw_dependence(axis, rows)
            axis.set(yscale="log", title=f"{part}s", xlabel=_BY.get(column, column))
            axis.set(
                yticks=[1, 2, 5, 10, 20, 50], yticklabels=["1", "2", "5", "10", "20", "50"], ylim=(0.7, 80)
            )
            axis.minorticks_off()
        row[0].set(ylabel="distance from the markers [cm]")
    _legend(figure, axes.flat)
    caption = (
        "Distance from the markers by distance from the camera, by score, and by whether something is in "
        "front of the joint (lines and dots the median, bands and whiskers the quartiles; bins of at least "
        f"{_MIN_N}): {_lifting(table)}, {note}."
    )
    said = _said_by_sight(table)
    return Figure(figure, caption, f"Curves per detector.{said}", table)


def _draw_dependence(axis, rows: pd.DataFrame) -> None:
    detectors, labels = (list(dict.fromkeys(rows[name])) for name in ("detector", "bin"))
    for k, (detector, part) in enumerate(rows.groupby("detector", sort=False)):
        colour = detector_colour(detector)
        median, lower, upper = (100 * part[name] for name in ("median_m", "lower_m", "upper_m"))
        if part["middle"].notna().all():
            axis.plot(part["middle"], median, "o-", color=colour, markersize=4, label=detector)
            axis.fill_between(part["middle"], lower, upper, color=colour, alpha=0.18, lw=0)
        else:
            x = [labels.index(label) + 0.16 * (k - (len(detectors) - 1) / 2) for label in part["bin"]]
            axis.errorbar(
                x, median, [median - lower, upper - median], fmt="o", color=colour, label=detector, capsize=3
            )
            axis.set(xticks=range(len(labels)), xticklabels=labels, xlim=(-0.5, len(labels) - 0.5))


def _said_by_sight(table: pd.DataFrame) -> str:
    rows = table[(table["by"] == "sight") & (table["part"] == "wrist")]
    said = [f"{row.detector} {100 * row.median_m:.1f} cm when {row.bin}" for row in rows.itertuples()]
    return f" Median at the wrists: {in_words(said)}." if said else ""

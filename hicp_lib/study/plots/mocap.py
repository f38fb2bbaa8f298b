"""Figures of the test against motion capture: medians, residuals, the budget of the errors.

Tables are those of `hicp_lib.evaluation.space.mocap_error` and `hicp_lib.evaluation.space.error_budget`. A
detector called `palette.PERFECT` among them is the floor: what the true keypoints in the image come to.
"""

import numpy as np
import pandas as pd
from matplotlib.patheffects import withStroke

from hicp_lib.evaluation.space.error_budget import AGAINST_MOCAP, TOTALS
from hicp_lib.evaluation.space.mocap_error import TABLE_JOINTS
from hicp_lib.recordings.recording import Recording, read_rgb
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import PERFECT, STYLES, TRUTH_COLOUR, detector_colour, detector_marker
from hicp_lib.study.plots.style import COLUMN_IN, TEXTS, Figure, in_style, new_figure, texts
from hicp_lib.study.table_format import in_cm

_MOST_M = 0.1  # residuals beyond it are drawn on the border
_OF_PAPER = " (paper)"
_BOUNDS = ("median_m", "low_m", "high_m")
_AXES = {"x_m": "x, backward [cm]", "y_m": "y, to the right [cm]", "z_m": "z, up [cm]"}


@in_style
def joint_medians(medians: pd.DataFrame, paper: pd.DataFrame, min_score: float, note: str) -> Figure:
    """Median distances from the markers per joint, like with like: ours by the paper's lifting (filled) above
    the paper's own; hollow: ours by the robust lifting.

    Parameters
    ----------
    medians : pd.DataFrame
        As from `hicp_lib.evaluation.space.mocap_error.median_errors`.
    paper : pd.DataFrame
        As from `hicp_lib.study.paper_tables.paper_medians`.
    min_score : float
        A keypoint counts as found above it.
    note : str
        What the data are, for the caption.
    """
    theirs = paper.assign(detector=paper["detector"] + _OF_PAPER, method="paper")
    table = pd.concat([medians, theirs], ignore_index=True)
    table = table[(table["min_score"] == min_score) & table["keypoint"].isin(TABLE_JOINTS)]
    table = table[["detector", "method", "keypoint", "count", *_BOUNDS]]
    table = table.assign(joint=table["keypoint"].str.replace("_", " "))
    names = list(table["detector"].unique())
    n_ours = sum(not name.endswith(_OF_PAPER) for name in names)
    size = COLUMN_IN, 1.2 + 0.6 * len(names)
    figure, axes, panels = marks.panels(table, ["joint"], *size, wrap=2, sharex=True, sharey=True)
    for axis, rows, joint in panels:
        for (detector, method), dot in rows.groupby(["detector", "method"], sort=False):
            (pen,) = marks.detector_dots([detector.removesuffix(_OF_PAPER)]).values()
            pen |= {"label": None, "ms": 6} | ({} if method == "paper" else {"mfc": "white", "alpha": 0.6})
            marks.dots(axis, dot, names.index(detector), _BOUNDS, 100, **pen)
            if (detector, method) == (PERFECT, "paper"):
                axis.axvline(100 * dot["median_m"].iloc[0], color=TRUTH_COLOUR, lw=0.8, ls=":")
        axis.axhline(n_ours - 0.5, color="#AAAAAA", lw=0.8)
        axis.set(xlabel="median distance [cm]", title=joint)
        marks.name_rows(axis, names)
        axis.label_outer()
    axes[0, 0].set(xlim=(0, None))  # of all, and not before all are drawn: it ends the scaling to the marks
    fills = {"the paper's lifting": {}, "robust lifting": {"mfc": "white"}}
    marks.add_keys(axes[0, 0], (), {name: {"marker": "o", "ls": ""} | fill for name, fill in fills.items()})
    marks.legend_below(figure, axes[0, 0])
    by_paper = table[table["method"] == "paper"].groupby("detector", sort=False)["median_m"]
    ends_cm = (100 * by_paper.agg(["min", "max"])).dropna().reset_index()
    told = {"min_score": min_score, "note": note, "floor": _floor(medians), "ends": ends_cm}
    told["means"] = 100 * by_paper.mean().dropna()
    return Figure(figure, *texts("joint_medians", **told), table.drop(columns="joint"))


def _floor(table: pd.DataFrame) -> str:
    return f"; {PERFECT}: the true keypoints in the image" if PERFECT in set(table["detector"]) else ""


@in_style
def residuals(
    errors: pd.DataFrame, times_s: np.ndarray, keypoint: str, min_score: float, note: str
) -> Figure:
    """What was lifted of one joint less where motion capture had it, over time: a panel per coordinate.

    Parameters
    ----------
    errors : pd.DataFrame
        As from `hicp_lib.evaluation.space.mocap_error.mocap_errors`.
    times_s : array, shape (n_frames,)
        Of the recording; shown from 0.
    keypoint : str
        The joint.
    min_score : float
        A keypoint counts as found above it.
    note : str
        What the data are, for the caption.
    """
    errors = errors[errors["keypoint"] == keypoint]
    found = errors[(errors["score"] > min_score) & errors["error_m"].notna()]
    figure, axes = new_figure(3, 1, COLUMN_IN, 6.2, sharex=True, sharey=True)
    for axis, (column, label) in zip(axes, _AXES.items(), strict=True):
        for detector in sorted(errors["detector"].unique(), key=PERFECT.__ne__):  # beneath the others
            dots = found[found["detector"] == detector]
            off_cm = 100 * (dots[column] - dots[f"reference_{column}"]).clip(-_MOST_M, _MOST_M)
            pen = {"color": detector_colour(detector), "markersize": 4.5, "alpha": 0.8, "label": detector}
            axis.plot(times_s[dots["frame"]] - times_s[0], off_cm, detector_marker(detector), **pen)
        axis.axhline(0, color=TRUTH_COLOUR, lw=1)
        axis.set(ylabel=label, ylim=(-104 * _MOST_M, 104 * _MOST_M))
    axes[-1].set(xlabel="time [s]")
    marks.legend_below(figure, axes)
    said = found.groupby("detector", sort=False)["error_m"].agg(["size", "median"]).reset_index()
    said["median"] *= 100
    told = {"min_score": min_score, "beyond_cm": 100 * _MOST_M, "floor": _floor(errors), "note": note}
    told |= {"name": keypoint.replace("_", " "), "methods": list(errors["method"].unique())}
    columns = ["detector", "frame", *_AXES, *(f"reference_{c}" for c in _AXES), "score", "error_m"]
    return Figure(figure, *texts("residuals", **told, said=said), errors[columns])


_TOTALS_APART = 0.5  # rows


@in_style
def error_budget(budget: pd.DataFrame, view: str, paper: pd.DataFrame, note: str) -> Figure:
    """A panel per part, a row per source: its error alone (filled), and what is gained without it (hollow).

    Parameters
    ----------
    budget : pd.DataFrame
        As from `hicp_lib.evaluation.space.error_budget.error_budget`.
    view : str
        Which of its views is drawn.
    paper : pd.DataFrame
        The paper's medians against motion capture, columns `detector, keypoint, median_m`.
    note : str
        What the data are, for the caption.
    """
    table = budget[budget["view"] == view]
    sources, methods = (list(table[name].unique()) for name in ("source", "method"))
    size = COLUMN_IN, 1.2 + 0.68 * len(sources)
    figure, axes, panels = marks.panels(table, ["part"], *size, wrap=2, sharey=True)
    rows = {source: k + _TOTALS_APART * (source not in TOTALS) for k, source in enumerate(sources)}
    for axis, of_part, part in panels:
        for (method, kind), of in of_part.groupby(["method", "kind"], sort=False):
            y = of["source"].map(rows) + marks.offset(methods.index(method), len(methods), 0.3)
            is_gain, bounds = kind == "gain", ("value_m", "low_m", "high_m")
            label = f"{method} lifting, {'gained without' if is_gain else 'alone'}"
            pen = STYLES["liftings"][method] | {"label": label} | ({"mfc": "white"} if is_gain else {})
            marks.dots(axis, of, y, bounds, 100, **pen)
        if AGAINST_MOCAP in rows:
            theirs_cm = 100 * paper.loc[paper["keypoint"].str.endswith(part), "median_m"]
            y = [rows[AGAINST_MOCAP]] * len(theirs_cm)
            axis.plot(theirs_cm, y, "|", color=TRUTH_COLOUR, markersize=13, label="the paper's medians")
        axis.set(title=f"{part}s", xlabel="error, or gain [cm]")
        axis.axvline(0, color="#888888", lw=0.8)
    axes[0, 0].set(yticks=[*rows.values()], yticklabels=[*rows], ylim=(max(rows.values()) + 0.6, -0.6))
    marks.legend_below(figure, axes)
    beside = ", against motion capture beside the paper's best medians" if AGAINST_MOCAP in rows else ""
    first = table[table["kind"] == "alone"].sort_values("value_m", ascending=False)
    first = first.drop_duplicates(["part", "method"]).set_index(["part", "method", "source"])["value_m"]
    least_m = table.loc[table["kind"] == "gain", "detectable_m"].median()
    told = {"n_people": table["n_people"].max(), "beside": beside, "note": note, "said": 100 * first}
    top = first.groupby(level="method", sort=False).head(1)
    told |= {"view": view, "least": in_cm([least_m])[0], "top": 100 * top}
    return Figure(figure, *texts("error_budget", **told), budget)


# Solutions in the order they are given; not detectors' colours.
_STYLES = (("#D5272D", "x"), ("#FF69B4", "3"), ("#F0A202", "+"), ("#19B5FE", "1"), ("#2ECC40", "2"))
_MARGIN_PX = 45
_ADDED, _LEAVE_ONE_OUT = ("added_m", "added error [mm]"), ("leave_one_out_m", "leave-one-out error [mm]")
# White on a picture, and to be seen on the page as well.
_OUTLINED = [withStroke(linewidth=3, foreground="#333333")]


@in_style
def registration(
    recording: Recording, clicks: pd.DataFrame, pixels: pd.DataFrame, table: pd.DataFrame, note: str
) -> Figure:
    """Images with the clicked markers and where every registration puts the measured ones, over a bar chart.

    Parameters
    ----------
    recording : Recording
    clicks : pd.DataFrame
        Those of the images shown, columns `frame, marker, u_px, v_px`.
    pixels : pd.DataFrame
        As from `marker_pixels`; only markers that were clicked are drawn.
    table : pd.DataFrame
        As from `compare_registrations`.
    note : str
        What the data are, for the caption.
    """
    frames, methods = sorted(set(clicks["frame"])), list(table["method"])
    figure, axes = new_figure(2, len(frames), COLUMN_IN, 5.6, squeeze=False, height_ratios=(1.6, 1))
    for axis in axes[1]:
        axis.remove()
    bars = figure.add_subplot(axes[1, 0].get_gridspec()[1, :])
    shown = clicks[["frame", "marker"]].merge(pixels, on=["frame", "marker"])
    for axis, frame in zip(axes[0], frames, strict=True):
        _draw_markers(axis, recording, frame, clicks[clicks["frame"] == frame], shown, methods)
    known = bool(table["added_m"].notna().any())
    column, label = _ADDED if known else _LEAVE_ONE_OUT
    _draw_bars(bars, 1000 * table.set_index("method")[column], label)
    marks.legend_below(figure, axes[0, 0])
    what = TEXTS["registration"]["known" if known else "unknown"]
    said = 1000 * table.set_index("method")[column].dropna()
    return Figure(figure, *texts("registration", what=what, note=note, said=said), table)


def _draw_markers(axis, recording: Recording, frame: int, clicks, pixels: pd.DataFrame, methods) -> None:
    axis.imshow(read_rgb(recording, frame))
    circle = {"color": "white", "mfc": "none", "mew": 1.5, "markersize": 11, "path_effects": _OUTLINED}
    axis.plot(clicks["u_px"], clicks["v_px"], "o", label="clicked", **circle)
    for method, (colour, shape) in zip(methods, _STYLES, strict=False):
        part = pixels[(pixels["method"] == method) & (pixels["frame"] == frame)]
        axis.plot(part["u_px"], part["v_px"], shape, color=colour, mew=1.8, markersize=9, label=method)
    pixels_px, size = clicks[["u_px", "v_px"]], recording.intrinsics
    left, top = np.maximum(pixels_px.min() - _MARGIN_PX, 0)
    right, bottom = np.minimum(pixels_px.max() + _MARGIN_PX, (size.width_px, size.height_px))
    axis.set(xlim=(left, right), ylim=(bottom, top), xticks=[], yticks=[], title=f"frame {frame}")
    axis.grid(False)


def _draw_bars(axis, values_mm: pd.Series, label: str) -> None:
    """Bars that end in the marks the pictures have."""
    for y, (value_mm, (colour, shape)) in enumerate(zip(values_mm, _STYLES, strict=False)):
        axis.barh(y, value_mm, color=colour, height=0.15)
        axis.plot(value_mm, y, shape, color=colour, mew=1.8, markersize=9)
        axis.annotate(f"{value_mm:.0f}", (value_mm, y), (9, 0), textcoords="offset points", va="center")
    axis.set(xlabel=label, yticks=[], ylim=(len(values_mm) - 0.5, -0.5))
    axis.margins(x=0.1)

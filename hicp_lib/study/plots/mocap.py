"""Figures of the test against motion capture: distributions, trajectories, the budget of the errors.

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
from hicp_lib.study.plots.palette import PERFECT, TRUTH_COLOUR, detector_colour
from hicp_lib.study.plots.style import TEXTS, Figure, in_style, in_words, new_figure, texts

_OUT_OF_RANGE_M = 0.15  # beyond the reference's range by more is not drawn
_BOX_CM = (1, 3, 10, 30, 100)  # ticks of a logarithmic axis
_LINE = ["detector", "method", "keypoint"]
_AXES = {"x_m": "x (backward) [m]", "y_m": "y (right) [m]", "z_m": "z (up) [m]"}


@in_style
def error_distributions(errors: pd.DataFrame, paper: pd.DataFrame, min_score: float, note: str) -> Figure:
    """Distances from the markers per joint and detector, like with like: first by the paper's lifting, beside
    the medians the paper reports, then by the others.

    Parameters
    ----------
    errors : pd.DataFrame
        As from `hicp_lib.evaluation.space.mocap_error.mocap_errors`.
    paper : pd.DataFrame
        As from `hicp_lib.study.paper_tables.paper_medians`.
    min_score : float
        A keypoint counts as found above it.
    note : str
        What the data are, for the caption.
    """
    words, is_found = errors["keypoint"].str.split("_").str, errors["score"] > min_score
    is_found &= errors["error_m"].notna()
    errors = errors.assign(side=words[0], part=words[1], is_found=is_found)
    at_arms = errors[errors["keypoint"].isin(TABLE_JOINTS)]
    cases = errors[_LINE[:2]].drop_duplicates().sort_values("method", kind="stable")  # the paper's first
    names = [f"{detector}, {method} lifting" for detector, method in cases.itertuples(index=False)]
    named, n_like = list(paper["detector"].unique()), (cases["method"] == "paper").sum()
    paper = paper[paper["min_score"] == min_score].set_index(["detector", "keypoint"]).sort_index()
    labels = [*names[:n_like], *(f"{name} (paper)" for name in named), *names[n_like:]]
    width_in = max(4.6 * at_arms["part"].nunique(), 6.0)
    height_in = 0.6 + (0.9 + 0.24 * len(labels)) * at_arms["side"].nunique()
    shared = {"sharex": True, "sharey": True}
    figure, _, panels = marks.panels(at_arms, ["side", "part"], width_in, height_in, **shared)
    for axis, rows, side, part in panels:
        for (detector, method), errors_m in rows[rows["is_found"]].groupby(_LINE[:2])["error_m"]:
            y = labels.index(f"{detector}, {method} lifting")
            place = {"positions": [y], "widths": 0.6, "manage_ticks": False}
            marks.draw_boxes(axis, [100 * errors_m], [detector_colour(detector)], **place)
            if (detector, method) == (PERFECT, "paper"):
                axis.axvline(100 * errors_m.median(), color=TRUTH_COLOUR, lw=0.8, ls=":")
        for y, detector in enumerate(named, start=n_like):
            median_m = paper.at[(detector, f"{side}_{part}"), "median_m"]
            axis.plot(100 * median_m, y, "D", color=detector_colour(detector), markersize=7)
        axis.hlines([n_like - 0.5, n_like + len(named) - 0.5], 0.3, 100, color="#AAAAAA", lw=0.8)
        axis.set(xscale="log", xlim=(0.3, 100), xlabel="distance [cm]", title=f"{side} {part}")
        axis.set(xticks=_BOX_CM, xticklabels=map(str, _BOX_CM))
        marks.name_rows(axis, labels)
        axis.label_outer()
    medians_cm = 100 * at_arms[at_arms["is_found"]].groupby(_LINE[:2], sort=False)["error_m"].median()
    told = {"min_score": min_score, "note": note, "floor": _floor(errors)}
    said = texts("error_distributions", **told, said=medians_cm)
    return Figure(figure, *said, errors.loc[is_found, [*_LINE, "frame", "score", "error_m"]])


def _floor(table: pd.DataFrame) -> str:
    return f"; {PERFECT}: the true keypoints in the image" if PERFECT in set(table["detector"]) else ""


@in_style
def trajectories(
    errors: pd.DataFrame, times_s: np.ndarray, keypoint: str, min_score: float, note: str
) -> Figure:
    """Coordinates of one joint over time: motion capture as a line with its gaps, what was lifted as dots.

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
    found = errors[errors["score"] > min_score]
    first = errors[errors["detector"] == errors["detector"].iloc[0]].sort_values("frame")
    figure, axes = new_figure(3, 1, 10.0, 6.4, sharex=True)
    for axis, (column, label) in zip(axes, _AXES.items(), strict=True):
        line = first[f"reference_{column}"].to_numpy()
        elapsed_s = times_s[first["frame"]] - times_s[0]
        axis.plot(elapsed_s, line, color=TRUTH_COLOUR, lw=1.6, label="motion capture")
        for detector in sorted(errors["detector"].unique(), key=PERFECT.__ne__):  # beneath the others
            dots = found[found["detector"] == detector]
            pen = {"color": detector_colour(detector), "markersize": 4, "alpha": 0.8, "label": detector}
            axis.plot(times_s[dots["frame"]] - times_s[0], dots[column], ".", **pen)
        low, high = np.nanmin(line, initial=np.inf), np.nanmax(line, initial=-np.inf)
        if np.isfinite([low, high]).all():
            axis.set(ylim=(low - _OUT_OF_RANGE_M, high + _OUT_OF_RANGE_M))
        axis.set(ylabel=label)
    axes[-1].set(xlabel="time [s]")
    marks.legend_below(figure, axes, ncols=5)
    counts = found[found["error_m"].notna()].groupby("detector", sort=False).size()
    told = {"min_score": min_score, "beyond_cm": 100 * _OUT_OF_RANGE_M, "floor": _floor(errors), "note": note}
    told |= {"name": keypoint.replace("_", " "), "methods": list(errors["method"].unique())}
    said = texts("trajectories", **told, said=counts)
    columns = ["detector", "frame", *_AXES, *(f"reference_{c}" for c in _AXES), "score", "error_m"]
    return Figure(figure, *said, errors[columns])


_COLOURS = {"paper": "#D55E00", "robust": "#0072B2"}
_HOLLOW = {"fmt": "D", "mfc": "white"}
_TOTALS_APART = 0.5  # rows


@in_style
def error_budget(table: pd.DataFrame, paper: pd.DataFrame, note: str) -> Figure:
    """A panel per part, a row per source: its error alone (filled), and what is gained without it (hollow).

    Parameters
    ----------
    table : pd.DataFrame
        As from `hicp_lib.evaluation.space.error_budget.error_budget`, one view.
    paper : pd.DataFrame
        The paper's medians against motion capture, columns `detector, keypoint, median_m`.
    note : str
        What the data are, for the caption.
    """
    sources, methods = (list(table[name].unique()) for name in ("source", "method"))
    figure, axes, panels = marks.panels(table, ["part"], 11.5, 5.0, sharey=True)
    rows = {source: k + _TOTALS_APART * (source not in TOTALS) for k, source in enumerate(sources)}
    for axis, of_part, part in panels:
        for (method, kind), of in of_part.groupby(["method", "kind"], sort=False):
            y = of["source"].map(rows) + marks.offset(methods.index(method), len(methods), 0.3)
            is_gain, bounds = kind == "gain", ("value_m", "low_m", "high_m")
            label = f"{method} lifting, {'gained without' if is_gain else 'alone'}"
            pen = {"color": _COLOURS[method], "label": label} | (_HOLLOW if is_gain else {})
            marks.dots(axis, of, y, bounds, 100, **pen)
        if AGAINST_MOCAP in rows:
            theirs_cm = 100 * paper.loc[paper["keypoint"].str.endswith(part), "median_m"]
            y = [rows[AGAINST_MOCAP]] * len(theirs_cm)
            axis.plot(theirs_cm, y, "|", color=TRUTH_COLOUR, markersize=13, label="the paper's medians")
        axis.set(title=f"{part}s", xlabel="error, or gain [cm]")
        axis.axvline(0, color="#888888", lw=0.8)
    axes[0, 0].set(yticks=[*rows.values()], yticklabels=[*rows], ylim=(max(rows.values()) + 0.6, -0.6))
    marks.legend_below(figure, axes, ncols=5)
    named = in_words(paper["detector"].unique())
    theirs = f", against motion capture beside the medians of the paper's {named}"
    beside = theirs if AGAINST_MOCAP in rows else ""
    first = table[table["kind"] == "alone"].sort_values("value_m", ascending=False)
    first = first.drop_duplicates(["part", "method"]).set_index(["part", "method", "source"])["value_m"]
    told = {"n_people": table["n_people"].max(), "beside": beside, "note": note, "said": 100 * first}
    return Figure(figure, *texts("error_budget", **told), table)


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
    figure, axes = new_figure(1, len(frames) + 1, 4.2 * len(frames) + 4.0, 4.4)
    shown = clicks[["frame", "marker"]].merge(pixels, on=["frame", "marker"])
    for axis, frame in zip(axes, frames, strict=False):
        _draw_markers(axis, recording, frame, clicks[clicks["frame"] == frame], shown, methods)
    known = bool(table["added_m"].notna().any())
    column, label = _ADDED if known else _LEAVE_ONE_OUT
    _draw_bars(axes[-1], 1000 * table.set_index("method")[column], label)
    marks.legend_below(figure, axes[0])
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
    colours = [colour for colour, _ in _STYLES[: len(values_mm)]]
    axis.barh(range(len(colours)), values_mm.iloc[: len(colours)], color=colours, height=0.55)
    marks.name_rows(axis, [name.replace(": ", ":\n") for name in values_mm.index])
    axis.set(xlabel=label)
    axis.grid(axis="y", visible=False)

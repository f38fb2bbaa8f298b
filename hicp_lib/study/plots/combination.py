"""Figures of the combination: what its ingredients buy, and what scores are worth."""

import pandas as pd

from hicp_lib.evaluation.calibration.curves import N_BINS
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import SUBSET_COLOURS, detector_colour
from hicp_lib.study.plots.style import Figure, in_style, in_words, new_figure, series_text

_MEASURES = {"AP": "average precision of hands", "share": "share of labelled hands found"}
_GROUPS = {"body": "body", "hand": "hands"}


@in_style
def ingredients(table: pd.DataFrame, note: str) -> Figure:
    """Average precision and hands found per variant and subset; `table` from `compare_hands`."""
    variants = list(table["variant"].unique())
    figure, axes = new_figure(1, 2, 10.0, 1.2 + 0.5 * len(variants), sharey=True)
    for axis, (measure, label) in zip(axes, _MEASURES.items(), strict=True):
        for k, (subset, rows) in enumerate(table.groupby("subset", sort=False)):
            reach = marks.whiskers(rows, measure, f"{measure}_low", f"{measure}_high")
            pen = {"fmt": "o", "color": SUBSET_COLOURS.get(subset), "label": subset, "capsize": 3}
            y = rows["variant"].map(variants.index) + marks.offset(k, 2, 0.2)
            axis.errorbar(rows[measure], y, xerr=reach, **pen)
        axis.set(xlabel=label, xlim=(0, None))
    marks.name_rows(axes[0], variants)
    _legend_above(figure, axes[0])
    said = series_text(table.set_index(["variant", "subset"])["AP"], "{0} {2:.2f} on {1}")
    caption = (
        "What each ingredient buys: average precision of hands, and the share of labelled hands found, "
        f"with 95 % bootstrap intervals over source images: {note}."
    )
    return Figure(figure, caption, f"Dots with whiskers per variant. Average precision: {said}.", table)


@in_style
def reliability_curves(curves: pd.DataFrame, errors: pd.DataFrame, min_term: float, note: str) -> Figure:
    """Hit rate against score, raw and calibrated, over the number of keypoints per bin of the score.

    Parameters
    ----------
    curves, errors : pd.DataFrame
        As from `calibration_study`.
    min_term : float
        What counts as a hit: the OKS term from which on.
    note : str
        What the data are, for the caption.
    """
    cases = list(dict.fromkeys(zip(curves["detector"], curves["group"], strict=True)))
    figure, axes = new_figure(
        2, len(cases), max(3.1 * len(cases), 6.0), 4.6, sharex=True, squeeze=False, sharey="row",
        height_ratios=[3, 1],
    )  # fmt: skip
    for column, (detector, group) in enumerate(cases):
        upper, lower = axes[:, column]
        rows = curves[(curves["detector"] == detector) & (curves["group"] == group)]
        _draw_curves(upper, lower, rows, detector_colour(detector))
        upper.set_title(f"{detector.removeprefix('combined:')}\n{_GROUPS.get(group, group)}", fontsize=8)
        lower.set(xlabel="score", xlim=(-0.02, 1.02))
    axes[0, 0].set(ylabel="share of hits", ylim=(-0.02, 1.02))
    axes[1, 0].set(ylabel="keypoints")
    _legend_above(figure, axes[0, 0])
    said = [
        f"{row.detector} {_GROUPS.get(row.group, row.group)} {row.raw:.2f} to {row.calibrated:.2f}"
        for row in errors.itertuples()
    ]
    caption = (
        f"Reliability of keypoint scores: share of hits (OKS term of at least {min_term:g}) per bin, and "
        "how many keypoints have it; dashed: a score that says what it is worth. Raw scores, and scores "
        f"calibrated on other images, with 95 % bootstrap intervals over source images: {note}."
    )
    alt = f"Curves of hits against score per detector. Expected calibration error: {in_words(said)}."
    return Figure(figure, caption, alt, curves)


def _draw_curves(upper, lower, rows: pd.DataFrame, colour: str) -> None:
    upper.plot([0, 1], [0, 1], "--", color="#888888", lw=1)
    for k, (kind, marker, fill) in enumerate((("raw", "o-", "white"), ("calibrated", "s-", colour))):
        part = rows[rows["scores"] == kind]
        pen = {"color": colour, "mfc": fill, "lw": 1, "elinewidth": 0.7, "markersize": 5, "label": kind}
        upper.errorbar(part["score"], part["rate"], marks.whiskers(part, "rate"), fmt=marker, **pen)
        x = (part["bin"] + 0.5) / N_BINS + marks.offset(k, 2, 0.04)
        lower.bar(x, part["count"], 0.036, color=fill, ec=colour)
    lower.grid(axis="x", visible=False)


def _legend_above(figure, axis) -> None:
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=len(labels))

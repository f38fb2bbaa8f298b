"""Figures of the 2D comparison: precision against recall, the loss without a head, OKS, time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.images import read_image
from hicp_lib.study.plots.people import detections_grid
from hicp_lib.study.plots.style import (
    THRESHOLD_MARKERS,
    Figure,
    detector_colour,
    in_style,
    in_words,
    legend_entries,
    new_figure,
)

_GROUP_TITLES = {"body": "Body (17 points)", "hand": "Hands (42 points)"}
_THRESHOLDS = {".5": ("AP50", "AR50"), ".75": ("AP75", "AR75"), ".5:.95": ("AP", "AR")}


@in_style
def precision_recall(table: pd.DataFrame, data_note: str) -> Figure:
    """Average precision against average recall as in the paper's Fig. 4.

    Parameters
    ----------
    table : one row per subset x group x detector x metric, columns
        `subset, group, detector, metric, value, low, high` (interval bounds at 95 %)
    data_note : on what data, e.g. "rendered people"; becomes part of the caption
    """
    figure, axes, panels = _panels(table, 4.0, "average recall", "average precision")
    for axis, rows in panels:
        for detector, of_detector in rows.groupby("detector", sort=False):
            _scatter_detector(axis, of_detector.set_index("metric"), detector)
        axis.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02), aspect="equal")
    _legend(figure, axes, list(dict.fromkeys(table["detector"])))
    caption = (
        f"Average precision against average recall per detector, on {data_note}. The shape is the OKS "
        "threshold (square .5, circle .75, triangle the mean over .5:.05:.95), as in Fig. 4 of the paper; "
        "whiskers are 95 % bootstrap intervals over images."
    )
    return Figure(figure, caption, _describe_best(table), table)


def _panels(table: pd.DataFrame, height_in: float, x_label: str, y_label: str):
    """A panel for each group of keypoints (down) and subset (across).

    Returns the figure, its axes (groups, subsets), and each axis with its rows of the table.
    """
    subsets, groups = list(dict.fromkeys(table["subset"])), list(dict.fromkeys(table["group"]))
    size = 4.4 * len(subsets), height_in * len(groups)
    figure, axes = new_figure(len(groups), len(subsets), *size, sharex=True, sharey=True, squeeze=False)
    panels = []
    for of_group, group in zip(axes, groups, strict=True):
        for axis, subset in zip(of_group, subsets, strict=True):
            axis.set_title(f"{subset.capitalize()} · {_GROUP_TITLES.get(group, group)}")
            panels.append((axis, table[(table["subset"] == subset) & (table["group"] == group)]))
    for axis in axes[-1]:
        axis.set_xlabel(x_label)
    for axis in axes[:, 0]:
        axis.set_ylabel(y_label)
    return figure, axes, panels


def _scatter_detector(axis, rows: pd.DataFrame, detector: str) -> None:
    colour = detector_colour(detector)
    for threshold, (precision, recall) in _THRESHOLDS.items():
        y, x = rows.loc[precision], rows.loc[recall]
        axis.errorbar(
            x["value"], y["value"], xerr=_whiskers(x), yerr=_whiskers(y),
            fmt=THRESHOLD_MARKERS[threshold], color=colour, markersize=7, elinewidth=0.9, alpha=0.9,
        )  # fmt: skip


def _whiskers(row) -> list[list[float]] | None:
    if not np.isfinite([row["value"], row["low"], row["high"]]).all():
        return None
    return [[max(0.0, row["value"] - row["low"])], [max(0.0, row["high"] - row["value"])]]


def _legend(figure, axes, detectors) -> None:
    axis = axes[0, 0]
    shapes = [
        axis.plot([], [], marker, color="#444444", label=f"OKS {name}")[0]
        for name, marker in THRESHOLD_MARKERS.items()
    ]
    colours = [axis.plot([], [], "-", lw=4, color=detector_colour(name), label=name)[0] for name in detectors]
    figure.legend(handles=[*colours, *shapes], loc="outside lower center", ncols=4, fontsize=9)


def _describe_best(table: pd.DataFrame) -> str:
    best = []
    rows = table[(table["metric"] == "AP") & table["value"].notna()]
    for (subset, group), part in rows.groupby(["subset", "group"], sort=False):
        top = part.loc[part["value"].idxmax()]
        best.append(f"{top['detector']} with {top['value']:.2f} on {subset} {group}")
    return (
        f"Scatter of average precision against average recall. Highest average precision: {in_words(best)}."
    )


@in_style
def loss_without_head(table: pd.DataFrame, data_note: str) -> Figure:
    """Average precision on Basic and on Headless, joined per detector and group.

    `table` as for `precision_recall`; only rows with metric "AP" are drawn.
    """
    rows = table[table["metric"] == "AP"]
    groups = list(dict.fromkeys(rows["group"]))
    figure, axes = new_figure(1, len(groups), 4.4 * len(groups), 3.2, sharex=True, squeeze=False)
    for axis, group in zip(axes[0], groups, strict=True):
        part = rows[rows["group"] == group].pivot(index="detector", columns="subset", values="value")
        part = part.reindex([name for name in dict.fromkeys(rows["detector"]) if name in part.index])[::-1]
        for y, (detector, row) in enumerate(part.iterrows()):
            colour = detector_colour(detector)
            axis.plot([row["headless"], row["basic"]], [y, y], "-", color=colour, lw=3, alpha=0.45)
            axis.plot(row["basic"], y, "o", color=colour, markersize=9)
            axis.plot(row["headless"], y, "o", color=colour, mfc="white", mew=2, markersize=9)
        axis.set(yticks=range(len(part)), yticklabels=list(part.index), xlabel="average precision (.5:.95)")
        axis.set(xlim=(-0.02, 1.02), ylim=(-0.6, len(part) - 0.4))
        axis.set_title(_GROUP_TITLES.get(group, group))
    drops = rows.pivot_table(index=["detector", "group"], columns="subset", values="value")
    change = (drops["headless"] - drops["basic"]).dropna()
    said = in_words([f"{name} {group} {value:+.2f}" for (name, group), value in change.items()])
    caption = (
        "What removing the head costs: average precision on Basic (filled) and Headless (open) for each "
        f"detector, on {data_note}."
    )
    return Figure(
        figure, caption, f"Average precision with and without the head. Change per detector: {said}.", rows
    )


@in_style
def oks_curves(table: pd.DataFrame, data_note: str) -> Figure:
    """Share of people whose best detection has at least a given OKS.

    `table` has one row per person: columns `subset, group, detector, oks` (0 when nobody was found).
    """
    label = "share of people at least as good"
    figure, axes, panels = _panels(table, 3.2, "OKS of the best detection", label)
    medians = []
    for axis, rows in panels:
        for (subset, group, detector), people in rows.groupby(["subset", "group", "detector"], sort=False):
            oks = np.sort(people["oks"].to_numpy())
            share = 1 - np.arange(len(oks)) / len(oks)
            steps = np.r_[0, oks, 1], np.r_[1, share, 0]
            axis.step(*steps, color=detector_colour(detector), where="pre", label=detector)
            medians.append(f"{detector} {np.median(oks):.2f} ({subset} {group})")
        axis.set(xlim=(0, 1), ylim=(0, 1.02))
    handles, labels = legend_entries(axes)
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=9)
    caption = (
        f"Share of annotated people whose best-fitting detection reaches a given OKS, on {data_note}; "
        "a person nobody found counts with OKS 0."
    )
    return Figure(figure, caption, f"Curves per detector. Median OKS: {in_words(medians)}.", table)


def examples(folders, truth, found, n_people: int, note: str) -> Figure:
    """The first people who are in every subset, as each detector sees them.

    Parameters
    ----------
    folders : subset -> dataset folder
    truth, found : as in `hicp_lib.evaluation.ap.metric_table`
    """
    shared = [
        i for i in list(truth.values())[-1].images if all(i in people.images for people in truth.values())
    ]
    detectors = list(dict.fromkeys(detector for _, detector in found))
    pictures = {
        f"{subset} {i}": (
            read_image(Path(folder) / "images" / truth[subset].images[i].file_name),
            {name: found[subset, name].get(i, Detections.none()) for name in detectors},
        )
        for i in shared[:n_people]
        for subset, folder in folders.items()
    }
    return detections_grid(pictures, min_score=0.3, note=f"Data: {note}.")


@in_style
def time_per_image(table: pd.DataFrame, machine_note: str) -> Figure:
    """Distribution of the detection time per image; `table` has columns `detector, time_ms`."""
    detectors = list(dict.fromkeys(table["detector"]))[::-1]
    samples = [table.loc[table["detector"] == name, "time_ms"].dropna().to_numpy() for name in detectors]
    figure, axis = new_figure(1, 1, 7.5, 0.8 + 0.55 * len(detectors))
    boxes = axis.boxplot(samples, orientation="horizontal", whis=(5, 95), showfliers=False, patch_artist=True)
    for box, median, name in zip(boxes["boxes"], boxes["medians"], detectors, strict=True):
        box.set(facecolor=detector_colour(name), alpha=0.6)
        median.set(color="black", lw=1.5)
    axis.set(
        yticks=range(1, len(detectors) + 1),
        yticklabels=detectors,
        xlabel="time per image [ms]",
        xlim=(0, None),
    )
    medians = [
        f"{name} {np.median(times):.0f} ms"
        for name, times in zip(detectors, samples, strict=True)
        if len(times)
    ]
    caption = (
        f"Time to detect people in one image, {machine_note}: box 25–75 %, whiskers 5–95 %, line the median."
    )
    return Figure(figure, caption, f"Box plot of detection times; medians: {in_words(medians)}.", table)

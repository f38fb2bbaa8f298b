"""Figures of the 2D comparison: precision against recall, the loss without a head, OKS, time."""

from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.images import read_image
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import THRESHOLD_MARKERS, detector_colour
from hicp_lib.study.plots.people import detections_grid
from hicp_lib.study.plots.style import Figure, in_style, in_words, new_figure, series_text

GROUP_TITLES = {"body": "Body (17 points)", "hand": "Hands (42 points)"}
_THRESHOLDS = {".5": ("AP50", "AR50"), ".75": ("AP75", "AR75"), ".5:.95": ("AP", "AR")}


@in_style
def precision_recall(table: pd.DataFrame, data_note: str) -> Figure:
    """Average precision against average recall as in the paper's Fig. 4.

    Parameters
    ----------
    table : pd.DataFrame
        One row per subset x group x detector x metric, columns `subset, group, detector, metric, value, low,
        high` (interval bounds at 95 %).
    data_note : str
        On what data, e.g. "rendered people"; becomes part of the caption.
    """
    figure, axes = _panels(table, 4.0, "average recall", "average precision")
    for axis, rows, _, _ in marks.facets(axes, table, "group", "subset"):
        for detector, of_detector in rows.groupby("detector", sort=False):
            _scatter_detector(axis, of_detector, detector)
        axis.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02), aspect="equal")
    colours = marks.detector_lines(axes[0, 0], table["detector"].unique())
    names = [f"OKS {name}" for name in THRESHOLD_MARKERS]
    shapes = marks.legend_lines(
        axes[0, 0], names, ({"marker": m, "ls": ""} for m in THRESHOLD_MARKERS.values())
    )
    figure.legend(handles=[*colours, *shapes], loc="outside lower center", ncols=4, fontsize=9)
    caption = (
        f"Average precision against average recall per detector, on {data_note}. The shape is the OKS "
        "threshold (square .5, circle .75, triangle the mean over .5:.05:.95), as in Fig. 4 of the paper; "
        "whiskers are 95 % bootstrap intervals over images."
    )
    return Figure(figure, caption, _describe_best(table), table)


def _panels(table: pd.DataFrame, height_in: float, x_label: str, y_label: str):
    """A figure with a panel for each group of keypoints (down) and subset (across), and its axes."""
    shape = table["group"].nunique(), table["subset"].nunique()
    size = 4.4 * shape[1], height_in * shape[0]
    figure, axes = new_figure(*shape, *size, sharex=True, sharey=True, squeeze=False)
    for axis, _, group, subset in marks.facets(axes, table, "group", "subset"):
        title = f"{subset.capitalize()} · {GROUP_TITLES.get(group, group)}"
        axis.set(title=title, xlabel=x_label, ylabel=y_label)
        axis.label_outer()
    return figure, axes


def _scatter_detector(axis, rows: pd.DataFrame, detector: str) -> None:
    by_metric = {metric: row for metric, row in rows.groupby("metric")}
    for threshold, (precision, recall) in _THRESHOLDS.items():
        y, x = by_metric[precision], by_metric[recall]
        reach = {"xerr": marks.whiskers(x), "yerr": marks.whiskers(y)}
        pen = {"color": detector_colour(detector), "markersize": 7, "elinewidth": 0.9, "alpha": 0.9}
        axis.errorbar(x["value"], y["value"], fmt=THRESHOLD_MARKERS[threshold], **reach, **pen)


def _describe_best(table: pd.DataFrame) -> str:
    rows = table[(table["metric"] == "AP") & table["value"].notna()]
    best = rows.loc[rows.groupby(["subset", "group"], sort=False)["value"].idxmax()]
    said = series_text(
        best.set_index(["detector", "subset", "group"])["value"], "{0} with {3:.2f} on {1} {2}"
    )
    return f"Scatter of average precision against average recall. Highest average precision: {said}."


@in_style
def loss_without_head(table: pd.DataFrame, data_note: str) -> Figure:
    """Average precision on Basic and on Headless, joined per detector and group.

    `table` as for `precision_recall`; only rows with metric "AP" are drawn.
    """
    rows = table[table["metric"] == "AP"]
    names, groups = (rows[name].unique() for name in ("detector", "group"))
    figure, axes = new_figure(1, len(groups), 4.4 * len(groups), 3.2, sharex=True, squeeze=False)
    for axis, group in zip(axes[0], groups, strict=True):
        part = rows[rows["group"] == group].pivot(index="detector", columns="subset", values="value")
        part = part.reindex([name for name in names[::-1] if name in part.index])
        for y, (detector, row) in enumerate(part.iterrows()):
            colour = detector_colour(detector)
            axis.plot([row["headless"], row["basic"]], [y, y], "-", color=colour, lw=3, alpha=0.45)
            axis.plot(row["basic"], y, "o", color=colour, markersize=9)
            axis.plot(row["headless"], y, "o", color=colour, mfc="white", mew=2, markersize=9)
        axis.set(yticks=range(len(part)), yticklabels=list(part.index), xlabel="average precision (.5:.95)")
        axis.set(xlim=(-0.02, 1.02), ylim=(-0.6, len(part) - 0.4), title=GROUP_TITLES.get(group, group))
    drops = rows.pivot_table(index=["detector", "group"], columns="subset", values="value")
    said = series_text((drops["headless"] - drops["basic"]).dropna(), "{} {} {:+.2f}")
    caption = (
        "What removing the head costs: average precision on Basic (filled) and Headless (open) for each "
        f"detector, on {data_note}."
    )
    alt = f"Average precision with and without the head. Change per detector: {said}."
    return Figure(figure, caption, alt, rows)


@in_style
def oks_curves(table: pd.DataFrame, data_note: str) -> Figure:
    """Share of people whose best detection has at least a given OKS.

    `table` has one row per person: columns `subset, group, detector, oks` (0 when nobody was found).
    """
    figure, axes = _panels(table, 3.2, "OKS of the best detection", "share of people at least as good")
    medians = []
    for axis, rows, group, subset in marks.facets(axes, table, "group", "subset"):
        for detector, people in rows.groupby("detector", sort=False):
            oks = np.sort(people["oks"].to_numpy())
            share = 1 - np.arange(len(oks)) / len(oks)
            steps = np.r_[0, oks, 1], np.r_[1, share, 0]
            axis.step(*steps, color=detector_colour(detector), where="pre", label=detector)
            medians.append(f"{detector} {np.median(oks):.2f} ({subset} {group})")
        axis.set(xlim=(0, 1), ylim=(0, 1.02))
    marks.legend_below(figure, axes)
    caption = (
        f"Share of annotated people whose best-fitting detection reaches a given OKS, on {data_note}; "
        "a person nobody found counts with OKS 0."
    )
    return Figure(figure, caption, f"Curves per detector. Median OKS: {in_words(medians)}.", table)


def examples(folders, truth, found, n_people: int, note: str) -> Figure:
    """The first people who are in every subset, as each detector sees them.

    Parameters
    ----------
    folders : mapping of str to Path
        Subset -> dataset folder.
    truth : mapping of str to hicp_lib.formats.annotations.Annotations
        By subset.
    found : mapping of (str, str) to mapping of int to Detections
        By subset and detector, then by image id.
    n_people : int
        How many are shown.
    note : str
        What the data are, for the caption.
    """
    shared = [i for i in list(truth.values())[-1].images if all(i in p.images for p in truth.values())]
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
    detectors = table["detector"].unique()[::-1]
    samples = [table.loc[table["detector"] == name, "time_ms"].dropna() for name in detectors]
    figure, axis = new_figure(1, 1, 7.5, 0.8 + 0.55 * len(detectors))
    marks.draw_boxes(axis, samples, map(detector_colour, detectors))
    axis.set(yticks=range(1, len(detectors) + 1), yticklabels=detectors)
    axis.set(xlabel="time per image [ms]", xlim=(0, None))
    pairs = zip(detectors, samples, strict=True)
    medians = [f"{name} {np.median(times):.0f} ms" for name, times in pairs if len(times)]
    caption = (
        f"Time to detect people in one image, {machine_note}: box 25–75 %, whiskers 5–95 %, line the median."
    )
    return Figure(figure, caption, f"Box plot of detection times; medians: {in_words(medians)}.", table)

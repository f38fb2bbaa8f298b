"""Figures of the 2D comparison: precision against recall, the loss without a head, who is found, time."""

from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.images import read_image
from hicp_lib.evaluation.ap.found_and_placed import FOUND, OKS_OF_FOUND
from hicp_lib.study.photographs import PHOTOGRAPHED, RENDERED
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import THRESHOLD_MARKERS, detector_colour
from hicp_lib.study.plots.people import detections_grid
from hicp_lib.study.plots.style import Figure, in_style, new_figure, texts

GROUP_TITLES = {"body": "Body (17 points)", "hand": "Hands (42 points)"}
WIDTH_IN = 5.5  # what can be read on a telephone, and fills a page
_THRESHOLDS = {".5": ("AP50", "AR50"), ".75": ("AP75", "AR75"), ".5:.95": ("AP", "AR")}
_SUBSETS = {"basic": 0, "headless": 1}  # in a row: above filled, below open
_PENS = {
    RENDERED: {"color": "#0072B2", "fmt": "o", "label": RENDERED},
    PHOTOGRAPHED: {"color": "#D55E00", "fmt": "s", "label": PHOTOGRAPHED},
}


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
    figure, axes, panels = _panels(table, 2.7, "average recall", "average precision")
    for axis, rows, _, _ in panels:
        for detector, of_detector in rows.groupby("detector", sort=False):
            _scatter_detector(axis, of_detector, detector)
        axis.set(aspect="equal")
    for row, group in zip(axes, table["group"].unique(), strict=True):
        least = table.loc[table["group"] == group, ["value", "low"]].min().min()
        start = np.floor(5 * np.nan_to_num(least)) / 5
        ticks = np.arange(start, 1.01, 0.2)
        row[0].set(xlim=(start, 1.02), ylim=(start, 1.02), xticks=ticks, yticks=ticks)
    detectors = table["detector"].unique()
    shapes = {f"OKS {name}": {"marker": marker, "ls": ""} for name, marker in THRESHOLD_MARKERS.items()}
    marks.add_keys(axes[0, 0], detectors, shapes)
    marks.legend_below(figure, axes[0, 0], ncols=_legend_columns(detectors))
    rows = table[(table["metric"] == "AP") & table["value"].notna()]
    best = rows.loc[rows.groupby(["subset", "group"], sort=False)["value"].idxmax()]
    return Figure(figure, *texts("precision_recall", note=data_note, said=best), table)


def _panels(table: pd.DataFrame, height_in: float, x_label: str, y_label: str):
    """`marks.panels` for each group of keypoints (down) and subset (across)."""
    size = WIDTH_IN, height_in * table["group"].nunique() + 0.6
    figure, axes, panels = marks.panels(table, ["group", "subset"], *size, sharex="row", sharey="row")
    for axis, _, group, subset in panels:
        axis.set_title(f"{subset.capitalize()}, {_short_title(group)}")
    for axis in axes[-1]:
        axis.set_xlabel(x_label)
    for axis in axes[:, 0]:
        axis.set_ylabel(y_label)
    return figure, axes, panels


def _short_title(group: str) -> str:
    return GROUP_TITLES.get(group, group).partition(" (")[0].lower()


def _legend_columns(names) -> int:
    """How many columns of these names a figure is wide enough for."""
    return 2 if max(map(len, names)) < 30 else 1


def _scatter_detector(axis, rows: pd.DataFrame, detector: str) -> None:
    by_metric = {metric: row for metric, row in rows.groupby("metric")}
    colour = detector_colour(detector)
    track = [[by_metric[pair[k]]["value"].iloc[0] for pair in _THRESHOLDS.values()] for k in (1, 0)]
    axis.plot(*track, color=colour, lw=2, alpha=0.4)
    for threshold, (precision, recall) in _THRESHOLDS.items():
        y, x = by_metric[precision], by_metric[recall]
        reach = {"xerr": marks.whiskers(x), "yerr": marks.whiskers(y)}
        pen = {"color": colour, "markersize": 6, "mec": "white", "mew": 0.5, "elinewidth": 0.7}
        axis.errorbar(x["value"], y["value"], fmt=THRESHOLD_MARKERS[threshold], **reach, **pen)


@in_style
def loss_without_head(table: pd.DataFrame, data_note: str) -> Figure:
    """Average precision on Basic and on Headless, joined per detector and group.

    `table` as for `precision_recall`; only rows with metric "AP" are drawn.
    """
    rows = table[table["metric"] == "AP"]
    figure = _with_and_without(rows, {"AP": "average precision (.5:.95)"}, "metric")
    drops = rows.pivot_table(index=["detector", "group"], columns="subset", values="value", sort=False)
    change = drops.get("headless", np.nan) - drops.get("basic", np.nan)
    return Figure(figure, *texts("loss_without_head", note=data_note, said=change.dropna()), rows)


@in_style
def found_and_placed(table: pd.DataFrame, data_note: str) -> Figure:
    """Share of people who are found at all, beside how well those who are found are placed.

    `table` as from `hicp_lib.evaluation.ap.found_and_placed.found_and_placed`.
    """
    labels = {FOUND: "share of people found", OKS_OF_FOUND: "mean OKS of the found"}
    rows = table[table["what"].isin(labels)]
    figure = _with_and_without(rows, labels, "what")
    shares = rows[(rows["what"] == FOUND) & (rows["group"] == rows["group"].iloc[0])]
    group = _short_title(rows["group"].iloc[0])
    return Figure(figure, *texts("found_and_placed", note=data_note, group=group, said=shares), table)


def _with_and_without(rows: pd.DataFrame, labels: dict[str, str], across: str):
    """Dots with whiskers of each detector in Basic (filled) and Headless (open), joined.

    A row of panels per group of keypoints, in each one per value of the column `across`, named by `labels`.
    """
    groups = rows["group"].unique()
    names = {group: list(rows.loc[rows["group"] == group, "detector"].unique()) for group in groups}
    heights = [len(of_group) + 0.8 for of_group in names.values()]
    size, shared = (WIDTH_IN, 0.5 * sum(heights) + 0.9), {"sharex": "col", "sharey": "row"}
    figure, axes, panels = marks.panels(rows, ["group", across], *size, height_ratios=heights, **shared)
    for axis, part, group, what in panels:
        for detector, pair in part.dropna(subset="value").groupby("detector", sort=False):
            y = names[group].index(detector) + 0.24 * (pair["subset"].map(_SUBSETS).fillna(0.5) - 0.5)
            colour = detector_colour(detector)
            axis.plot(pair["value"], y, "-", lw=3, alpha=0.45, color=colour)
            for subset, one in pair.groupby("subset"):
                fill = "white" if subset == "headless" else colour
                marks.dots(axis, one, y[one.index], color=colour, mfc=fill, ms=7, capsize=0)
        marks.name_rows(axis, names[group])
        axis.set(xlim=(-0.03, 1.03), xlabel=labels[what])
        axis.label_outer()
    for axis, group in zip(axes[:, 0], groups, strict=True):
        axis.set_title(GROUP_TITLES.get(group, group))
    fills = {"Basic": {}, "Headless": {"mfc": "white"}}
    marks.add_keys(axes[0, 0], (), {name: {"marker": "o", "ls": ""} | fill for name, fill in fills.items()})
    marks.legend_below(figure, axes[0, 0], ncols=2)
    return figure


@in_style
def oks_curves(table: pd.DataFrame, data_note: str) -> Figure:
    """Share of people whose best detection has at least a given OKS.

    `table` has one row per person: columns `subset, group, detector, oks` (0 when nobody was found).
    """
    figure, axes, panels = _panels(table, 2.2, "OKS of the best detection", "share at least as good")
    medians = []
    for axis, rows, group, subset in panels:
        for detector, people in rows.groupby("detector", sort=False):
            oks = np.sort(people["oks"].to_numpy())
            share = 1 - np.arange(len(oks)) / len(oks)
            steps = np.r_[0, oks, 1], np.r_[1, share, 0]
            axis.step(*steps, color=detector_colour(detector), where="pre", label=detector)
            medians.append(f"{detector} {np.median(oks):.2f} ({subset} {group})")
        axis.set(xlim=(0, 1), ylim=(0, 1.02))
    marks.legend_below(figure, axes, ncols=_legend_columns(table["detector"].unique()))
    return Figure(figure, *texts("oks_curves", note=data_note, medians=medians), table)


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
        for i in (shared or list(truth["basic"].images))[:n_people]
        for subset, folder in folders.items()
        if i in truth[subset].images
    }
    return detections_grid(pictures, min_score=0.3, note=f"Data: {note}.")


@in_style
def time_per_image(table: pd.DataFrame, machine_note: str) -> Figure:
    """Distribution of the detection time per image; `table` has columns `detector, time_ms`."""
    detectors = table["detector"].unique()[::-1]
    samples = [table.loc[table["detector"] == name, "time_ms"].dropna() for name in detectors]
    figure, axis = new_figure(1, 1, WIDTH_IN, 0.8 + 0.4 * len(detectors))
    marks.draw_boxes(axis, samples, map(detector_colour, detectors))
    axis.set(yticks=range(1, len(detectors) + 1), yticklabels=detectors)
    axis.set(xlabel="time per image [ms]", xlim=(0, None))
    medians = pd.Series([times.median() for times in samples], detectors).dropna()
    return Figure(figure, *texts("time_per_image", note=machine_note, medians=medians), table)


@in_style
def precisions(table: pd.DataFrame, note: str) -> Figure:
    """AP of bodies in a run and on photographs; `table` as from `hicp_lib.study.photographs.beside`."""
    names = list(table["detector"].unique())
    size = WIDTH_IN, 1.4 + 0.5 * len(names)
    figure, axes, panels = marks.panels(table, ["subset"], *size, sharex=True, sharey=True)
    for axis, rows, subset in panels:
        marks.dots_in_rows(axis, rows, "detector", "where", names, _PENS)
        axis.set(xlabel="average precision", xlim=(0, 1))
        axis.set_title(subset.capitalize(), fontsize=9)
    marks.name_rows(axes[0, 0], names)
    marks.legend_below(figure, axes[0, 0], ncols=2)
    best = table.loc[table.groupby(["where", "subset"], sort=False)["value"].idxmax()]
    return Figure(figure, *texts("precisions", note=note, said=best), table)

"""Figures of the 2D comparison: precision against recall, what is lost of it and why, who is found, time."""

from typing import Any

import numpy as np
import pandas as pd

from hicp_lib.evaluation.ap.found_and_placed import FOUND, OKS_OF_FOUND
from hicp_lib.evaluation.ap.loss_shares import SHARES
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import STYLES, detector_colour, detector_marker
from hicp_lib.study.plots.style import WIDTH_IN, Figure, in_style, new_figure, texts

GROUP_TITLES = {"body": "Body (17 points)", "hand": "Hands (42 points)"}
_AP = {"AP": "average precision (.5:.95)"}
# By OKS threshold: precision, recall, and how much of a marker is filled.
_THRESHOLDS = {
    ".5": ("AP50", "AR50", "none"), ".75": ("AP75", "AR75", "left"), ".5:.95": ("AP", "AR", "full"),
}  # fmt: skip


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
    figure, axes, panels = _panels(table, 2.3, "average recall", "average precision")
    for axis, rows, *_ in panels:
        for detector, of_detector in rows.groupby("detector", sort=False):
            _scatter_detector(axis, of_detector.set_index("metric"), detector)
        least = table.loc[table["group"].isin(rows["group"]), ["value", "low"]].min().min()
        start = np.floor(5 * np.nan_to_num(least)) / 5
        ticks = np.arange(start, 1.01, 0.2)
        axis.set(aspect="equal", xlim=(start, 1.02), ylim=(start, 1.02), xticks=ticks, yticks=ticks)
    pens = {name: {**_pen(name), "lw": 2} for name in table["detector"].unique()}
    for threshold, (*_, fill) in _THRESHOLDS.items():
        pens[f"OKS {threshold}"] = {"marker": "o", "ls": "", "fillstyle": fill}
    marks.add_keys(axes[0, 0], (), pens)
    marks.legend_below(figure, axes[0, 0])
    said = _extreme(table[table["metric"] == "AP"], "idxmax")
    return Figure(figure, *texts("precision_recall", note=data_note, said=said), table)


def _panels(table: pd.DataFrame, height_in: float, x_label: str, y_label: str):
    """`marks.panels` for each subset (down) and group of keypoints (across); of one group all abreast."""
    by = ["subset", "group"] if table["group"].nunique() > 1 else ["group", "subset"]
    size = WIDTH_IN, height_in * table[by[0]].nunique() + 1.1
    figure, axes, panels = marks.panels(table, by, *size)
    for axis, _, *case in panels:
        of = dict(zip(by, case, strict=True))
        axis.set_title(f"{of['subset'].capitalize()}, {_short_title(of['group'])}", fontsize=10)
    for axis in axes[-1]:
        axis.set_xlabel(x_label)
    for axis in axes[:, 0]:
        axis.set_ylabel(y_label)
    return figure, axes, panels


def _pen(detector: str) -> dict[str, Any]:
    return {"color": detector_colour(detector), "marker": detector_marker(detector), "ms": 6}


def _short_title(group: str) -> str:
    return GROUP_TITLES.get(group, group).partition(" (")[0].lower()


def _extreme(rows: pd.DataFrame, which: str) -> pd.DataFrame:
    """Of each subset the row with the highest (idxmax) or lowest value, of the first group of keypoints."""
    first = rows[(rows["group"] == rows["group"].iloc[0]) & rows["value"].notna()]
    return first.loc[getattr(first.groupby("subset", sort=False)["value"], which)()]


def _scatter_detector(axis, by_metric: pd.DataFrame, detector: str) -> None:
    pen = _pen(detector)
    precisions, recalls, fills = zip(*_THRESHOLDS.values(), strict=True)
    x, y = (by_metric.loc[list(names), "value"] for names in (recalls, precisions))
    axis.plot(x, y, color=pen["color"], lw=2, alpha=0.4)
    reach = {"xerr": marks.whiskers(by_metric.loc[["AR"]]), "yerr": marks.whiskers(by_metric.loc[["AP"]])}
    axis.errorbar(x["AR"], y["AP"], **reach, color=pen["color"], elinewidth=0.8)
    for fill, *place in zip(fills, x, y, strict=True):
        axis.plot(*place, **pen, fillstyle=fill, markerfacecoloralt="white", clip_on=False)


@in_style
def loss_without_head(table: pd.DataFrame, data_note: str) -> Figure:
    """Average precision on Basic and on Headless, joined per detector and group.

    `table` as for `precision_recall`; only rows with metric "AP" are drawn.
    """
    rows = table[table["metric"] == "AP"]
    figure = _by_subset(rows, _AP, "metric")
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
    figure = _by_subset(rows, labels, "what")
    fewest, roughest = (_extreme(rows[rows["what"] == what], "idxmin") for what in labels)
    return Figure(figure, *texts("found_and_placed", note=data_note, said=fewest, placed=roughest), table)


def _by_subset(rows: pd.DataFrame, labels: dict[str, str], across: str, xlim=(-0.03, 1.03)):
    """Dots of each detector by subset; panels by group of keypoints, and by the column `across`, named."""
    groups = rows["group"].unique()
    names = {group: list(rows.loc[rows["group"] == group, "detector"].unique()) for group in groups}
    heights = [len(of_group) + 0.8 for of_group in names.values()]
    height_in = 0.5 * sum(heights) + 0.9
    shared: dict[str, Any] = {"height_ratios": heights, "sharex": True, "sharey": "row"}
    figure, axes, panels = marks.panels(rows, ["group", across], WIDTH_IN, height_in, **shared)
    for axis, part, group, what in panels:
        _dots_by_subset(axis, part, names[group])
        axis.set(xlabel=labels[what])
        axis.label_outer()
    if xlim:  # else the limits follow from the marks of all panels
        axes[0, 0].set(xlim=xlim)
    for axis, group in zip(axes[:, 0], groups, strict=True):
        axis.set_title(GROUP_TITLES.get(group, group))
    marks.legend_below(figure, axes)
    return figure


def _dots_by_subset(axis, rows: pd.DataFrame, names: list[str]) -> None:
    """Dots with whiskers in rows named after detectors, a mark per subset; Basic and Headless are joined.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
    rows : pd.DataFrame
        Columns `subset, detector, value, low, high`.
    names : list of str
        The detectors, the first on top.
    """
    looks = {name: look for name, look in STYLES["subset_marks"].items() if name in set(rows["subset"])}
    subsets = list(looks)
    places = rows["subset"].map(subsets.index).map(lambda k: marks.offset(k, len(subsets), 0.22))
    for detector, of in rows.assign(y=places).dropna(subset="value").groupby("detector", sort=False):
        of, colour = of.assign(y=of["y"] + names.index(detector)), detector_colour(detector.partition(",")[0])
        pair = of[of["subset"].isin(["basic", "headless"])]
        axis.plot(pair["value"], pair["y"], "-", lw=3, alpha=0.45, color=colour)
        for subset, one in of.groupby("subset"):
            marks.dots(axis, one, one["y"], **looks[subset], fmt="", ls="", color=colour, ms=6, capsize=0)
    marks.name_rows(axis, [name.replace(", ", ",\n") for name in names])
    marks.add_keys(axis, (), {name.capitalize(): look | {"ls": ""} for name, look in looks.items()})


@in_style
def oks_curves(table: pd.DataFrame, data_note: str) -> Figure:
    """Share of people whose best detection has at least a given OKS.

    `table` has one row per person: columns `subset, group, detector, oks` (0 when nobody was found).
    """
    figure, axes, panels = _panels(table, 1.9, "OKS of the best detection", "share at least as good")
    names = list(table["detector"].unique())
    for axis, rows, *_ in panels:
        for detector, people in rows.groupby("detector", sort=False):
            oks = np.sort(people["oks"][people["oks"] > 0])
            steps = np.r_[0, oks, 1], np.r_[len(oks), np.arange(len(oks), -1, -1)] / len(people)
            apart = 0.05 + 0.2 * names.index(detector) / len(names), 0.2  # of the panel's diagonal
            axis.step(*steps, where="pre", label=detector, markevery=apart, **_pen(detector))
        axis.set(xlim=(0, 1), ylim=(0, 1.02))
    marks.legend_below(figure, axes)
    medians = table.groupby(["subset", "group", "detector"], sort=False)["oks"].median().rename("value")
    said = _extreme(medians.reset_index(), "idxmin")
    return Figure(figure, *texts("oks_curves", note=data_note, said=said), table)


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
    figure, _, panels = marks.dot_chart(table, "detector", "where", STYLES["places"], WIDTH_IN, ["subset"])
    for axis, _, subset in panels:
        axis.set(xlabel="average precision", xlim=(0, 1))
        axis.set_title(subset.capitalize(), fontsize=9)
    best = table.loc[table.groupby(["where", "subset"], sort=False)["value"].idxmax()]
    return Figure(figure, *texts("precisions", note=note, said=best), table)


@in_style
def box_sources(table: pd.DataFrame, data_note: str) -> Figure:
    """Average precision by where the box comes from; `table` as from `metric_table`, of `box_variants`."""
    rows = table[table["metric"] == "AP"]
    figure = _by_subset(rows, _AP, "metric")
    values = rows.pivot_table(index="subset", columns="detector", values="value", sort=False)
    whole, _, true_boxes, *_ = rows["detector"].unique()
    gained = (values[true_boxes] - values[whole]).dropna().round(2) + 0.0  # never -0.00
    told = texts("box_sources", note=data_note, said=_extreme(rows, "idxmax"), gained=gained)
    return Figure(figure, *told, table)


@in_style
def loss_shares(table: pd.DataFrame, data_note: str) -> Figure:
    """What keeps average precision from 1; `table` as from `hicp_lib.evaluation.ap.loss_shares`."""
    rows = table[~table["detector"].str.contains(" less ")]
    rows = rows.iloc[np.argsort(rows["share"].map(SHARES.index), kind="stable")]
    labels = {share: f"loss of AP,\n{share}" for share in SHARES}
    figure = _by_subset(rows.assign(group="body"), labels, "share", xlim=None)
    told = texts("loss_shares", note=data_note, said=rows[rows["subset"] == "headless"])
    return Figure(figure, *told, rows)

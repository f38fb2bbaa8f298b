"""Figures of avoidance: clearances of people, and against what is swept; separation's terms."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from hicp_lib.experiments.avoidance.runs import IDEAL, NO_AVOIDANCE
from hicp_lib.robot.separation import Separation, separation_table
from hicp_lib.study.avoidance import FIELD_M, MARKS_M, UNTIL, clearance, over_people
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import detector_colour, detector_marker
from hicp_lib.study.plots.style import COLUMN_IN, Figure, in_style, texts

_GAINS = {"ours": "-", "published": "--"}
_SCRIPT_MARKERS = "os^Dv"


def condition_colour(name: str) -> str:
    """Black shades for the conditions without a detector, the detector's own colour otherwise."""
    return "#111111" if name.startswith(IDEAL) else detector_colour(name)


@in_style
def clearances(metrics: pd.DataFrame, note: str) -> Figure:
    """The least distance of every person in their first reach and in all, a row per condition.

    Parameters
    ----------
    metrics : pd.DataFrame
        As from `avoidance.metrics`.
    note : str
        What the data are, for the caption.
    """
    table, cases = clearance(metrics), metrics.groupby(["detector", "gains"], sort=False)
    conditions = [detector + f", {gains}" * (detector != NO_AVOIDANCE) for (detector, gains), _ in cases]
    height_in = 1.6 + 0.42 * len(conditions)
    figure, axes, panels = marks.panels(table, ["until"], COLUMN_IN, height_in, sharey=True, sharex=True)
    bar: dict[str, Any] = {"fmt": "|", "ms": 12, "mew": 2.5, "capsize": 0, "elinewidth": 2}
    for axis, means, until in panels:
        for place, ((detector, _), mine) in enumerate(cases):
            colour = condition_colour(detector)
            for script, marker in zip(mine["script"].unique(), _SCRIPT_MARKERS, strict=False):
                at_cm = 100 * mine.loc[mine["script"] == script, UNTIL[until]]
                pen = {"s": 22, "alpha": 0.45, "color": colour, "lw": 0, "marker": marker}
                axis.scatter(at_cm, [place + 0.18] * len(at_cm), label=None if place else script, **pen)
            marks.dots(axis, means.iloc[[place]], place - 0.15, factor=100, color=colour, **bar)
        for mark_m in MARKS_M:
            axis.axvline(100 * mark_m, color="#888888", lw=1, ls=":")
        axis.set(title=until, xlabel="least distance (cm)")
    marks.name_rows(axes[0, 0], conditions)
    marks.legend_below(figure, axes[0, 0])
    said = [f"{name} {100 * value:.1f}" for name, value in zip(conditions, table["value"], strict=False)]
    best = said[int(table["value"][: len(said)].argmax())] + " cm"
    return Figure(figure, *texts("clearances", note=note, means=said, best=best), table)


@in_style
def sweep_curves(sweeps: Mapping[str, pd.DataFrame], note: str) -> Figure:
    """Mean least distance against what was swept, with its interval over people: a panel each.

    Parameters
    ----------
    sweeps : mapping of str to DataFrame
        As from `sweeps.sweep`, by the column that was swept.
    note : str
        What the data are, for the caption.
    """
    labels = {"latency_s": ("latency (ms)", 1000), "lost_share": ("images lost (%)", 100)}
    labels["follow_m_s"] = ("the person follows at most at (cm/s)", 100)
    case = ["detector", "gains"]
    tables = {of: over_people(rows, [*case, of], "min_distance_m") for of, rows in sweeps.items()}
    table = pd.concat(tables, names=["swept"]).reset_index(level=0)
    figure, axes, panels = marks.panels(table, ["swept"], COLUMN_IN, 6.4, wrap=2, sharey=True)
    for axis, of_column, column in panels:
        label, factor = labels[column]
        for (detector, gains), rows in of_column.groupby(case, sort=False):
            colour, x = condition_colour(detector), factor * rows[column]
            options = {"color": colour, "ls": _GAINS[gains], "marker": detector_marker(detector)}
            axis.plot(x, 100 * rows["value"], label=f"{detector}, {gains}", **options)
            axis.fill_between(x, 100 * rows["low"], 100 * rows["high"], color=colour, alpha=0.1, lw=0)
        for mark_m in MARKS_M:
            axis.axhline(100 * mark_m, color="#888888", lw=1, ls=":")
        axis.set_xlabel(label)
    for axis in axes[:, 0]:
        axis.set(ylabel="least distance (cm)", ylim=(0, None))
    marks.legend_below(figure, axes, ncols=2)
    lines = table.assign(cm=100 * table["value"]).groupby(["swept", *case], sort=False)["cm"]
    ends = lines.agg(["first", "last"]).reset_index()
    return Figure(figure, *texts("sweep_curves", note=note, ends=ends), table)


@in_style
def separation_terms(separations: Mapping[str, Separation], note: str) -> Figure:
    """The terms of the protective separation distance and their sum: a row each, a dot per detector."""
    table = separation_table(separations)
    rows = table.melt("term", var_name="detector", value_name="value")
    bare: dict[str, Any] = {"bounds": ("value",) * 3, "factor": 100, "ms": 6, "capsize": 0}
    pens = marks.detector_dots(separations)
    figure, ((axis,),), _ = marks.dot_chart(rows, "term", "detector", pens, COLUMN_IN, **bare)
    axis.axhline(len(table) - 1.5, color="#AAAAAA", lw=0.8)
    axis.axvline(100 * FIELD_M, color="#111111", lw=1, ls=":")
    axis.set(xlabel="share of the protective separation distance (cm)", xlim=(0, None))
    sums = [f"{name} {100 * separation.distance_m:.0f} cm" for name, separation in separations.items()]
    largest = rows[rows["term"] != "sum"].sort_values("value").drop_duplicates("detector", keep="last")
    told = {"note": note, "sums": sums, "field_cm": 100 * FIELD_M, "largest": largest}
    return Figure(figure, *texts("separation_terms", **told), table)

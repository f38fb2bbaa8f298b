"""Figures of avoidance: clearances of people, and against what is swept; separation's terms."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from hicp_lib.experiments.avoidance.runs import IDEAL, NO_AVOIDANCE
from hicp_lib.robot.separation import Separation, separation_table
from hicp_lib.study.avoidance import MARKS_M, UNTIL, clearance, over_people
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import detector_colour, detector_marker
from hicp_lib.study.plots.style import Figure, in_lines, in_style, new_figure, texts

_TERM_COLOURS = ("#0072B2", "#E69F00", "#D55E00", "#999999", "#009E73", "#CC79A7")
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
    figure, axes, panels = marks.panels(table, ["until"], 10.0, height_in, sharey=True, sharex=True)
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
    return Figure(figure, *texts("clearances", note=note, means=said), table)


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
    figure, axes, panels = marks.panels(table, ["swept"], 4.2 * len(sweeps), 4.2, sharey=True)
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
    axes[0, 0].set(ylabel="least distance (cm)", ylim=(0, None))
    marks.legend_below(figure, axes, ncols=2)
    lines = table.assign(cm=100 * table["value"]).groupby(["swept", *case], sort=False)["cm"]
    ends = lines.agg(["first", "last"]).reset_index()
    return Figure(figure, *texts("sweep_curves", note=note, ends=ends), table)


@in_style
def separation_terms(separations: Mapping[str, Separation], note: str) -> Figure:
    """The terms of the protective separation distance as stacked bars, one per detector."""
    figure, axis = new_figure(1, 1, 8.0, 1.2 + 0.6 * len(separations))
    table = separation_table(separations)
    terms_cm = 100 * table.set_index("term").drop("sum")
    terms_cm.T.plot.barh(stacked=True, ax=axis, color=_TERM_COLOURS, width=0.8, legend=False)
    axis.bar_label(axis.containers[-1], [f"{sum_cm:.0f} cm" for sum_cm in terms_cm.sum()], padding=4)
    figure.legend(loc="outside lower center", ncols=2)
    axis.set_yticks(range(len(separations)), list(map(in_lines, separations)))
    axis.set_xlabel("protective separation distance (cm)")
    axis.margins(x=0.12)
    sums = [f"{name} {100 * separation.distance_m:.0f} cm" for name, separation in separations.items()]
    return Figure(figure, *texts("separation_terms", note=note, sums=sums), table)

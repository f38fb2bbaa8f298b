"""Figures of avoidance: clearances of people, and against what is swept; separation's terms."""

from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd

from hicp_lib.experiments.avoidance.runs import IDEAL, NO_AVOIDANCE
from hicp_lib.robot.separation import Separation, separation_table
from hicp_lib.study.avoidance import MARKS_M, over_people
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import detector_colour, detector_marker
from hicp_lib.study.plots.style import Figure, in_lines, in_style, in_words, new_figure

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
    shown = {"reach_m": "in the first reach", "min_distance_m": "until they leave"}
    tables = {of: over_people(metrics, ["detector", "gains"], of) for of in shown}
    gains = [f", {row.gains}" * (row.detector != NO_AVOIDANCE) for row in tables["reach_m"].itertuples()]
    conditions = list(tables["reach_m"]["detector"] + gains)
    figure, axes = new_figure(1, 2, 10.0, 1.6 + 0.42 * len(conditions), sharey=True, sharex=True)
    for axis, (of, title) in zip(axes, shown.items(), strict=True):
        for place, ((detector, _), mine) in enumerate(metrics.groupby(["detector", "gains"], sort=False)):
            colour = condition_colour(detector)
            for script, marker in zip(mine["script"].unique(), _SCRIPT_MARKERS, strict=False):
                at_cm, label = 100 * mine.loc[mine["script"] == script, of], None if place else script
                pen = {"s": 22, "alpha": 0.45, "color": colour, "lw": 0, "marker": marker, "label": label}
                axis.scatter(at_cm, [place + 0.18] * len(at_cm), **pen)
            bar: dict[str, Any] = {"fmt": "|", "ms": 12, "mew": 2.5, "capsize": 0, "elinewidth": 2}
            marks.dots(axis, tables[of].iloc[[place]], place - 0.15, factor=100, color=colour, **bar)
        for mark_m in MARKS_M:
            axis.axvline(100 * mark_m, color="#888888", lw=1, ls=":")
        axis.set(title=title, xlabel="least distance (cm)")
    marks.name_rows(axes[0], conditions)
    marks.legend_below(figure, axes[:1])
    until = {title: tables[of] for of, title in shown.items()}
    table = pd.concat(until, names=["until"]).reset_index(level=0)
    means = [f"{name} {100 * value:.1f}" for name, value in zip(conditions, table["value"], strict=False)]
    return Figure(
        figure,
        "Least distance between the person's skin and the robot, a mark per person; above, the mean and its "
        f"95 % interval over people. Dotted: the marks of 5 and 10 cm. Data: {note}.",
        f"Dots per condition, two panels. Means in the first reach, in cm: {in_words(means)}.",
        table,
    )


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
    figure, axes = new_figure(1, len(sweeps), 4.2 * len(sweeps), 4.2, sharey=True, squeeze=False)
    tables = {}
    for axis, (column, swept) in zip(axes[0], sweeps.items(), strict=True):
        tables[column] = table = over_people(swept, ["detector", "gains", column], "min_distance_m")
        label, factor = labels[column]
        for (detector, gains), rows in table.groupby(["detector", "gains"], sort=False):
            colour, x = condition_colour(detector), factor * rows[column]
            options = {"color": colour, "ls": _GAINS[gains], "marker": detector_marker(detector)}
            axis.plot(x, 100 * rows["value"], label=f"{detector}, {gains}", **options)
            axis.fill_between(x, 100 * rows["low"], 100 * rows["high"], color=colour, alpha=0.1, lw=0)
        for mark_m in MARKS_M:
            axis.axhline(100 * mark_m, color="#888888", lw=1, ls=":")
        axis.set_xlabel(label)
    axes[0, 0].set(ylabel="least distance (cm)", ylim=(0, None))
    marks.legend_below(figure, axes, ncols=2)
    return Figure(
        figure,
        "Mean least distance over people against what was swept; bands: 95 % intervals; dotted: 5 and "
        f"10 cm. Keypoints are true, or have a detector's errors; nothing is rendered. Data: {note}.",
        "Lines that fall: " + in_words(_ends(tables)) + ".",
        pd.concat(tables, names=["swept"]).reset_index(level=0),
    )


def _ends(tables: Mapping[str, pd.DataFrame]) -> Iterator[str]:
    """First and last value of every line of a sweep, in words."""
    for column, table in tables.items():
        for (detector, gains), rows in table.groupby(["detector", "gains"], sort=False):
            first, last = 100 * rows["value"].iloc[[0, -1]]
            yield f"{detector}, {gains}, from {first:.1f} to {last:.1f} cm over {column}"


@in_style
def separation_terms(separations: Mapping[str, Separation], note: str) -> Figure:
    """The terms of the protective separation distance as stacked bars, one per detector."""
    figure, axis = new_figure(1, 1, 8.0, 1.2 + 0.6 * max(len(separations), 1))
    table = separation_table(separations)
    if separations:
        terms_cm = 100 * table.set_index("term").drop("sum")
        terms_cm.T.plot.barh(stacked=True, ax=axis, color=_TERM_COLOURS, width=0.8, legend=False)
        axis.bar_label(axis.containers[-1], [f"{sum_cm:.0f} cm" for sum_cm in terms_cm.sum()], padding=4)
        figure.legend(loc="outside lower center", ncols=2)
    axis.set_yticks(range(len(separations)), list(map(in_lines, separations)))
    axis.set_xlabel("protective separation distance (cm)")
    axis.margins(x=0.12)
    sums = [f"{name} {100 * separation.distance_m:.0f} cm" for name, separation in separations.items()]
    return Figure(
        figure,
        "Terms of the separation that ISO 10218-2:2025 asks for; nothing here is a safety function. Data: "
        f"{note}.",
        f"Stacked bars: {in_words(sums)}.",
        table,
    )

"""Figures of where the box of a top-down detector comes from, and of whose fault a lost person is."""

import numpy as np
import pandas as pd

from hicp_lib.evaluation.ap.loss_shares import SHARES
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.evaluation import WIDTH_IN
from hicp_lib.study.plots.palette import detector_colour
from hicp_lib.study.plots.style import Figure, in_style, texts


@in_style
def box_sources(table: pd.DataFrame, data_note: str) -> Figure:
    """Average precision by where the box comes from; `table` as from `metric_table`, of `box_variants`."""
    rows = table[table["metric"] == "AP"]
    figure = _bars_by_case(rows, "subset", "detector", "AP")
    return Figure(figure, *texts("box_sources", note=data_note, said=rows), rows)


@in_style
def loss_shares(table: pd.DataFrame, data_note: str) -> Figure:
    """What keeps average precision from 1; `table` as from `hicp_lib.evaluation.ap.loss_shares`."""
    table = table[~table["detector"].str.contains(" less ")]
    cases = table["subset"].str.capitalize() + ": " + table["detector"]
    rows = table.assign(case=cases).iloc[np.argsort(table["share"].map(SHARES.index), kind="stable")]
    figure = _bars_by_case(rows, "share", "case", "loss of AP")
    last = table[table["subset"] == table["subset"].iloc[-1]]
    return Figure(figure, *texts("loss_shares", note=data_note, said=last), table)


def _bars_by_case(rows: pd.DataFrame, across: str, down: str, x_label: str):
    """Lying bars with whiskers: panels by values of the column `across`, a bar per value of `down`."""
    cases = list(rows[down].unique())
    size = WIDTH_IN, 0.8 + 0.45 * len(cases)
    figure, axes, panels = marks.panels(rows, [across], *size, sharex=True, sharey=True)
    for axis, part, panel in panels:
        colours = [detector_colour(name.partition(",")[0]) for name in part["detector"]]
        y = part[down].map(cases.index)
        axis.barh(y, part["value"], 0.6, color=colours, xerr=marks.whiskers(part), ecolor="#222222")
        axis.set_title(panel.capitalize(), fontsize=9)
        axis.set(xlabel=x_label)
        axis.grid(axis="y", visible=False)
    marks.name_rows(axes[0, 0], [case.replace(", ", ",\n").replace(": ", ":\n") for case in cases])
    return figure

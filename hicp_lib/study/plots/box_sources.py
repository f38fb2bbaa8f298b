"""Figures of where the box of a top-down detector comes from, and of whose fault a lost person is."""

import numpy as np
import pandas as pd

from hicp_lib.evaluation.ap.loss_shares import SHARES
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.evaluation import dots_by_subset, extreme
from hicp_lib.study.plots.style import WIDTH_IN, Figure, in_style, new_figure, texts


@in_style
def box_sources(table: pd.DataFrame, data_note: str) -> Figure:
    """Average precision by where the box comes from; `table` as from `metric_table`, of `box_variants`."""
    rows = table[table["metric"] == "AP"]
    names = list(rows["detector"].unique())
    figure, axis = new_figure(1, 1, WIDTH_IN, 0.9 + 0.65 * len(names))
    dots_by_subset(axis, rows, names)
    axis.set(xlim=(-0.03, 1.03), xlabel="average precision (.5:.95)")
    marks.legend_below(figure, axis)
    values = rows.pivot_table(index="subset", columns="detector", values="value", sort=False)
    whole, _, true_boxes, *_ = names
    gained = (values[true_boxes] - values[whole]).dropna().round(2) + 0.0  # never -0.00
    told = texts("box_sources", note=data_note, said=extreme(rows, "idxmax"), gained=gained)
    return Figure(figure, *told, table)


@in_style
def loss_shares(table: pd.DataFrame, data_note: str) -> Figure:
    """What keeps average precision from 1; `table` as from `hicp_lib.evaluation.ap.loss_shares`."""
    rows = table[~table["detector"].str.contains(" less ")]
    rows = rows.iloc[np.argsort(rows["share"].map(SHARES.index), kind="stable")]
    names = list(rows["detector"].unique())
    size = WIDTH_IN, 1.2 + 0.8 * len(names)
    figure, axes, panels = marks.panels(rows, ["share"], *size, sharex=True, sharey=True)
    for axis, part, share in panels:
        dots_by_subset(axis, part, names)
        axis.set_title(share.capitalize(), fontsize=10)
        axis.set_xlabel("loss of AP")
    marks.legend_below(figure, axes)
    told = texts("loss_shares", note=data_note, said=rows[rows["subset"] == "headless"])
    return Figure(figure, *told, rows)

"""The figure of photographs beside a run."""

import pandas as pd

from hicp_lib.study.photographs import PHOTOGRAPHED, RENDERED
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.evaluation import WIDTH_IN
from hicp_lib.study.plots.style import Figure, in_style, in_words, new_figure

_PENS = {
    RENDERED: {"color": "#0072B2", "fmt": "o", "label": RENDERED},
    PHOTOGRAPHED: {"color": "#D55E00", "fmt": "s", "label": PHOTOGRAPHED},
}


@in_style
def precisions(table: pd.DataFrame, note: str) -> Figure:
    """AP of bodies in a run and on photographs; `table` as from `hicp_lib.study.photographs.beside`."""
    names = list(table["detector"].unique())
    subsets = list(table["subset"].unique())
    size = WIDTH_IN, 1.4 + 0.5 * len(names)
    figure, axes = new_figure(1, len(subsets), *size, sharex=True, sharey=True, squeeze=False)
    for axis, subset in zip(axes[0], subsets, strict=True):
        marks.dots_in_rows(axis, table[table["subset"] == subset], "detector", "where", names, _PENS)
        axis.set(xlabel="average precision", xlim=(0, 1))
        axis.set_title(subset.capitalize(), fontsize=9)
    marks.name_rows(axes[0, 0], names)
    marks.legend_below(figure, axes[0, 0], ncols=2)
    best = table.loc[table.groupby(["where", "subset"], sort=False)["value"].idxmax()]
    said = in_words(f"{r.detector} {r.value:.2f} ({r.where}, {r.subset})" for r in best.itertuples())
    caption = (
        f"Average precision of bodies, .5:.95, in this run ({note}) and on photographs of public data sets, "
        "with 95 % intervals over images."
    )
    return Figure(figure, caption, f"Dots of average precision per detector. Highest: {said}.", table)

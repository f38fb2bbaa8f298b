"""Figure of the claims: how many of the paper's got which verdict, by section."""

import pandas as pd

from hicp_lib.core.errors import InputError
from hicp_lib.study.claims.verdicts import VERDICTS
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import STYLES
from hicp_lib.study.plots.style import COLUMN_IN, Figure, in_style, new_figure, texts


def verdicts(table: pd.DataFrame) -> Figure:
    """Claims by section of the paper and verdict; `table` from `verdict_table`.

    Raises
    ------
    InputError
        If there are none.
    """
    if table.empty:
        raise InputError('no claims of this section; expected "all" or a section with claims, such as "IV-A"')
    return _by_section(table)


@in_style
def _by_section(table: pd.DataFrame) -> Figure:
    sections = list(dict.fromkeys(table["section"]))
    counts = table.groupby(["section", "verdict"], sort=False).size().unstack(fill_value=0)
    counts = counts.reindex(index=sections, columns=VERDICTS, fill_value=0)
    figure, axis = new_figure(1, 1, COLUMN_IN, 1.5 + 0.32 * len(sections))
    marks.stacked_bars(axis, counts, STYLES["verdicts"])
    axis.set(yticks=range(len(sections)), yticklabels=sections)
    axis.invert_yaxis()
    axis.set(xlabel="claims", ylabel="section of the paper", xticks=range(int(counts.sum(axis=1).max()) + 1))
    figure.legend(loc="outside upper center", ncols=2)
    numbers = counts.reset_index().melt("section", var_name="verdict", value_name="claims")
    return Figure(figure, *texts("verdicts", counts=counts.sum()), numbers)

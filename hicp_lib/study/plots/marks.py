"""What charts of the study are put together from: panels, names of rows, whiskers, boxes, legends."""

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from hicp_lib.study.plots.palette import detector_colour
from hicp_lib.study.plots.style import in_lines

_NO_DETECTOR = "#444444"  # what stands in a legend for all detectors


def legend_below(figure, axes, ncols: int = 4, fontsize: float = 9) -> None:
    """A legend under a figure, with each label of its axes once.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    axes : matplotlib.axes.Axes or array of matplotlib.axes.Axes
    ncols : int
        Columns of the legend.
    fontsize : float
        In points.
    """
    found = {}
    for axis in np.ravel(axes):
        pairs = zip(*axis.get_legend_handles_labels(), strict=True)
        found.update({in_lines(label): handle for handle, label in pairs})
    figure.legend(found.values(), found, loc="outside lower center", ncols=ncols, fontsize=fontsize)


def legend_lines(axis, names: Iterable[str], styles: Iterable[dict[str, Any]]) -> list:
    """Lines without points, for a legend: one for each name in its style.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
        Takes the lines.
    names : iterable of str
    styles : iterable of dict
        Options of `Axes.plot`, one of them for each name.

    Returns
    -------
    list of matplotlib.lines.Line2D
    """
    pairs = zip(names, styles, strict=True)
    return [axis.plot([], [], **{"color": _NO_DETECTOR, "label": name} | style)[0] for name, style in pairs]


def detector_lines(axis, detectors: Sequence[str]) -> list:
    """Broad lines in the detectors' colours, for a legend."""
    return legend_lines(
        axis, map(in_lines, detectors), ({"lw": 4, "color": detector_colour(name)} for name in detectors)
    )


def facets(axes, table: pd.DataFrame, down: str, across: str) -> Iterator[tuple[Any, pd.DataFrame, Any, Any]]:
    """Each axis with its rows of a table: a row of axes per value of a column, a column per value of another.

    Parameters
    ----------
    axes : array of matplotlib.axes.Axes, shape (n_down, n_across)
    table : pd.DataFrame
    down, across : str
        Columns of the table; their values in the order they come in.

    Yields
    ------
    matplotlib.axes.Axes
    pd.DataFrame
        Its rows of the table, which may be none.
    object
        The value of `down`.
    object
        The value of `across`.
    """
    cases = itertools.product(table[down].unique(), table[across].unique())
    for axis, (row, column) in zip(np.ravel(axes), cases, strict=True):
        yield axis, table[(table[down] == row) & (table[across] == column)], row, column


def name_rows(axis, labels: Sequence[str]) -> None:
    """Name the rows of a chart, the first on top."""
    axis.set(
        yticks=range(len(labels)), yticklabels=list(map(in_lines, labels)), ylim=(len(labels) - 0.5, -0.5)
    )


def offset(k: int, n: int, step: float) -> float:
    """Where one of several marks goes that stand beside each other, around 0.

    Parameters
    ----------
    k, n : int
        The `k`-th, from 0, of `n`.
    step : float
        From one to the next.

    Examples
    --------
    >>> [offset(k, 3, 0.2) for k in range(3)]
    [-0.2, 0.0, 0.2]
    """
    return step * (k - (n - 1) / 2)


def whiskers(rows: pd.DataFrame, value: str = "value", low: str = "low", high: str = "high") -> np.ndarray:
    """How far intervals reach below and above values, as `Axes.errorbar` takes it.

    Parameters
    ----------
    rows : pd.DataFrame
    value, low, high : str
        Columns of the values and of their intervals' ends.

    Returns
    -------
    array, shape (2, n_rows)
        0 on a side that a value lies beyond.

    Examples
    --------
    >>> rows = pd.DataFrame({"value": [0.5, 0.9], "low": [0.25, 0.25], "high": [0.75, 0.75]})
    >>> whiskers(rows).tolist()
    [[0.25, 0.65], [0.25, 0.0]]
    """
    below, above = rows[value] - rows[low], rows[high] - rows[value]
    return np.maximum([below.to_numpy(float), above.to_numpy(float)], 0)


def stacked_bars(axis, lengths: pd.DataFrame, styles: Mapping[str, dict[str, Any]]) -> None:
    """Lying bars, one per row of a table, of its columns end to end.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
    lengths : pd.DataFrame
        A row per bar, a column per part.
    styles : mapping of str to dict
        Options of `Axes.barh` by part, in the order of the parts from 0.
    """
    ends = lengths[list(styles)].cumsum(axis=1).shift(axis=1, fill_value=0)
    for part, style in styles.items():
        axis.barh(range(len(lengths)), lengths[part], left=ends[part], label=part, **style)
    axis.grid(axis="y", visible=False)


def draw_boxes(axis, samples: Sequence[pd.Series], colours: Iterable[str], **options: Any) -> None:
    """Lying boxes of quartiles with their medians, whiskers from the 5th to the 95th percentile.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
    samples : sequence of pd.Series
        The values of each box.
    colours : iterable of str
        A box's colour each.
    **options : dict
        Further ones of `Axes.boxplot`.
    """
    shape = {"orientation": "horizontal", "whis": (5, 95), "showfliers": False, "patch_artist": True}
    drawn = axis.boxplot(samples, **shape, **options)
    for box, median, colour in zip(drawn["boxes"], drawn["medians"], colours, strict=True):
        box.set(facecolor=colour, alpha=0.6)
        median.set(color="black", lw=1.5)

"""What charts of the study are put together from: panels, names of rows, whiskers, boxes, legends."""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from hicp_lib.study.plots.palette import STYLES, detector_colour, detector_marker
from hicp_lib.study.plots.style import in_lines, new_figure

_BOUNDS = ("value", "low", "high")
_NO_DETECTOR = "#444444"  # what stands in a legend for all detectors


def legend_below(figure, axes) -> None:
    """A legend under a figure, with each label of its axes once, in as many columns as there is room for.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    axes : matplotlib.axes.Axes or array of matplotlib.axes.Axes
    """
    found = {}
    for axis in np.ravel(axes):
        pairs = zip(*axis.get_legend_handles_labels(), strict=True)
        found.update({in_lines(label): handle for handle, label in pairs})
    longest = max((len(line) for label in found for line in label.split("\n")), default=0)
    fitting = int(figure.get_figwidth() / (0.6 + 0.075 * longest))  # inches of a column, at 9 points
    ncols = min(max(fitting, 1), 4)
    figure.legend(found.values(), found, loc="outside lower center", ncols=ncols, fontsize=9)


def add_keys(axis, detectors: Iterable[str], others: Mapping[str, dict[str, Any]]) -> None:
    """Lines without points, for a legend: broad ones in the detectors' colours, then others.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
        Takes the lines.
    detectors : iterable of str
    others : mapping of str to dict
        Options of `Axes.plot` by what they stand for.
    """
    colours = {name: {"lw": 4, "color": detector_colour(name)} for name in detectors}
    for name, style in (colours | dict(others)).items():
        axis.plot([], [], **{"color": _NO_DETECTOR, "label": name} | style)


def panels(table: pd.DataFrame, by: Sequence[str], width_in: float, height_in: float, **shared: Any):
    """A figure with a panel for each value of a column (across), or of two (down, across), or with one panel.

    Parameters
    ----------
    table : pd.DataFrame
    by : sequence of str
        Columns of the table; their values in the order they come in.
    width_in, height_in : float
        The figure's size in inches.
    **shared : any
        Further options of `new_figure`; `wrap`, how many panels of one column stand in a row at most.

    Returns
    -------
    matplotlib.figure.Figure
    array of matplotlib.axes.Axes
        Two-dimensional.
    list of tuple
        Of each panel its axis, its rows of the table, which may be none, and the value of each column.
    """
    values = [table[name].unique() for name in by]
    n_rows, n_columns = [1, 1, *(max(len(of), 1) for of in values)][-2:]
    wrap = shared.pop("wrap", n_columns)
    if n_rows == 1:
        n_rows, n_columns = -(-n_columns // wrap), min(n_columns, wrap)
    figure, axes = new_figure(n_rows, n_columns, width_in, height_in, squeeze=False, **shared)
    cases = zip(axes.flat, itertools.product(*values), strict=False)
    found = [(axis, table[(table[list(by)] == list(case)).all(axis=1)], *case) for axis, case in cases]
    for axis in axes.flat[len(found) or 1 :]:
        axis.set_axis_off()
    return figure, axes, found


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


def dots(axis, rows: pd.DataFrame, y, bounds: Sequence[str] = _BOUNDS, factor: float = 1, **pen: Any) -> None:
    """Dots with their intervals lying.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
    rows : pd.DataFrame
    y : float or array of float, shape (n_rows,)
        How high they stand.
    bounds : sequence of str
        Columns of the values and of their intervals' ends.
    factor : float
        Multiplies the numbers, to bring them to another unit.
    **pen : dict
        Options of `Axes.errorbar`.
    """
    values, reach = factor * rows[bounds[0]].astype(float), factor * whiskers(rows, *bounds)
    axis.errorbar(values, y, xerr=reach, **{"fmt": "o", "capsize": 2, "ms": 5} | pen)


def detector_dots(detectors: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Colour, marker and label of each detector's `dots`."""
    return {
        name: {"color": detector_colour(name), "fmt": detector_marker(name), "label": name}
        for name in detectors
    }


def subset_dots(subsets: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Colour, marker and label of each subset's `dots`."""
    return {name: STYLES["subsets"].get(name, {}) | {"label": name} for name in subsets}


def own_bodies(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of a table on bodies, without combinations whose body detector has the same rows.

    Examples
    --------
    >>> table = pd.DataFrame({"detector": ["posenet", "combined:posenet+mediapipe-hands"]})
    >>> own_bodies(table)["detector"].tolist()
    ['posenet']
    """
    bodies = table["detector"].astype(str).str.extract(r"^combined:([^+]+)\+", expand=False)
    return table[~bodies.isin(table["detector"].unique())]


def dots_in_rows(
    axis, table: pd.DataFrame, down: str, beside: str, names: list, pens: Mapping[str, dict], **shared: Any
) -> None:
    """Dots in rows by one column, beside each other by another.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
    table : pd.DataFrame
    down, beside : str
        The columns.
    names : list
        The values of `down`, the first on top.
    pens : mapping of str to dict
        Options of `dots` by the value of `beside`.
    **shared : dict
        Options of all `dots`.
    """
    for k, (case, pen) in enumerate(pens.items()):
        part = table[table[beside] == case]
        if part.empty:
            continue
        y = np.array([names.index(name) for name in part[down]]) + offset(k, len(pens), 0.8 / len(pens))
        dots(axis, part, y, **pen | shared)


def dot_chart(
    table: pd.DataFrame,
    down: str,
    beside: str,
    pens: Mapping[str, dict],
    width_in: float,
    by: Sequence[str] = (),
    names: Sequence[str] | None = None,
    **shared: Any,
):
    """`panels` with `dots_in_rows`, as high as these need; rows are named, and the pens in a legend below.

    Parameters
    ----------
    table : pd.DataFrame
    down, beside : str
        The columns of rows and of what stands in each.
    pens : mapping of str to dict
        Options of `dots` by the value of `beside`.
    width_in : float
        The figure's width in inches.
    by : sequence of str
        Columns that make the panels; none for one panel.
    names : sequence of str, optional
        The rows from above; by default in the order they come in.
    **shared : dict
        Options of all `dots`.

    Returns
    -------
    matplotlib.figure.Figure
    array of matplotlib.axes.Axes
    list of tuple
        As from `panels`.
    """
    names = list(table[down].unique() if names is None else names)
    n_below = table[by[0]].nunique() if len(by) == 2 else 1
    height_in = 0.9 + n_below * (0.5 + (0.12 + 0.1 * len(pens)) * len(names))
    figure, axes, found = panels(table, by, width_in, height_in, sharex="col", sharey=True)
    for axis, part, *_ in found:
        dots_in_rows(axis, part, down, beside, names, pens, **shared)
    name_rows(axes[0, 0], names)
    legend_below(figure, axes)
    return figure, axes, found


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

"""One style for all figures, what a figure carries, and its numbers in words."""

import functools
import re
import tomllib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import matplotlib.figure
import matplotlib.pyplot as plt
import pandas as pd

from hicp_lib.core.datafiles import DATA_DIR

_STYLE = DATA_DIR / "report.mplstyle"
COLUMN_IN = 6.4
"""Width of a figure [in] whose 9 pt stay 9 pt or more in a page's column of 672 px."""
WIDTH_IN = 5.5
"""Width of a figure [in] that is read on a telephone, too; a page's column enlarges it."""
TEXTS = tomllib.loads((DATA_DIR / "captions.toml").read_text("utf-8"))
"""Captions and alternative texts of figures by name (`texts`), and labels of axes."""


@dataclass(frozen=True)
class Figure:
    """A figure as the report needs it.

    Attributes
    ----------
    figure : matplotlib.figure.Figure
    caption : str
        What is drawn, on what data, with what uncertainty; one or two sentences.
    alt : str
        What a reader who cannot see it should know: the axes and the main finding.
    table : pd.DataFrame or None
        The numbers behind it, offered for download; None for pictures.
    """

    figure: matplotlib.figure.Figure
    caption: str
    alt: str
    table: pd.DataFrame | None = None


_NOTHING = "Nothing to draw: these data have nobody and nothing that this figure is about."


def in_style(draw: Callable[..., Figure | None]) -> Callable[..., Figure]:
    """Decorator: run a drawing function in the report's style, leaving Matplotlib's settings as they were.

    An empty table, list or mapping is not drawn, nor anything where `draw` returns None: one sentence stands
    in the figure's place.
    """

    @functools.wraps(draw)
    def styled(*args, **kwargs) -> Figure:
        with plt.style.context(_STYLE):
            data = [given for given in args if isinstance(given, pd.DataFrame | list | dict)]
            if all(map(len, data)) and (drawn := draw(*args, **kwargs)):
                return drawn
            figure = new_figure(1, 1, 6.0, 0.5, subplot_kw={"visible": False})[0]
            figure.text(0.5, 0.5, _NOTHING, ha="center", va="center")
            table = next((given for given in data if isinstance(given, pd.DataFrame)), None)
            return Figure(figure, _NOTHING, _NOTHING, table)

    return styled


def new_figure(n_rows: int = 1, n_columns: int = 1, width_in: float = 8.0, height_in: float = 4.5, **kwargs):
    """`plt.subplots` with the size in inches, of a figure that pyplot forgets at once.

    A notebook then shows what it is given, not what pyplot remembers.

    Parameters
    ----------
    n_rows, n_columns : int
        Of axes.
    width_in, height_in : float
        The figure's size in inches.
    **kwargs : dict
        Further ones of `plt.subplots`.
    """
    figure, axes = plt.subplots(n_rows, n_columns, figsize=(width_in, height_in), **kwargs)
    plt.close(figure)
    return figure, axes


def texts(name: str, /, **values: Any) -> tuple[str, str]:
    """Caption and alternative text of a figure: those of `data/captions.toml`, filled in.

    Parameters
    ----------
    name : str
        Of the function that draws the figure.
    **values : any
        What stands in the texts, by name. A list is enumerated, as are rows of a table and values of series,
        each put into the pattern that has the value's name (`series_text`).

    Returns
    -------
    tuple of str
    """
    patterns, said = TEXTS[name], {}
    for key, value in values.items():
        if isinstance(value, pd.DataFrame):
            value = [patterns[key].format(**row) for row in value.to_dict("records")]
        elif isinstance(value, pd.Series):
            value = series_text(value, patterns[key])
        said[key] = in_words(value) if isinstance(value, list) else value
    return patterns["caption"].format(**said), patterns["alt"].format(**said)


def in_words(items: Iterable[str]) -> str:
    """Items as one enumerates them.

    Examples
    --------
    >>> in_words(["a"]), in_words(["a", "b", "c"]), in_words([])
    ('a', 'a, b and c', 'nothing')
    """
    *others, last = list(items) or ["nothing"]
    return f"{', '.join(others)} and {last}" if others else last


def in_lines(name: str) -> str:
    """What stands in a figure for a detector's long name: a combination takes two lines.

    Examples
    --------
    >>> in_lines("combined:mmpose+mediapipe-hands")
    'combined:mmpose\\n+mediapipe-hands'
    >>> in_lines("+ squares")
    '+ squares'
    """
    return re.sub(r"(?<=\w)\+", "\n+", name)


def series_text(values: pd.Series, pattern: str = "{} {:.2f}") -> str:
    """`in_words` of a series, each value put into a pattern after the labels of its index.

    Examples
    --------
    >>> series_text(pd.Series({"mediapipe": 0.514, "mmpose": 0.7}))
    'mediapipe 0.51 and mmpose 0.70'
    """
    keys = values.index.to_frame(index=False).itertuples(index=False, name=None)
    return in_words([pattern.format(*key, value) for key, value in zip(keys, values, strict=True)])

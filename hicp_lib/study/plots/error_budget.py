"""Figure of the error budget: each source alone, and what is gained without it."""

import pandas as pd

from hicp_lib.evaluation.space.error_budget import AGAINST_MOCAP, TOTALS
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import TRUTH_COLOUR
from hicp_lib.study.plots.style import Figure, in_style, in_words, new_figure, series_text

_COLOURS = {"paper": "#D55E00", "robust": "#0072B2"}
_HOLLOW = {"fmt": "D", "mfc": "white"}
_TOTALS_APART = 0.5  # rows


@in_style
def error_budget(table: pd.DataFrame, paper: pd.DataFrame, note: str) -> Figure:
    """A panel per part, a row per source: its error alone (filled), and what is gained without it (hollow).

    Parameters
    ----------
    table : pd.DataFrame
        As from `hicp_lib.evaluation.space.error_budget.error_budget`, one view.
    paper : pd.DataFrame
        The paper's medians against motion capture, columns `detector, keypoint, median_m`.
    note : str
        What the data are, for the caption.
    """
    parts, sources, methods = (list(table[name].unique()) for name in ("part", "source", "method"))
    figure, axes = new_figure(1, len(parts), 11.5, 5.0, sharey=True, squeeze=False)
    rows = {source: k + _TOTALS_APART * (source not in TOTALS) for k, source in enumerate(sources)}
    for axis, part in zip(axes[0], parts, strict=True):
        for (method, kind), of in table[table["part"] == part].groupby(["method", "kind"], sort=False):
            y = of["source"].map(rows) + marks.offset(methods.index(method), len(methods), 0.3)
            is_gain, bounds = kind == "gain", ("value_m", "low_m", "high_m")
            label = f"{method} lifting, {'gained without' if is_gain else 'alone'}"
            pen = {"color": _COLOURS[method], "label": label} | (_HOLLOW if is_gain else {})
            marks.dots(axis, of, y, bounds, 100, **pen)
        if AGAINST_MOCAP in rows:
            theirs_cm = 100 * paper.loc[paper["keypoint"].str.endswith(part), "median_m"]
            y = [rows[AGAINST_MOCAP]] * len(theirs_cm)
            axis.plot(theirs_cm, y, "|", color=TRUTH_COLOUR, markersize=13, label="the paper's medians")
        axis.set(title=f"{part}s", xlabel="error, or gain [cm]")
        axis.axvline(0, color="#888888", lw=0.8)
    axes[0, 0].set(yticks=[*rows.values()], yticklabels=[*rows], ylim=(max(rows.values()) + 0.6, -0.6))
    marks.legend_below(figure, axes, ncols=5)
    theirs = (
        f", against motion capture beside the medians of the paper's {in_words(paper['detector'].unique())}"
    )
    beside = theirs if AGAINST_MOCAP in rows else ""
    caption = (
        f"Error of keypoints by source, {table['n_people'].max()} people. Filled: all else true; hollow: "
        "what the error with everything falls by when this alone is true. Median of a person's keypoints, "
        f"mean over people with 95 % intervals; on top errors by many sources{beside}: {note}."
    )
    first = table[table["kind"] == "alone"].sort_values("value_m", ascending=False)
    first = first.drop_duplicates(["part", "method"]).set_index(["part", "method", "source"])["value_m"]
    said = series_text(100 * first, "{}s, {} lifting: {} with {:.1f} cm")
    return Figure(figure, caption, f"Dots per part and source. Largest alone: {said}.", table)

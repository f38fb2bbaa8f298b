"""Figure of the error budget: each source alone, and what is gained without it."""

import pandas as pd

from hicp_lib.evaluation.space.error_budget import AGAINST_MOCAP, TOTALS
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import TRUTH_COLOUR
from hicp_lib.study.plots.style import Figure, in_style, in_words, new_figure, series_text

_COLOURS = {"paper": "#D55E00", "robust": "#0072B2"}
_MARKS = {"alone": {"fmt": "o"}, "gain": {"fmt": "D", "mfc": "white"}}
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
    parts, sources = list(table["part"].unique()), list(table["source"].unique())
    figure, axes = new_figure(1, len(parts), 11.5, 5.0, sharey=True, squeeze=False)
    rows = {source: k + _TOTALS_APART * (source not in TOTALS) for k, source in enumerate(sources)}
    for axis, part in zip(axes[0], parts, strict=True):
        of_part = table[table["part"] == part]
        for k, (method, of) in enumerate(of_part.groupby("method", sort=False)):
            y = of["source"].map(rows) + marks.offset(k, 2, 0.3)
            _draw(axis, of, y, "alone", method)
            _draw(axis, of[~of["source"].isin(TOTALS)], y, "gain", method)
        theirs_m = paper.loc[paper["keypoint"].str.endswith(part), "median_m"]
        style = {
            "color": TRUTH_COLOUR,
            "marker": "|",
            "markersize": 13,
            "ls": "",
            "label": "the paper's medians",
        }
        axis.plot(100 * theirs_m, [rows.get(AGAINST_MOCAP, 0)] * len(theirs_m), **style)
        axis.set(title=f"{part}s", xlabel="error, or gain [cm]")
        axis.axvline(0, color="#888888", lw=0.8)
    axes[0, 0].set(yticks=list(rows.values()), yticklabels=list(rows), ylim=(max(rows.values()) + 0.6, -0.6))
    marks.legend_below(figure, axes, ncols=5)
    caption = (
        f"Error of keypoints by source, {table['n_people'].max()} people. Filled: all else true; hollow: "
        "what the error with everything falls by when this alone is true. Median of a person's keypoints, "
        "mean over people with 95 % intervals; on top errors by many sources, against motion capture beside "
        f"the medians of the paper's {in_words(paper['detector'].unique())}: {note}."
    )
    first = table[~table["source"].isin(TOTALS)].sort_values("alone_m", ascending=False)
    first = first.groupby(["part", "method"], sort=False).first()
    said = series_text(
        first.set_index("source", append=True)["alone_m"] * 100, "{}s, {} lifting: {} with {:.1f} cm"
    )
    return Figure(figure, caption, f"Dots per part and source. Largest alone: {said}.", table)


def _draw(axis, of: pd.DataFrame, y: pd.Series, measure: str, method: str) -> None:
    """One kind of mark of one method, with intervals."""
    reach = 100 * marks.whiskers(of, *(f"{measure}{end}_m" for end in ("", "_low", "_high")))
    label = f"{method} lifting, {'alone' if measure == 'alone' else 'gained without'}"
    pen = {"color": _COLOURS[method], "markersize": 5, "elinewidth": 1, "label": label}
    axis.errorbar(100 * of[f"{measure}_m"], y[of.index], xerr=reach, **_MARKS[measure], **pen)

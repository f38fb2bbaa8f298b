"""Figures of the combination: what each of its steps buys, and what scores are worth."""

import pandas as pd

from hicp_lib.evaluation.calibration.curves import N_BINS
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import SUBSET_COLOURS, detector_colour
from hicp_lib.study.plots.style import Figure, in_style, new_figure, texts

_MEASURES = {
    "AP": "average precision of hands", "step": "gain over the row above", "share": "share of hands found"
}  # fmt: skip
_GROUPS = {"hand": "hands"}


@in_style
def ingredients(table: pd.DataFrame, note: str) -> Figure:
    """Average precision, its gain step by step, and hands found, a row of panels for each body detector.

    Parameters
    ----------
    table : pd.DataFrame
        As from `compare_hands`, with a column `body`.
    note : str
        What the data are, for the caption.
    """
    variants, bodies = list(table["variant"].unique()), list(table["body"].unique())
    height_in = 0.7 + (0.7 + 0.36 * len(variants)) * len(bodies)
    shape = len(bodies), len(_MEASURES)
    figure, axes = new_figure(*shape, 10.5, height_in, sharey=True, sharex="col", squeeze=False)
    pens = {name: {"color": SUBSET_COLOURS.get(name), "label": name} for name in table["subset"].unique()}
    for row, body in zip(axes, bodies, strict=True):
        for axis, measure in zip(row, _MEASURES, strict=True):
            part, bounds = table[table["body"] == body], (measure, f"{measure}_low", f"{measure}_high")
            marks.dots_in_rows(axis, part, "variant", "subset", variants, pens, bounds=bounds)
        row[0].set_title(f"bodies by {body}", loc="left", fontsize=9)
        row[1].axvline(0, color="#888888", lw=1)
    for axis, label in zip(axes[-1], _MEASURES.values(), strict=True):
        axis.set(xlabel=label)
    for axis in axes[-1, ::2]:
        axis.set(xlim=(0, None))
    marks.name_rows(axes[0, 0], variants)
    marks.legend_below(figure, axes[0, 0])
    ends = table[table["variant"].isin([variants[0], variants[-1]])]
    return Figure(figure, *texts("ingredients", note=note, bodies=bodies, said=ends), table)


@in_style
def reliability_curves(curves: pd.DataFrame, errors: pd.DataFrame, min_term: float, note: str) -> Figure:
    """Hit rate against score, raw and calibrated, over the number of keypoints per bin of the score.

    Parameters
    ----------
    curves, errors : pd.DataFrame
        As from `calibration_study`.
    min_term : float
        What counts as a hit: the OKS term from which on.
    note : str
        What the data are, for the caption.
    """
    cases = list(dict.fromkeys(zip(curves["detector"], curves["group"], strict=True)))
    figure, axes = new_figure(
        2, len(cases), max(3.1 * len(cases), 6.0), 4.6, sharex=True, squeeze=False, sharey="row",
        height_ratios=[3, 1],
    )  # fmt: skip
    for column, (detector, group) in enumerate(cases):
        upper, lower = axes[:, column]
        rows = curves[(curves["detector"] == detector) & (curves["group"] == group)]
        _draw_curves(upper, lower, rows, detector_colour(detector))
        upper.set_title(f"{detector.removeprefix('combined:')}\n{_GROUPS.get(group, group)}", fontsize=8)
        lower.set(xlabel="score", xlim=(-0.02, 1.02))
    axes[0, 0].set(ylabel="share of hits", ylim=(-0.02, 1.02))
    axes[1, 0].set(ylabel="keypoints")
    marks.legend_below(figure, axes[0, 0])
    said = errors.replace({"group": _GROUPS})
    return Figure(figure, *texts("reliability_curves", min_term=min_term, note=note, said=said), curves)


def _draw_curves(upper, lower, rows: pd.DataFrame, colour: str) -> None:
    upper.plot([0, 1], [0, 1], "--", color="#888888", lw=1)
    for k, (kind, marker, fill) in enumerate((("raw", "o-", "white"), ("calibrated", "s-", colour))):
        part = rows[rows["scores"] == kind]
        pen = {"color": colour, "mfc": fill, "lw": 1, "elinewidth": 0.7, "markersize": 5, "label": kind}
        upper.errorbar(part["score"], part["rate"], marks.whiskers(part, "rate"), fmt=marker, **pen)
        x = (part["bin"] + 0.5) / N_BINS + marks.offset(k, 2, 0.04)
        lower.bar(x, part["count"], 0.036, color=fill, ec=colour)
    lower.grid(axis="x", visible=False)

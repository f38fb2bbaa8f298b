"""Figures of the combination: what each of its steps adds, and how often keypoints of a score are right."""

import pandas as pd

from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import detector_colour
from hicp_lib.study.plots.style import WIDTH_IN, Figure, in_lines, in_style, texts

_MEASURES = {"AP": "average precision of hands", "share": "share of hands found"}
_GROUPS = {"hand": "hands"}
_FEWEST = 30  # keypoints of a bin that is drawn


@in_style
def ingredients(table: pd.DataFrame, note: str) -> Figure:
    """Average precision of hands and hands found, step by step, a row of panels for each body detector.

    Parameters
    ----------
    table : pd.DataFrame
        As from `compare_hands`, with a column `body`.
    note : str
        What the data are, for the caption.
    """
    parts = [
        table.rename(columns={of: "value", f"{of}_low": "low", f"{of}_high": "high"}).assign(measure=of)
        for of in _MEASURES
    ]
    pens, by = marks.subset_dots(table["subset"].unique()), ["body", "measure"]
    figure, _, panels = marks.dot_chart(pd.concat(parts), "variant", "subset", pens, WIDTH_IN, by)
    for axis, _, body, measure in panels:
        axis.set(xlabel=_MEASURES[measure], xlim=(0, None))
        axis.set_title(f"bodies by {body}" if measure == "AP" else "")
        axis.label_outer()
    ends = table[table["variant"].isin(table["variant"].iloc[[0, -1]])]
    gains = ends.groupby(["body", "subset"], sort=False)["AP"].agg(["first", "last"]).reset_index()
    return Figure(figure, *texts("ingredients", note=note, said=gains), table)


@in_style
def reliability_curves(curves: pd.DataFrame, errors: pd.DataFrame, min_term: float, note: str) -> Figure:
    """Hit rate against score, raw and calibrated, for bins with enough keypoints.

    Parameters
    ----------
    curves, errors : pd.DataFrame
        As from `calibration_study`.
    min_term : float
        What counts as a hit: the OKS term from which on.
    note : str
        What the data are, for the caption.
    """
    names = curves["detector"].str.removeprefix("combined:").map(in_lines)
    rows = curves.assign(case=names + ":\n" + curves["group"].replace(_GROUPS))
    height_in = 2.5 * -(-rows["case"].nunique() // 2) + 0.5
    figure, axes, panels = marks.panels(rows, ["case"], WIDTH_IN, height_in, wrap=2, sharex=True, sharey=True)
    for axis, of_case, case in panels:
        colour = detector_colour(of_case["detector"].iloc[0])
        _draw_curves(axis, of_case[of_case["count"] >= _FEWEST], colour)
        axis.set_title(case, fontsize=8)
        axis.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02), xlabel="score", ylabel="share of hits")
        axis.label_outer()
    marks.legend_below(figure, axes[0, 0])
    told = {"min_term": min_term, "fewest": _FEWEST, "said": errors.replace({"group": _GROUPS})}
    return Figure(figure, *texts("reliability_curves", note=note, **told), curves)


def _draw_curves(axis, rows: pd.DataFrame, colour: str) -> None:
    axis.plot([0, 1], [0, 1], "--", color="#888888", lw=1)
    for kind, marker, fill in (("raw", "o-", "white"), ("calibrated", "s-", colour)):
        part = rows[rows["scores"] == kind]
        pen = {"color": colour, "mfc": fill, "lw": 1, "elinewidth": 0.7, "markersize": 5, "label": kind}
        axis.errorbar(part["score"], part["rate"], marks.whiskers(part, "rate"), fmt=marker, **pen)

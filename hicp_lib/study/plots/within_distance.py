"""Figures of the share of images in which keypoints were found within a distance: curves and bars.

Tables are those of `hicp_lib.evaluation.space.stability.within_distance`, with one reference; or like them.
"""

from collections.abc import Sequence
from typing import Any

import pandas as pd

from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import detector_colour
from hicp_lib.study.plots.style import TEXTS, Figure, in_style, texts
from hicp_lib.study.table_format import intervals_over

_METHOD_LINES = {"robust": "-", "paper": ":"}
# Darker is closer.
_FADES = (1.0, 0.62, 0.34)


@in_style
def within_curves(table: pd.DataFrame, marked_m: Sequence[float], note: str) -> Figure:
    """Share of images over the distance, left and right together, for every view, detector and method.

    Parameters
    ----------
    table : pd.DataFrame
        At many thresholds.
    marked_m : sequence of float
        Distances marked in grey; the alt text gives the shares at the middle one.
    note : str
        What the data are, for the caption.
    """
    table = table.assign(kind=table["part"].str.split().str[1])
    size = max(2.6 * table["kind"].nunique(), 6), 0.7 + 2.4 * table["view"].nunique()
    figure, axes, panels = marks.panels(table, ["view", "kind"], *size, sharex=True, sharey=True)
    for axis, rows, view, kind in panels:
        curves = rows.groupby(["detector", "method", "threshold_m"], sort=False)["value"].mean()
        for (detector, method), curve in curves.groupby(level=[0, 1], sort=False):
            pen = {"color": detector_colour(detector), "lw": 1.8, "label": f"{detector}, {method}"}
            distance_cm = 100 * curve.index.get_level_values("threshold_m")
            axis.plot(distance_cm, curve, _METHOD_LINES.get(method, "--"), **pen)
        axis.vlines([100 * distance for distance in marked_m], 0, 1, color="#AAAAAA", lw=0.8)
        axis.set(title=f"{view} · {kind}s", ylim=(0, 1.02), xlim=(0, None))
        axis.set(xlabel="distance [cm]", ylabel="share of images")
        axis.label_outer()
    marks.legend_below(figure, axes, ncols=3)
    return Figure(figure, *texts("within_curves", **_told(table, marked_m), note=note), table)


@in_style
def within_bars(table: pd.DataFrame, note: str) -> Figure:
    """Share of images per view, keypoint and detector, the darker the closer; `table` of one method."""
    parts, detectors = (list(table[column].unique()) for column in ("part", "detector"))
    width, limits_m = 0.84 / len(detectors), sorted(set(table["threshold_m"]))
    size = 10.5, 0.9 + 2.5 * table["view"].nunique()
    figure, axes, panels = marks.panels(table, ["view", "reference"], *size, sharex=True, sharey=True)
    for axis, of_view, view, _ in panels:
        for detector, rows in of_view.groupby("detector", sort=False):
            k = detectors.index(detector)
            x = rows["part"].map(parts.index) + marks.offset(k, len(detectors), width)
            _draw_bars(axis, rows.assign(x=x), 0.94 * width, detector_colour(detector))
        axis.set(title=view, ylabel="share of images", ylim=(0, 1.05))
        axis.set_xticks(range(len(parts)), parts)
        axis.grid(axis="x", visible=False)
    fades = zip(limits_m, _FADES, strict=True)
    shades = {f"within {100 * limit_m:g} cm": {"lw": 8, "alpha": fade} for limit_m, fade in fades}
    marks.add_keys(axes[0, 0], detectors, shades | {"found at all": {"ls": ":"}})
    marks.legend_below(figure, axes[0, 0])
    told = {"methods": list(table["method"].unique()), "intervals": intervals_over(table), "note": note}
    return Figure(figure, *texts("within_bars", **_told(table, limits_m), **told), table)


def _draw_bars(axis, rows: pd.DataFrame, width: float, colour: str) -> None:
    """Bars over each other, the widest distance first; an outline for found at any distance."""
    for rank, (_, level) in reversed(list(enumerate(rows.groupby("threshold_m")))):
        if rank == rows["threshold_m"].nunique() - 1:
            axis.bar(level["x"], level["found"], width, fill=False, edgecolor=colour, ls=":")
        axis.bar(level["x"], level["value"], width, color="white")
        axis.bar(level["x"], level["value"], width, color=colour, alpha=_FADES[rank])
        pen = {"fmt": "none", "ecolor": "black", "elinewidth": 0.8}
        axis.errorbar(level["x"], level["value"], marks.whiskers(level), **pen)


def _told(table: pd.DataFrame, marked_m: Sequence[float]) -> dict[str, Any]:
    """The reference, the marked distances, and mean shares over the parts of every case at the middle one."""
    middle_m = marked_m[len(marked_m) // 2]
    nearest_m = min(table["threshold_m"], key=lambda threshold: abs(threshold - middle_m))
    rows = table[table["threshold_m"] == nearest_m]
    means = rows.groupby(["detector", "view", "method"], sort=False)["value"].mean()
    return {
        "reference": TEXTS["references"][table["reference"].iloc[0]],
        "distances": [f"{100 * distance_m:g}" for distance_m in marked_m],
        "nearest_cm": 100 * nearest_m,
        "said": means,
    }

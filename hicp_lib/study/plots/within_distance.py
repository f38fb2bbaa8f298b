"""Figures of the share of images in which keypoints were found within a distance: curves and dots.

Tables are those of `hicp_lib.evaluation.space.stability.within_distance`; or like them.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import detector_colour, detector_marker
from hicp_lib.study.plots.style import COLUMN_IN, TEXTS, Figure, in_style, texts
from hicp_lib.study.table_format import intervals_over

_METHOD_LINES = {"robust": "-", "paper": ":"}


@in_style
def within_curves(table: pd.DataFrame, marked_m: Sequence[float], note: str) -> Figure:
    """Share of images over the distance, left and right together, for every view, detector and method.

    Parameters
    ----------
    table : pd.DataFrame
        At many thresholds, from one reference.
    marked_m : sequence of float
        Where the curves bear the detectors' marks; the alt text gives the shares at the middle one.
    note : str
        What the data are, for the caption.
    """
    table = table.assign(kind=table["part"].str.split().str[1] + "s")
    by = ["kind", "view"] if table["view"].nunique() > 1 else ["view", "kind"]
    height_in = 1.3 + 1.6 * table[by[0]].nunique()
    figure, axes, panels = marks.panels(table, by, COLUMN_IN, height_in, sharex=True, sharey=True)
    for axis, rows, *case in panels:
        curves = rows.groupby(["detector", "method", "threshold_m"], sort=False)["value"].mean()
        for (detector, method), curve in curves.groupby(level=[0, 1], sort=False):
            distance_m = curve.index.get_level_values("threshold_m").to_numpy()
            marked = np.flatnonzero(np.isclose(distance_m[:, None], marked_m).any(axis=1)).tolist()
            pen = {"color": detector_colour(detector), "marker": detector_marker(detector), "ms": 5.5}
            axis.plot(100 * distance_m, curve, ls=_METHOD_LINES.get(method, "--"), markevery=marked, **pen)
        axis.set(title=" · ".join(case) if by[0] == "kind" else case[1], ylim=(0, 1.04), xlim=(0, None))
        axis.set(xlabel="distance [cm]", ylabel="share of images")
        axis.label_outer()
    detectors, methods = table["detector"].unique(), table["method"].unique()
    keys = {name: {"color": detector_colour(name), "marker": detector_marker(name)} for name in detectors}
    lines = {f"{name} lifting": {"ls": _METHOD_LINES.get(name, "--")} for name in methods}
    marks.add_keys(axes[0, 0], (), keys | lines)
    marks.legend_below(figure, axes[0, 0])
    middle_m = marked_m[len(marked_m) // 2]
    rows = table[np.isclose(table["threshold_m"], middle_m)]
    means = rows.groupby(["detector", "view", "method"], sort=False)["value"].mean()
    distances = [f"{100 * distance_m:g}" for distance_m in marked_m]
    reference = TEXTS["references"][table["reference"].iloc[0]]
    told = {"reference": reference, "distances": distances, "said": means}
    told |= {"nearest_cm": 100 * middle_m, "ends": means.iloc[[means.argmax(), means.argmin()]]}
    return Figure(figure, *texts("within_curves", **told, note=note), table)


@in_style
def within_dots(table: pd.DataFrame, method: str, note: str) -> Figure:
    """Share of images within one distance per keypoint and detector; views down, references across.

    Parameters
    ----------
    table : pd.DataFrame
        From one reference or several; the middle one of its thresholds is drawn.
    method : str
        The lifting that is drawn.
    note : str
        What the data are, for the caption.
    """
    limits_m = sorted(set(table["threshold_m"]))
    limit_m = limits_m[len(limits_m) // 2]
    rows = table[(table["threshold_m"] == limit_m) & (table["method"] == method)]
    pens, by = marks.detector_dots(rows["detector"].unique()), ["view", "reference"]
    figure, _, panels = marks.dot_chart(rows, "part", "detector", pens, COLUMN_IN, by)
    for axis, _, view, reference in panels:
        label = f"within {100 * limit_m:g} cm of {TEXTS['references'][reference]}"
        axis.set(title=f"{view} · {TEXTS['aims'][reference]}", xlabel=label, xlim=(-0.04, 1.04))
        axis.label_outer()
    means = rows.groupby(["detector", "view", "reference"], sort=False)["value"].mean()
    told = {"method": method, "limit_cm": 100 * limit_m, "intervals": intervals_over(table), "note": note}
    told["ends"] = means.iloc[[means.argmax(), means.argmin()]]
    return Figure(figure, *texts("within_dots", **told, said=means), table)

"""Figures of doses: what was varied, and how detection falls with it."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.images import read_image
from hicp_lib.formats.annotations import Annotations
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import detector_colour, detector_marker
from hicp_lib.study.plots.people import draw_detections, picture_grid
from hicp_lib.study.plots.style import TEXTS, WIDTH_IN, Figure, in_style, texts

_LOGARITHMIC = ("light", "resolution", "distance")
_GROUPS = {"body": "Bodies", "hand": "Hands"}


def level_text(dose: str, level: float) -> str:
    """A level of a dose in its unit.

    Examples
    --------
    >>> level_text("distance", 2.5), level_text("light", 0.05)
    ('2.5 m', '5%')
    """
    return TEXTS["levels"].get(dose, "{:.0%}").format(level)


@in_style
def dose_pictures(
    annotations: Annotations, folder: Path, found: Mapping[str, Mapping[int, Detections]], person: int = 1
) -> Figure:
    """Pictures of one person with what was detected, a row for each dose, five levels of each.

    Parameters
    ----------
    annotations : Annotations
        Of the doses' pictures; they say person, dose and level.
    folder : Path
        Holds `images`.
    found : mapping of str to mapping of int to Detections
        By image id, of every detector.
    person : int
        The last, if there are fewer.
    """
    extras = pd.DataFrame(annotations.extras).assign(image_id=annotations.image_ids)
    is_shown = extras["source_image_id"] == min(person, extras["source_image_id"].max())
    detectors = list(marks.own_bodies(pd.DataFrame({"detector": list(found)}))["detector"])
    rows: dict[str, list] = {}
    titles, n_found = [], dict.fromkeys(detectors, 0)
    for dose, levels in extras[is_shown].groupby("dose", sort=False):
        for k in np.unique(np.linspace(0, len(levels) - 1, 5).round().astype(int)):
            image_id, level = int(levels["image_id"].iloc[k]), levels["level"].iloc[k]
            image = read_image(Path(folder) / "images" / annotations.images[image_id].file_name)
            times = max(1, 320 // max(image.shape))  # coarse pixels, fine lines
            image = image.repeat(times, axis=0).repeat(times, axis=1)
            for detector in detectors:
                people = found[detector].get(image_id, Detections.none())
                points_px = (people.keypoints_px + 0.5) * times - 0.5
                image = draw_detections(image, replace(people, keypoints_px=points_px), detector)
                n_found[detector] += len(people) > 0
            rows.setdefault(dose, []).append(image)
            titles.append(level_text(dose, level))
    told = texts("dose_pictures", doses=list(rows), n=len(titles), seen=pd.Series(n_found))
    drawn = picture_grid(list(rows.values()), *told, list(rows), titles, cell_in=1, title_pt=8)
    marks.add_keys(drawn.figure.axes[0], detectors, {})
    marks.legend_below(drawn.figure, drawn.figure.axes[0])
    return drawn


@in_style
def dose_curves(table: pd.DataFrame, group: str, measure: str = "AP", note: str = "") -> Figure:
    """AP, or another measure, against each dose.

    Parameters
    ----------
    table : pd.DataFrame
        As from `hicp_lib.evaluation.failures.dose_curves.dose_curves`, or from
        `hicp_lib.study.observed.observed_curves`.
    group : {"body", "hand"}
        Of keypoints.
    measure : str, optional
        Of those in the table.
    note : str, optional
        What the data are, for the caption of what was observed and not varied.
    """
    table = table[table["group"] == group]
    rows = table[table["measure"] == measure].astype({"low": float, "high": float})
    rows = marks.own_bodies(rows) if group == "body" else rows
    height_in = 1.9 * -(-rows["dose"].nunique() // 2) + 0.5
    figure, axes, panels = marks.panels(rows, ["dose"], WIDTH_IN, height_in, wrap=2, sharey=True)
    for axis, of_dose, dose in panels:
        for detector, part in of_dose.groupby("detector", sort=False):
            part, colour = part.sort_values("level"), detector_colour(detector)
            pen = {"marker": detector_marker(detector), "ms": 5, "label": detector}
            axis.plot(part["level"], part["value"], color=colour, **pen)
            axis.fill_between(part["level"], part["low"], part["high"], color=colour, alpha=0.13, lw=0)
        axis.set(ylim=(-0.03, 1.03))
        axis.set_xlabel(TEXTS["doses"].get(dose, dose), fontsize=9)
        if dose in _LOGARITHMIC:
            ticks = np.unique(of_dose["level"])
            axis.set_xscale("log")
            axis.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
            axis.minorticks_off()
    label = "average precision" if measure == "AP" else f"share of {measure}"
    figure.supylabel(label, fontsize=10)
    marks.legend_below(figure, axes[0, 0])
    known = rows.dropna(subset="value")
    lowest = known.loc[known.groupby("detector", sort=False)["value"].idxmin()]
    told = {"measure": label, "group": _GROUPS[group], "said": lowest, "note": note}
    return Figure(figure, *texts("observed_curves" if note else "dose_curves", **told), table)


@in_style
def flicker_rates(table: pd.DataFrame, note: str) -> Figure:
    """Flicker rate and jitter as detected and filtered; `table` from `flicker.flicker`."""
    measures = {"flicker rate": 100, "jitter [px]": 1}
    rows = marks.own_bodies(table)
    detectors = list(rows["detector"].unique())
    figure, axes, panels = marks.panels(
        rows[rows["measure"].isin(measures)], ["measure"], WIDTH_IN, 1.2 + 0.5 * len(detectors), sharey=True
    )
    for axis, of_measure, measure in panels:
        for name, pen in marks.detector_dots(detectors).items():
            part = of_measure[of_measure["detector"] == name].sort_values("tracks")
            for y, (_, row), fill in zip(
                (-0.13, 0.13), part.groupby("tracks"), ({}, {"mfc": "white"}), strict=True
            ):
                marks.dots(axis, row, detectors.index(name) + y, factor=measures[measure], **pen | fill)
        axis.set(xlabel=measure.replace("rate", "rate [%]"), xlim=(0, None))
    marks.name_rows(axes[0, 0], detectors)
    cases = rows.set_index(["tracks", "measure", "detector"])["value"].sort_index()
    lag_ms, rates = 1000 * cases["filtered", "latency [s]"], 100 * cases["as detected", "flicker rate"]
    return Figure(figure, *texts("flicker_rates", note=note, lags=lag_ms, said=rates), table)

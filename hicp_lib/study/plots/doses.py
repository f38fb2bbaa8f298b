"""Figures of doses: what was varied, and how detection falls with it."""

from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.images import read_image
from hicp_lib.formats.annotations import Annotations
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import detector_colour, detector_marker
from hicp_lib.study.plots.people import picture_grid
from hicp_lib.study.plots.style import TEXTS, Figure, in_lines, in_style, new_figure, texts

_UNITS = {"distance": " m", "resolution": " px"}
_LOGARITHMIC = ("light", "resolution", "distance")
_SUBSET_STYLES = {"basic": "-", "headless": "--", "close": ":"}


def dose_pictures(annotations: Annotations, folder: Path, person: int = 0) -> Figure:
    """Every picture of one person, a row for each dose.

    Parameters
    ----------
    annotations : Annotations
        Of the doses' pictures; they say person, dose and level.
    folder : Path
        Holds `images`.
    person : int
    """
    rows: dict[str, list] = {}
    for image_id, extra in zip(annotations.image_ids.tolist(), annotations.extras, strict=True):
        if extra["source_image_id"] == person:
            image = read_image(Path(folder) / "images" / annotations.images[image_id].file_name)
            rows.setdefault(extra["dose"], []).append((extra["level"], image))
    drawn = [[image for _, image in pictures] for pictures in rows.values()]
    said = texts("dose_pictures", doses=list(rows))
    figure = picture_grid(drawn, *said, row_titles=list(rows), cell_in=1.5)
    columns = max(len(pictures) for pictures in rows.values())
    for i, (dose, pictures) in enumerate(rows.items()):
        for j, (level, _) in enumerate(pictures):
            title = f"{level:g}{_UNITS.get(dose, '')}"
            figure.figure.axes[i * columns + j].set_title(title, loc="center", fontsize=7, pad=2)
    return figure


@in_style
def dose_curves(table: pd.DataFrame, group: str) -> Figure:
    """AP and hits of visible keypoints against each dose; `table` from `dose_curves.dose_curves`.

    The numbers behind it have hits of hidden keypoints as well.
    """
    table = table[table["group"] == group]
    rows = table[table["measure"] != "hidden keypoints hit"]
    styles = dict.fromkeys(rows["measure"], ":") | {"AP": "-"}
    labels = {measure: f", {measure}" for measure in styles} | {"AP": ""}
    figure, axes = _dose_panels(rows, "measure", styles, labels, "AP, share of hits")
    marks.legend_below(figure, axes[0, 0], ncols=2)
    for axis, (dose, part) in zip(axes.flat, rows.groupby("dose", sort=False), strict=False):
        if dose in _LOGARITHMIC:
            ticks = np.unique(part["level"])
            axis.set_xscale("log")
            axis.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
            axis.minorticks_off()
    lows = rows[rows["measure"] == "AP"].groupby(["detector", "dose"], sort=False)["value"].min()
    return Figure(figure, *texts("dose_curves", said=lows), table)


@in_style
def observed_curves(table: pd.DataFrame, note: str) -> Figure:
    """Hit rate against doses as the data set has them; `table` from `dose_curves.observed_curves`."""
    subsets = table["subset"].unique()
    styles = dict.fromkeys(subsets, "-.") | _SUBSET_STYLES
    labels = {subset: f", {subset}" for subset in subsets}
    figure, axes = _dose_panels(table, "subset", styles, labels, "share of hits")
    marks.legend_below(figure, axes[0, 0], ncols=3)
    spread = table.groupby(["detector", "dose"], sort=False)["value"].agg(np.ptp)
    return Figure(figure, *texts("observed_curves", note=note, said=spread), table)


def _dose_panels(table: pd.DataFrame, by: str, styles: dict, labels: dict, ylabel: str):
    """A panel per dose, with a line and its interval for each detector and value of the column `by`."""
    doses = table["dose"].unique()
    columns = min(len(doses), 3)
    rows = -(-len(doses) // columns)
    figure, axes = new_figure(rows, columns, 3.7 * columns, 2.9 * rows + 0.5, sharey=True, squeeze=False)
    for axis, dose in zip(axes.flat, doses, strict=False):
        lines = table[table["dose"] == dose].groupby(["detector", by], sort=False)
        for (detector, value), part in lines:
            part, colour = part.sort_values("level"), detector_colour(detector)
            pen = {"color": colour, "ls": styles[value], "label": f"{detector}{labels[value]}"}
            axis.plot(part["level"], part["value"], marker=detector_marker(detector), ms=4, **pen)
            bounds = part[["low", "high"]].astype(float)  # objects where there is no interval at all
            axis.fill_between(part["level"], bounds["low"], bounds["high"], color=colour, alpha=0.13, lw=0)
        axis.set(xlabel=TEXTS["doses"].get(dose, dose), ylim=(-0.02, 1.02))
    for axis in axes.flat[len(doses) :]:
        axis.set_axis_off()
    for axis in axes[:, 0]:
        axis.set(ylabel=ylabel)
    return figure, axes


@in_style
def flicker_rates(table: pd.DataFrame, note: str) -> Figure:
    """Flicker rate and jitter as detected and filtered; `table` from `flicker.flicker`."""
    measures = ("flicker rate", "jitter [px]")
    detectors = list(table["detector"].unique())[::-1]
    figure, axes = new_figure(1, len(measures), 9.0, 1.3 + 0.55 * len(detectors), sharey=True)
    cases = {case: rows.set_index("detector") for case, rows in table.groupby(["tracks", "measure"])}
    for axis, measure in zip(axes, measures, strict=True):
        for y, (name, pen) in enumerate(marks.detector_dots(detectors).items()):
            marks.dots(axis, cases["as detected", measure].loc[[name]], y + 0.13, **pen)
            marks.dots(axis, cases["filtered", measure].loc[[name]], y - 0.13, **pen | {"mfc": "white"})
        axis.set(xlabel=measure, xlim=(0, None), ylim=(-0.5, len(detectors) - 0.5))
    axes[0].set(yticks=range(len(detectors)), yticklabels=list(map(in_lines, detectors)))
    lag_ms = 1000 * cases["filtered", "latency [s]"]["value"]
    rates = cases["as detected", "flicker rate"]["value"]
    return Figure(figure, *texts("flicker_rates", note=note, lags=lag_ms, said=rates), table)

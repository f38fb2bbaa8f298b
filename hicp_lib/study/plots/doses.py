"""Figures of doses: what was varied, and how detection falls with it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.images import read_image
from hicp_lib.formats.annotations import Annotations
from hicp_lib.study.plots.people import picture_grid
from hicp_lib.study.plots.style import Figure, detector_colour, in_style, in_words, new_figure

_LABELS = {
    "distance": "distance [m]",
    "light": "share of the light",
    "hidden": "share of the height hidden, from below",
    "resolution": "height of the picture [px]",
    "upper part": "share of the height seen, from above",
    "lower part": "share of the height seen, from below",
    "share of keypoints in the picture": "share of keypoints in the picture",
    "picture": "size of the picture [px, square root of its area]",
    "share of keypoints hidden": "share of keypoints hidden",
    "distance to the border": "distance to the border [of the shorter side]",
    "brightness": "mean brightness [of 255]",
}
_UNITS = {"distance": " m", "resolution": " px"}
_LOGARITHMIC = ("light", "resolution", "distance")
_SUBSET_STYLES = {"basic": "-", "headless": "--", "close": ":"}


def dose_pictures(annotations: Annotations, folder: Path, person: int = 0) -> Figure:
    """Every picture of one person, a row for each dose."""
    rows: dict[str, list] = {}
    for image_id, extra in zip(annotations.image_ids.tolist(), annotations.extras, strict=True):
        if extra["source_image_id"] == person:
            image = read_image(Path(folder) / "images" / annotations.images[image_id].file_name)
            rows.setdefault(extra["dose"], []).append((extra["level"], image))
    figure = picture_grid(
        [[image for _, image in pictures] for pictures in rows.values()],
        row_titles=list(rows), cell_in=1.5,
        caption="The pictures of one person, rendered: one thing varied in each row, the rest the same.",
        alt=f"Rows of pictures of one person: {in_words(list(rows))}.",
    )  # fmt: skip
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
    doses = list(dict.fromkeys(rows["dose"]))
    figure, axes = _panels(len(doses), "AP, share of hits")
    for axis, dose in zip(axes.flat, doses, strict=False):
        for (detector, measure), part in rows[rows["dose"] == dose].groupby(
            ["detector", "measure"], sort=False
        ):
            solid = measure == "AP"
            label = detector if solid else f"{detector}, {measure}"
            _line(axis, part.sort_values("level"), detector, "-" if solid else ":", label)
        if dose in _LOGARITHMIC:
            ticks = sorted(rows.loc[rows["dose"] == dose, "level"].unique())
            axis.set_xscale("log")
            axis.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
            axis.minorticks_off()
        axis.set(xlabel=_LABELS.get(dose, dose), ylim=(-0.02, 1.02))
    handles, labels = axes.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, fontsize=9)
    caption = (
        "Detection against dose, one thing varied and the rest fixed: average precision (solid) and the "
        "share of visible keypoints hit (dotted), with 95 % bootstrap intervals over people. Rendered "
        "people."
    )
    lows = rows[rows["measure"] == "AP"].groupby(["detector", "dose"], sort=False)["value"].min()
    said = [f"{detector} {value:.2f} for {dose}" for (detector, dose), value in lows.items()]
    return Figure(figure, caption, f"Curves per dose. Lowest average precision: {in_words(said)}.", table)


@in_style
def observed_curves(table: pd.DataFrame, note: str) -> Figure:
    """Hit rate against doses as the data set has them; `table` from `dose_curves.observed_curves`."""
    doses = list(dict.fromkeys(table["dose"]))
    figure, axes = _panels(len(doses), "share of hits")
    for axis, dose in zip(axes.flat, doses, strict=False):
        for (subset, detector), part in table[table["dose"] == dose].groupby(
            ["subset", "detector"], sort=False
        ):
            style = _SUBSET_STYLES.get(subset, "-.")
            _line(axis, part.sort_values("level"), detector, style, f"{detector}, {subset}")
        axis.set(xlabel=_LABELS.get(dose, dose), ylim=(-0.02, 1.02))
    handles, labels = axes.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=9)
    caption = (
        "Share of labelled body keypoints hit, by fifths of what the data set happens to hold of each "
        f"dose, with 95 % bootstrap intervals over source images: {note}."
    )
    spread = table.groupby(["detector", "dose"], sort=False)["value"].agg(np.ptp)
    said = [f"{detector} {value:.2f} for {dose}" for (detector, dose), value in spread.items()]
    return Figure(figure, caption, f"Curves per dose. Range of the hit rate: {in_words(said)}.", table)


def _panels(n: int, label: str):
    columns = min(n, 3)
    rows = -(-n // columns)
    figure, axes = new_figure(rows, columns, 3.7 * columns, 2.9 * rows + 0.5, sharey=True, squeeze=False)
    for axis in axes.flat[n:]:
        axis.set_axis_off()
    for row in axes:
        row[0].set(ylabel=label)
    return figure, axes


def _line(axis, rows: pd.DataFrame, detector: str, style: str, label: str) -> None:
    colour = detector_colour(detector)
    axis.plot(rows["level"], rows["value"], style, marker="o", ms=3.5, color=colour, label=label)
    axis.fill_between(rows["level"], rows["low"], rows["high"], color=colour, alpha=0.13, lw=0)


@in_style
def flicker_rates(table: pd.DataFrame, note: str) -> Figure:
    """Flicker rate and jitter as detected and filtered; `table` from `flicker.flicker`."""
    measures = ("flicker rate", "jitter [px]")
    detectors = list(dict.fromkeys(table["detector"]))[::-1]
    figure, axes = new_figure(1, len(measures), 9.0, 1.3 + 0.55 * len(detectors), sharey=True)
    for axis, measure in zip(axes, measures, strict=True):
        for shift, kind, filled in ((0.13, "as detected", True), (-0.13, "filtered", False)):
            for y, detector in enumerate(detectors):
                case = (table["detector"] == detector) & (table["tracks"] == kind)
                row = table[case & (table["measure"] == measure)].iloc[0]
                colour = detector_colour(detector)
                axis.errorbar(
                    row["value"], y + shift, xerr=[[row["value"] - row["low"]], [row["high"] - row["value"]]],
                    fmt="o", color=colour, mfc=colour if filled else "white", capsize=2,
                )  # fmt: skip
        axis.set(xlabel=measure, xlim=(0, None), ylim=(-0.5, len(detectors) - 0.5))
    axes[0].set(yticks=range(len(detectors)), yticklabels=detectors)
    lag = table[(table["measure"] == "latency [s]") & (table["tracks"] == "filtered")]
    said = [f"{row.detector} {1000 * row.value:.0f} ms" for row in lag.itertuples()]
    caption = (
        "Keypoints that come and go between consecutive frames, and how far they jump, as detected "
        f"(filled) and through a causal filter (open), with 95 % bootstrap intervals over seconds: {note}. "
        f"Delay of the filter: {in_words(said)}."
    )
    rates = table[(table["measure"] == "flicker rate") & (table["tracks"] == "as detected")]
    said = [f"{row.detector} {row.value:.3f}" for row in rates.itertuples()]
    return Figure(figure, caption, f"Dots with whiskers. Flicker rate as detected: {in_words(said)}.", table)

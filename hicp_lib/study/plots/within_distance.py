"""Figures of the share of images in which keypoints were found within a distance: curves and bars.

Tables are those of `hicp_lib.evaluation.space.stability.within_distance`, with one reference.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from hicp_lib.study.plots.style import Figure, detector_colour, in_style, in_words, legend_entries, new_figure

_REFERENCES = {"median": "its median position", "truth": "its true position"}
_METHOD_LINES = {"robust": "-", "paper": ":"}
# Darker is closer.
_FADES = (1.0, 0.62, 0.34)


@in_style
def within_curves(table: pd.DataFrame, marked_m: Sequence[float], note: str) -> Figure:
    """Share of images over the distance, left and right together, for every view, detector and method.

    Parameters
    ----------
    table : at many thresholds
    marked_m : distances marked in grey; the alt text gives the shares at the middle one
    """
    table = table.assign(kind=table["part"].str.split().str[1])
    views, kinds = (list(dict.fromkeys(table[column])) for column in ("view", "kind"))
    size = {"width_in": max(2.6 * len(kinds), 6), "height_in": 0.7 + 2.4 * len(views)}
    figure, axes = new_figure(len(views), len(kinds), sharex=True, sharey=True, squeeze=False, **size)
    curves = table.groupby(["view", "kind", "detector", "method", "threshold_m"], sort=False)["value"].mean()
    for (view, kind, detector, method), curve in curves.groupby(level=[0, 1, 2, 3], sort=False):
        axes[views.index(view), kinds.index(kind)].plot(
            100 * curve.index.get_level_values("threshold_m"), curve, _METHOD_LINES.get(method, "--"),
            color=detector_colour(detector), lw=1.8, label=f"{detector}, {method}",
        )  # fmt: skip
    for view, row in zip(views, axes, strict=True):
        for kind, axis in zip(kinds, row, strict=True):
            axis.vlines([100 * distance for distance in marked_m], 0, 1, color="#AAAAAA", lw=0.8)
            axis.set(title=f"{view} · {kind}s", ylim=(0, 1.02), xlim=(0, None))
        row[0].set(ylabel="share of images")
    for axis in axes[-1]:
        axis.set(xlabel="distance [cm]")
    figure.legend(*legend_entries(axes), loc="outside lower center", ncols=3, fontsize=9)
    caption = (
        "Share of images in which a keypoint was found within a distance of "
        f"{_REFERENCES[table['reference'].iloc[0]]}, left and right together (solid: robust lifting, dotted: "
        f"the paper's; grey: the distances of the bars): {note}."
    )
    return Figure(figure, caption, f"Rising curves per detector. {_said(table, marked_m)}", table)


@in_style
def within_bars(table: pd.DataFrame, note: str) -> Figure:
    """Share of images per view, keypoint and detector, the darker the closer; `table` of one method."""
    views, parts = (list(dict.fromkeys(table[column])) for column in ("view", "part"))
    detectors, limits_m = list(dict.fromkeys(table["detector"])), sorted(set(table["threshold_m"]))
    size = {"width_in": 10.5, "height_in": 0.9 + 2.5 * len(views)}
    figure, axes = new_figure(len(views), 1, sharex=True, sharey=True, squeeze=False, **size)
    width = 0.84 / len(detectors)
    for view, axis in zip(views, axes[:, 0], strict=True):
        for k, detector in enumerate(detectors):
            rows = table[(table["view"] == view) & (table["detector"] == detector)]
            x = np.array([parts.index(part) for part in rows["part"]])
            _draw_bars(
                axis, rows.assign(x=x + (k - (len(detectors) - 1) / 2) * width), 0.94 * width,
                detector_colour(detector),
            )  # fmt: skip
        axis.set(title=view, ylabel="share of images", ylim=(0, 1.05))
        axis.set_xticks(range(len(parts)), parts)
        axis.grid(axis="x", visible=False)
    _bar_legend(figure, axes[0, 0], detectors, limits_m)
    caption = (
        f"Share of images in which a keypoint was found within {_in_cm(limits_m)} of "
        f"{_REFERENCES[table['reference'].iloc[0]]} (a hand: mean over its 21 keypoints; lifting: "
        f"{in_words(list(dict.fromkeys(table['method'])))}); whiskers are 95 % bootstrap intervals over "
        f"images: {note}."
    )
    return Figure(figure, caption, f"Bars per keypoint and detector. {_said(table, limits_m)}", table)


def _draw_bars(axis, rows: pd.DataFrame, width: float, colour: str) -> None:
    """Bars over each other, the widest distance first; an outline for found at any distance."""
    for rank, (_, level) in reversed(list(enumerate(rows.groupby("threshold_m")))):
        if rank == rows["threshold_m"].nunique() - 1:
            axis.bar(level["x"], level["found"], width, fill=False, edgecolor=colour, ls=":")
        axis.bar(level["x"], level["value"], width, color="white")
        axis.bar(level["x"], level["value"], width, color=colour, alpha=_FADES[rank])
        whiskers = np.abs(level[["low", "high"]].to_numpy().T - level["value"].to_numpy())
        axis.errorbar(level["x"], level["value"], yerr=whiskers, fmt="none", ecolor="black", elinewidth=0.8)


def _bar_legend(figure, axis, detectors: Sequence[str], limits_m: Sequence[float]) -> None:
    handles = [axis.bar([0], [0], color=detector_colour(name), label=name) for name in detectors]
    handles += [
        axis.bar([0], [0], color="#444444", alpha=fade, label=f"within {100 * limit_m:g} cm")
        for limit_m, fade in zip(limits_m, _FADES, strict=True)
    ]
    handles.append(axis.bar([0], [0], fill=False, edgecolor="#444444", ls=":", label="found at all"))
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=9)


def _in_cm(distances_m: Sequence[float]) -> str:
    return f"{in_words([f'{100 * distance:g}' for distance in distances_m])} cm"


def _said(table: pd.DataFrame, marked_m: Sequence[float]) -> str:
    """Mean share over the parts of every case, at the middle one of the marked distances."""
    middle_m = marked_m[len(marked_m) // 2]
    nearest_m = min(table["threshold_m"], key=lambda threshold: abs(threshold - middle_m))
    rows = table[table["threshold_m"] == nearest_m]
    means = rows.groupby(["detector", "view", "method"], sort=False)["value"].mean()
    said = [f"{detector} {view} {method} {value:.0%}" for (detector, view, method), value in means.items()]
    return f"Within {100 * nearest_m:.3g} cm, mean over parts: {in_words(said)}."

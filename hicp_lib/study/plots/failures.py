"""Figures of the failure analysis: classes of what is seen, kinds of error, the head, scores, worst cases."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.images import read_image
from hicp_lib.datasets.visibility import CLASSES
from hicp_lib.evaluation.failures.error_kinds import KINDS
from hicp_lib.evaluation.failures.placed_keypoints import STATES
from hicp_lib.formats.annotations import Annotations
from hicp_lib.study.plots.people import draw_people, picture_grid, visible_scores
from hicp_lib.study.plots.style import Figure, detector_colour, in_style, in_words, legend_entries, new_figure

_GROUPS = {"body": "Body (17 points)", "hand": "Hands (42 points)"}
_TRUTH_COLOUR = "#39D353"
_KIND_COLOURS = dict(
    zip(KINDS, ("#1B9E4B", "#9BD3A0", "#0072B2", "#CC79A7", "#D5272D", "#BDBDBD", "#5F5F5F"), strict=True)
)
_STATE_STYLES = dict(zip(STATES, (("-", "o"), ("--", "s"), (":", "^"), (":", "x")), strict=True))


def class_examples(
    classes: pd.DataFrame, truth: Mapping[str, Annotations], folders: Mapping[str, Path], note: str
) -> Figure:
    """The first crop of every class, with the labelled keypoints; `classes` from `people_classes`."""
    first = classes.drop_duplicates("class").set_index("class")
    names = [name for name in CLASSES if name in first.index]
    pictures = []
    for name in names:
        subset, image_id, annotation_id = first.loc[name, ["subset", "image_id", "annotation_id"]]
        people = truth[subset]
        image = read_image(Path(folders[subset]) / "images" / people.images[image_id].file_name)
        row = people.ids == annotation_id
        scores = visible_scores(people.visibility[row])
        pictures.append(draw_people(image, people.keypoints_px[row], scores, _TRUTH_COLOUR))
    columns = -(-len(names) // 2)
    rows = [pictures[start : start + columns] for start in range(0, len(pictures), columns)]
    figure = picture_grid(
        rows, caption=f"An example of each class, with its labelled keypoints: the first crop of it. {note}.",
        alt=f"One picture for each class: {in_words(names)}.", cell_in=2.1,
    )  # fmt: skip
    for axis, name in zip(figure.figure.axes, names, strict=False):
        axis.set_title(name, loc="center", fontsize=8)
    return figure


@in_style
def class_precision(table: pd.DataFrame, note: str) -> Figure:
    """Average precision and recall per class; `table` from `compare_classes`."""
    rows = table[table["metric"].isin(["AP", "AR"])]
    groups, detectors = (list(dict.fromkeys(rows[name])) for name in ("group", "detector"))
    names = [name for name in CLASSES if name in set(rows["class"])]
    figure, axes = new_figure(
        1, len(groups), 4.8 * len(groups) + 1, 1.3 + 0.42 * len(names), sharey=True, squeeze=False
    )
    for axis, group in zip(axes[0], groups, strict=True):
        of_group = rows[rows["group"] == group]
        for (detector, metric), part in of_group.groupby(["detector", "metric"], sort=False):
            below = 0.24 * (detectors.index(detector) - (len(detectors) - 1) / 2) + 0.09 * (metric == "AR")
            y = part["class"].map(names.index) + below
            _dots(axis, part, y, detector, filled=metric == "AP", label=f"{detector}, {metric}")
        _say_too_few(axis, names, set(of_group.loc[of_group["value"].isna(), "class"]))
        axis.set(xlabel="AP (filled), AR (open)", xlim=(-0.02, 1.02), title=_GROUPS.get(group, group))
    counts = rows[rows["group"] == groups[0]].drop_duplicates("class").set_index("class")["n_people"]
    labels = [f"{name} ({counts.get(name, 0)})" for name in names]
    axes[0, 0].set(yticks=range(len(names)), yticklabels=labels, ylim=(len(names) - 0.5, -0.5))
    _legend(figure, axes, ncols=2)
    caption = (
        "Average precision and recall (OKS .5:.95) by what the picture shows, with the number of people "
        f"whose body counts; all subsets together; 95 % bootstrap intervals over source images: {note}."
    )
    best = rows.query("group == 'body' and metric == 'AP'").dropna(subset="value")
    best = best.sort_values("value", ascending=False).groupby("class").head(1)
    said = [f"{row['detector']} {row['value']:.2f} for {row['class']}" for _, row in best.iterrows()]
    alt = f"Dots per class and detector. Best average precision for bodies: {in_words(said)}."
    return Figure(figure, caption, alt, rows)


def _say_too_few(axis, names: list[str], few: set[str]) -> None:
    """Words in the place of the classes with too few people."""
    behind = {"facecolor": "white", "edgecolor": "none", "pad": 1}
    for name in few:
        place = 0.02, names.index(name)
        axis.text(*place, "too few to judge", va="center", fontsize=8, color="#666666", bbox=behind)


def _dots(axis, rows: pd.DataFrame, y, detector: str, filled: bool = True, label: str = "") -> None:
    value, colour = rows["value"].to_numpy(float), detector_colour(detector)
    whiskers = np.abs(rows[["low", "high"]].to_numpy(float).T - value)
    axis.errorbar(
        value, y, xerr=whiskers, fmt="o", color=colour, mfc=colour if filled else "white",
        label=label or detector, capsize=2, ms=5,
    )  # fmt: skip


def _legend(figure, axes, **options) -> None:
    place = {"loc": "outside lower center", "ncols": 4, "fontsize": 9} | options
    figure.legend(*legend_entries(np.atleast_1d(axes)), **place)


def _detector_panels(table: pd.DataFrame, width_in: float, height_in: float, **shared):
    """The figure, its axes, and for each detector of a table its axis with its rows."""
    detectors = list(dict.fromkeys(table["detector"])) or ["none given"]
    size = width_in * len(detectors) + 0.8, height_in
    figure, axes = new_figure(1, len(detectors), *size, sharey=True, squeeze=False, **shared)
    for axis, detector in zip(axes[0], detectors, strict=True):
        axis.set_title(detector)
    rows = [table[table["detector"] == detector] for detector in detectors]
    return figure, axes[0], list(zip(axes[0], detectors, rows, strict=True))


@in_style
def error_kinds(table: pd.DataFrame, by: str, note: str) -> Figure:
    """Stacked shares of the kinds of error; `table` from `kind_shares` of one group of keypoints."""
    order = [name for name in CLASSES if name in set(table[by])] or list(dict.fromkeys(table[by]))
    figure, axes, panels = _detector_panels(table, 4.2, 1.5 + 0.36 * len(order))
    for axis, _, rows in panels:
        part = rows.pivot(index=by, columns="kind", values="share").reindex(order)
        left = np.zeros(len(part))
        for kind in KINDS:
            axis.barh(range(len(part)), part[kind], left=left, color=_KIND_COLOURS[kind], label=kind)
            left = left + part[kind].to_numpy()
        _say_too_few(axis, order, set(part.index[part.isna().all(axis=1)]))
        axis.set(xlabel="share of labelled keypoints", xlim=(0, 1))
        axis.grid(axis="y", visible=False)
    axes[0].set(yticks=range(len(order)), yticklabels=order, ylim=(len(order) - 0.5, -0.5))
    _legend(figure, axes, ncols=4)
    worst = table[(table["kind"] == "miss") & table["share"].notna()]
    said = [f"{row['detector']} {row['share']:.2f} on {row[by]}" for _, row in worst.iterrows()]
    caption = (
        "What becomes of labelled keypoints, by the kinds of error of Ronchi and Perona, and those that "
        f"are not given or belong to people who are not found: {note}."
    )
    return Figure(figure, caption, f"Stacked bars per {by}. Shares of misses: {in_words(said)}.", table)


@in_style
def head_change(table: pd.DataFrame, note: str) -> Figure:
    """Change of the hit rate of each keypoint when the head is cut off; from `change_per_keypoint`."""
    names, detectors = (list(dict.fromkeys(table[name])) for name in ("keypoint", "detector"))
    figure, axis = new_figure(1, 1, 7.5, 1.2 + 0.3 * len(names))
    for k, detector in enumerate(detectors):
        part = table[table["detector"] == detector].rename(columns={"change": "value"})
        y = part["keypoint"].map(names.index) + 0.24 * (k - (len(detectors) - 1) / 2)
        _dots(axis, part, y, detector)
    axis.axvline(0, color="#444444", lw=1)
    labels = [name.replace("_", " ") for name in names]
    axis.set(yticks=range(len(names)), yticklabels=labels, ylim=(len(names) - 0.5, -0.5))
    axis.set(xlabel="change of the share of keypoints hit, without the head")
    _legend(figure, axis)
    mean = table.groupby("detector", sort=False)["change"].mean()
    said = [f"{name} {value:+.2f}" for name, value in mean.items()]
    caption = (
        "Without the head: change of the share of keypoints hit, on the same keypoints of the same people, "
        f"with 95 % bootstrap intervals over source images: {note}."
    )
    return Figure(figure, caption, f"Dots per keypoint and detector. Mean change: {in_words(said)}.", table)


@in_style
def invented_heads(table: pd.DataFrame, note: str) -> Figure:
    """Where head keypoints are put when the head was cut off; `table` from `without_head.invented_heads`."""
    figure, axes, panels = _detector_panels(table, 4.0, 4.4, sharex=True)
    for axis, detector, rows in panels:
        dots = axis.scatter(rows["along"], rows["below"], c=rows["score"], s=14, vmin=0, vmax=1, alpha=0.8)
        axis.plot([0, 1, 1, 0, 0], [0, 0, 1, 1, 0], color="#444444", lw=1)
        axis.plot([0, 1], [0, 0], color="#D5272D", lw=2.5, label="where the head was cut off")
        axis.set(xlim=(-0.3, 1.3), ylim=(1.05, -0.6), title=f"{detector} ({len(rows)})")
        axis.set(xlabel="along the cut [of the picture]")
    axes[0].set(ylabel="below the cut [of the picture]")
    figure.colorbar(dots, ax=axes, label="score", shrink=0.8)
    _legend(figure, axes)
    beyond = table["below"] < 0
    said = [f"{d} {share:.2f}" for d, share in beyond.groupby(table["detector"], sort=False).mean().items()]
    caption = (
        "Noses, eyes and ears given in pictures whose head was cut off (square: the picture, turned so "
        f"that the cut is above), coloured by score: {note}."
    )
    return Figure(figure, caption, f"Scatter of places. Share put beyond the cut: {in_words(said)}.", table)


@in_style
def scores_by_state(table: pd.DataFrame, note: str) -> Figure:
    """Hit rate against score for visible, hidden and outside keypoints; from `scores_by_state`."""
    figure, axes, panels = _detector_panels(table, 4.2, 4.2)
    for axis, detector, of_detector in panels:
        for state, (line, marker) in _STATE_STYLES.items():
            rows = of_detector[of_detector["state"] == state].astype({"value": float})
            if rows.empty:
                continue
            whiskers = np.abs(rows[["low", "high"]].to_numpy(float).T - rows["value"].to_numpy())
            axis.errorbar(
                rows["score"], rows["value"], yerr=whiskers, ls=line, marker=marker, ms=5, capsize=2,
                color=detector_colour(detector), label=state,
            )  # fmt: skip
        axis.plot([0, 1], [0, 1], "--", color="#AAAAAA", lw=1)
        axis.set(xlim=(0, 1.02), ylim=(-0.02, 1.02), xlabel="score")
    axes[0].set(ylabel="share of hits")
    _legend(figure, axes)
    top = table[table["state"] == "outside"].groupby("detector", sort=False).tail(1)
    said = [f"{row.detector} {row.value:.2f} at {row.score:.2f}" for row in top.itertuples()]
    caption = (
        "What a score is worth by where the keypoint truly is: share of hits per fifth of the score, for "
        "keypoints that are visible, hidden, and outside the picture, with 95 % bootstrap intervals over "
        f"source images: {note}."
    )
    alt = f"Curves of hits against score. Highest scores outside the picture: {in_words(said)}."
    return Figure(figure, caption, alt, table)


def gallery(
    cases: pd.DataFrame,
    folders: Mapping[str, Path],
    truth: Mapping[str, Annotations],
    found: Mapping[tuple[str, str], Mapping[int, Detections]],
    note: str,
) -> Figure:
    """The worst cases, a row for each detector and kind of case; `cases` from `worst_cases`."""
    rows, titles = [], []
    for (detector, case), part in cases.groupby(["detector", "case"], sort=False):
        pictures = []
        for subset, image_id in part[["subset", "image_id"]].itertuples(index=False):
            people = truth[subset].take((truth[subset].image_ids == image_id) & ~truth[subset].is_crowd)
            image = read_image(Path(folders[subset]) / "images" / people.images[image_id].file_name)
            seen = visible_scores(people.visibility) * np.isin(np.arange(136), np.arange(26))
            image = draw_people(image, people.keypoints_px, seen, _TRUTH_COLOUR)
            detections = found[subset, detector].get(image_id, Detections.none())
            scores = detections.scores
            colour = detector_colour(detector)
            pictures.append(draw_people(image, detections.keypoints_px, scores, colour))
        rows.append(pictures)
        titles.append(f"{detector}\n{case}")
    return picture_grid(
        rows, row_titles=titles, cell_in=2.3,
        caption="The worst cases, by rule: the surest mistakes, and people whom no detection fits although "
        f"much of them is visible. Green: the truth (bodies); the detector's colour: what it found. {note}.",
        alt=f"Pictures of {len(cases)} cases with skeletons of truth and detection.",
    )  # fmt: skip

"""Figures of the failure analysis: classes of what is seen, kinds of error, the head, scores, worst cases."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.datasets.visibility import CLASSES, MIN_PEOPLE
from hicp_lib.evaluation.failures.error_kinds import KINDS
from hicp_lib.evaluation.failures.placed_keypoints import STATES
from hicp_lib.formats.annotations import Annotations
from hicp_lib.inspection.skeletons import draw_rings
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.evaluation import GROUP_TITLES
from hicp_lib.study.plots.palette import detector_colour
from hicp_lib.study.plots.people import draw_detections, draw_truth, picture_grid
from hicp_lib.study.plots.style import Figure, in_lines, in_style, new_figure, texts

_TRUTH_COLOUR = "#39D353"
_ONE_CROP = ["subset", "image_id", "annotation_id"]
_WORST = "The worst cases: the surest mistakes, and people in sight whom no detection fits"
_KIND_COLOURS = ("#1B9E4B", "#9BD3A0", "#0072B2", "#CC79A7", "#D5272D", "#BDBDBD", "#5F5F5F")
_KIND_STYLES = {kind: {"color": colour} for kind, colour in zip(KINDS, _KIND_COLOURS, strict=True)}
_STATE_STYLES = dict(zip(STATES, (("-", "o"), ("--", "s"), (":", "^"), (":", "x")), strict=True))


def class_examples(
    classes: pd.DataFrame, truth: Mapping[str, Annotations], folders: Mapping[str, Path], note: str
) -> Figure:
    """The first crop of every class, with the labelled keypoints.

    Parameters
    ----------
    classes : pd.DataFrame
        As from `people_classes`.
    truth : mapping of str to Annotations
        By subset.
    folders : mapping of str to Path
        The subsets' dataset folders.
    note : str
        What the data are, for the caption.
    """
    first = classes.drop_duplicates("class").set_index("class")
    names = [name for name in CLASSES if name in first.index]
    pictures = []
    for subset, image_id, annotation_id in first.loc[names, _ONE_CROP].itertuples(index=False):
        people, images_dir = truth[subset], Path(folders[subset]) / "images"
        pictures.append(draw_truth(people, images_dir, image_id, people.ids == annotation_id, _TRUTH_COLOUR))
    columns = -(-len(names) // 2)
    rows = [pictures[start : start + columns] for start in range(0, len(pictures), columns)]
    return picture_grid(rows, *texts("class_examples", note=note, names=names), titles=names, cell_in=2.1)


@in_style
def class_precision(table: pd.DataFrame, note: str) -> Figure:
    """Average precision and recall per class; `table` from `compare_classes`."""
    rows = table[table["metric"].isin(["AP", "AR"])]
    groups, detectors = (list(rows[name].unique()) for name in ("group", "detector"))
    names = [name for name in CLASSES if name in set(rows["class"])]
    size = 4.8 * len(groups) + 1, 1.3 + (0.1 + 0.16 * len(detectors)) * len(names)
    pens = {
        f"{name}, {metric}": pen | fill | {"label": f"{name}, {metric}"}
        for name, pen in marks.detector_dots(detectors).items()
        for metric, fill in (("AP", {}), ("AR", {"mfc": "white"}))
    }
    cases = rows.assign(case=rows["detector"] + ", " + rows["metric"])
    figure, axes, panels = marks.panels(cases, ["group"], *size, sharey=True)
    for axis, of_group, group in panels:
        marks.dots_in_rows(axis, of_group, "class", "case", names, pens)
        _say_too_few(axis, names, set(of_group.loc[of_group["value"].isna(), "class"]))
        axis.set(xlabel="AP (filled), AR (open)", xlim=(-0.02, 1.02), title=GROUP_TITLES.get(group, group))
    counts = rows[rows["group"] == groups[0]].drop_duplicates("class").set_index("class")["n_people"]
    marks.name_rows(axes[0, 0], [f"{name} ({counts.get(name, 0)})" for name in names])
    marks.legend_below(figure, axes, ncols=2)
    best = rows.query("group == 'body' and metric == 'AP'").dropna(subset="value")
    best = best.sort_values("value", ascending=False).groupby("class").head(1)
    return Figure(figure, *texts("class_precision", note=note, said=best), rows)


def _say_too_few(axis, names: list[str], few: set[str]) -> None:
    """Words in the place of the classes with too few people."""
    behind = {"facecolor": "white", "edgecolor": "none", "pad": 1}
    for y, name in enumerate(names):
        if name in few:
            axis.text(0.02, y, "too few to judge", va="center", fontsize=8, color="#666666", bbox=behind)


def _detector_panels(table: pd.DataFrame, width_in: float, height_in: float, **shared):
    """The figure, its axes, and for each detector of a table its axis with its rows."""
    size = width_in * table["detector"].nunique() + 0.8, height_in
    figure, (axes,), panels = marks.panels(table, ["detector"], *size, sharey=True, **shared)
    for axis, _, detector in panels:
        axis.set_title(in_lines(detector))
    return figure, axes, panels


@in_style
def error_kinds(table: pd.DataFrame, by: str, note: str) -> Figure:
    """Stacked shares of the kinds of error (Ronchi and Perona, ICCV 2017).

    Parameters
    ----------
    table : pd.DataFrame
        As from `kind_proportions`, of one group of keypoints.
    by : str
        Its column that names the bars.
    note : str
        What the data are, for the caption.
    """
    order = [name for name in CLASSES if name in set(table[by])] or list(dict.fromkeys(table[by]))
    figure, axes, panels = _detector_panels(table, 4.2, 1.5 + 0.36 * len(order))
    for axis, rows, _ in panels:
        part = rows.pivot(index=by, columns="kind", values="share").reindex(order)
        marks.stacked_bars(axis, part, _KIND_STYLES)
        _say_too_few(axis, order, set(part.index[part.isna().all(axis=1)]))
        axis.set(xlabel="share of labelled keypoints", xlim=(0, 1))
    marks.name_rows(axes[0], order)
    marks.legend_below(figure, axes)
    worst = table[(table["kind"] == "miss") & table["share"].notna()]
    misses = worst.set_index(["detector", by])["share"]
    return Figure(figure, *texts("error_kinds", note=note, by=by, said=misses), table)


@in_style
def head_change(table: pd.DataFrame, note: str) -> Figure:
    """Change of the hit rate of each keypoint when the head is cut off; from `change_per_keypoint`."""
    names, detectors = (list(table[name].unique()) for name in ("keypoint", "detector"))
    figure, axis = new_figure(1, 1, 7.5, 1.2 + (0.1 + 0.1 * len(detectors)) * len(names))
    pens, change = marks.detector_dots(detectors), ("change", "low", "high")
    marks.dots_in_rows(axis, table, "keypoint", "detector", names, pens, bounds=change)
    axis.axvline(0, color="#444444", lw=1)
    marks.name_rows(axis, [name.replace("_", " ") for name in names])
    axis.set(xlabel="change of the share of keypoints hit, without the head")
    marks.legend_below(figure, axis, ncols=2)
    changes = table.groupby("detector", sort=False)["change"].mean()
    return Figure(figure, *texts("head_change", note=note, said=changes), table)


@in_style
def hallucinated_heads(table: pd.DataFrame, note: str) -> Figure:
    """Where keypoints of a head are given that was cut off; `table` from `hallucinated_heads`."""
    figure, axes, panels = _detector_panels(table, 4.0, 4.4, sharex=True)
    for axis, rows, detector in panels:
        dots = axis.scatter(rows["along"], rows["below"], c=rows["score"], s=14, vmin=0, vmax=1, alpha=0.8)
        axis.plot([0, 1, 1, 0, 0], [0, 0, 1, 1, 0], color="#444444", lw=1)
        axis.plot([0, 1], [0, 0], color="#D5272D", lw=2.5, label="where the head was cut off")
        axis.set(xlim=(-0.3, 1.3), ylim=(1.05, -0.6), title=f"{in_lines(detector)} ({len(rows)})")
        axis.set(xlabel="along the cut [of the picture]")
    axes[0].set(ylabel="below the cut [of the picture]")
    figure.colorbar(dots, ax=axes, label="score", shrink=0.8)
    marks.legend_below(figure, axes)
    shares = (table["below"] < 0).groupby(table["detector"], sort=False).mean()
    return Figure(figure, *texts("hallucinated_heads", note=note, said=shares), table)


@in_style
def false_presence(table: pd.DataFrame, note: str) -> Figure:
    """Parts outside the picture that are given inside it, a panel per decision; from `false_presence`."""
    rows = table[table["n"] >= MIN_PEOPLE]
    rows = table if rows.empty else rows
    rows = rows.assign(row=rows["part"] + ", " + rows["subset"] + " (" + rows["n"].astype(str) + ")")
    names, detectors, decisions = (list(rows[name].unique()) for name in ("row", "detector", "decision"))
    size = 4.4 * len(decisions) + 1, 1.5 + (0.1 + 0.13 * len(detectors)) * len(names)
    figure, axes, panels = marks.panels(rows, ["decision"], *size, sharey=True)
    for axis, of_panel, decision in panels:
        marks.dots_in_rows(axis, of_panel, "row", "detector", names, marks.detector_dots(detectors))
        axis.set(xlim=(-0.02, 1.02), xlabel="share that is given all the same", title=decision)
    marks.name_rows(axes[0, 0], names)
    marks.legend_below(figure, axes, ncols=2)
    heads = rows[(rows["part"] == "head") & (rows["subset"] == "headless")]
    return Figure(figure, *texts("false_presence", note=note, said=heads), table)


@in_style
def scores_by_state(table: pd.DataFrame, note: str) -> Figure:
    """Hit rate against score for visible, hidden and outside keypoints; from `scores_by_state`."""
    figure, axes, panels = _detector_panels(table, 4.2, 4.2)
    for axis, of_detector, detector in panels:
        for state, (line, marker) in _STATE_STYLES.items():
            rows = of_detector[of_detector["state"] == state]
            if rows.empty:
                continue
            pen = {"ls": line, "marker": marker, "ms": 5, "capsize": 2, "color": detector_colour(detector)}
            axis.errorbar(rows["score"], rows["value"], marks.whiskers(rows), label=state, **pen)
        axis.plot([0, 1], [0, 1], "--", color="#AAAAAA", lw=1)
        axis.set(xlim=(0, 1.02), ylim=(-0.02, 1.02), xlabel="score")
    axes[0].set(ylabel="share of hits")
    marks.legend_below(figure, axes)
    top = table[table["state"] == "outside"].groupby("detector", sort=False).tail(1)
    return Figure(figure, *texts("scores_by_state", note=note, said=top), table)


def gallery(
    cases: pd.DataFrame,
    folders: Mapping[str, Path],
    truth: Mapping[str, Annotations],
    found: Mapping[tuple[str, str], Mapping[int, Detections]],
    note: str,
    what: str = _WORST,
) -> Figure:
    """Single cases, a row for each detector and kind of case.

    Parameters
    ----------
    cases : pd.DataFrame
        As from `worst_cases` or `lost_points`; a keypoint that is named is ringed where it truly is.
    folders : mapping of str to Path
        The subsets' dataset folders.
    truth : mapping of str to Annotations
        By subset.
    found : mapping of (str, str) to mapping of int to Detections
        By subset and detector, then by image id.
    note : str
        What the data are, for the caption.
    what : str, optional
        What the cases are, for the caption.
    """
    rows, titles = [], []
    for (detector, case), part in cases.groupby(["detector", "case"], sort=False):
        pictures = []
        columns = part.columns.intersection([*_ONE_CROP, "keypoint"])
        for subset, image_id, *point in part[columns].itertuples(index=False):
            people, images_dir = truth[subset], Path(folders[subset]) / "images"
            of_image = (people.image_ids == image_id) & ~people.is_crowd
            image = draw_truth(people, images_dir, image_id, of_image, _TRUTH_COLOUR, n_keypoints=26)
            found_in = found[subset, detector].get(image_id, Detections.none())
            ringed_px = people.keypoints_px[people.ids == point[0], point[1]] if point else np.zeros((0, 2))
            pictures.append(draw_rings(draw_detections(image, found_in, detector), ringed_px, 20))
        rows.append(pictures)
        titles.append(f"{in_lines(detector)}\n{case}")
    said = [" ".join(title.split()) for title in titles]
    told = texts("gallery", what=what, note=note, n=len(cases), rows=said)
    return picture_grid(rows, *told, row_titles=titles, cell_in=2.3)

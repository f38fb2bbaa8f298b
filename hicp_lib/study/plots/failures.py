"""Figures of the failure analysis: classes of what is seen, kinds of error, the head, scores, worst cases."""

import textwrap
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.images import read_image
from hicp_lib.datasets.visibility import CLASSES, MIN_PEOPLE
from hicp_lib.evaluation.cases import Found, Truth
from hicp_lib.evaluation.failures.error_kinds import HITS
from hicp_lib.evaluation.failures.without_head import HEAD_POINTS
from hicp_lib.formats.annotations import Annotations
from hicp_lib.inspection.skeletons import draw_rings
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.evaluation import GROUP_TITLES
from hicp_lib.study.plots.palette import STYLES, detector_colour
from hicp_lib.study.plots.people import draw_detections, draw_truth, picture_grid
from hicp_lib.study.plots.style import WIDTH_IN, Figure, in_lines, in_style, texts

_TRUTH_COLOUR = "#39D353"
_ONE_CROP = ["subset", "image_id", "annotation_id"]
_TITLES = ("detector", "case", "mistakes")  # what stands over a picture, but for what names its row
_BLIND = 0.05  # a class in which no detector has a higher AP is one that all are blind to


def class_examples(classes: pd.DataFrame, truth: Truth, folders: Mapping[str, Path], note: str) -> Figure:
    """The first crop of every class, with the labelled keypoints.

    Parameters
    ----------
    classes : pd.DataFrame
        As from `people_classes`.
    truth : Truth
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
    rows = [pictures[start : start + 3] for start in range(0, len(pictures), 3)]
    return picture_grid(rows, *texts("class_examples", note=note, names=names), titles=names, cell_in=1.9)


@in_style
def class_precision(table: pd.DataFrame, note: str) -> Figure:
    """Average precision per class; `table` from `compare_classes`."""
    table = table[table["metric"].isin(["AP", "AR"])]
    rows = table[table["metric"] == "AP"]
    rows = rows[(rows["group"] != "body") | rows.index.isin(marks.own_bodies(rows).index)]
    names = [name for name in CLASSES if name in set(rows["class"])]
    pens = marks.detector_dots(rows["detector"].unique())
    figure, axes, panels = marks.dot_chart(rows, "class", "detector", pens, WIDTH_IN, ["group"], names)
    for axis, of_group, group in panels:
        _say_too_few(axis, names, set(of_group.loc[of_group["value"].isna(), "class"]))
        axis.set(xlabel="average precision", xlim=(-0.03, 1.03))
        axis.set_title(GROUP_TITLES.get(group, group), fontsize=8)
    counts = rows.drop_duplicates("class").set_index("class")["n_people"]
    marks.name_rows(axes[0, 0], [textwrap.fill(f"{name} ({counts.get(name, 0)})", 22) for name in names])
    best = rows[rows["group"] == "body"].sort_values("value", ascending=False, kind="stable")
    best = best.dropna(subset="value").drop_duplicates("class")
    said = {"said": best[best["value"] >= _BLIND], "blind": list(best.loc[best["value"] < _BLIND, "class"])}
    return Figure(figure, *texts("class_precision", note=note, **said), table)


def _say_too_few(axis, names: list[str], few: set[str]) -> None:
    """Words in the place of the classes with too few people."""
    behind = {"facecolor": "white", "edgecolor": "none", "pad": 1}
    for y, name in enumerate(names):
        if name in few:
            axis.text(0.02, y, "too few to judge", va="center", fontsize=8, color="#666666", bbox=behind)


@in_style
def error_kinds(table: pd.DataFrame, by: str, note: str) -> Figure:
    """Stacked shares of the kinds of error (Ronchi and Perona, ICCV 2017), a panel per detector.

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
    rows = marks.own_bodies(table)
    height_in = 0.9 + (0.4 + 0.2 * len(order)) * rows["detector"].nunique()
    figure, axes, panels = marks.panels(rows, ["detector", "group"], WIDTH_IN, height_in, sharex=True)
    for axis, of_detector, detector, _ in panels:
        part = of_detector.pivot(index=by, columns="kind", values="share").reindex(order)
        marks.stacked_bars(axis, part, STYLES["error_kinds"])
        _say_too_few(axis, order, set(part.index[part.isna().all(axis=1)]))
        axis.set(xlim=(0, 1), title=in_lines(detector))
        marks.name_rows(axis, order)
    axes[-1, 0].set(xlabel="share of labelled keypoints")
    marks.legend_below(figure, axes)
    wrong = rows[~rows["kind"].isin(HITS)].assign(of=rows[by]).dropna(subset="share")
    worst = wrong.sort_values("share", ascending=False, kind="stable").drop_duplicates("detector")
    return Figure(figure, *texts("error_kinds", note=note, by=by, said=worst), table)


@in_style
def head_change(table: pd.DataFrame, note: str) -> Figure:
    """Change of the hit rate of each keypoint when the head is cut off; from `change_per_keypoint`."""
    rows = marks.own_bodies(table)
    rows = rows.assign(keypoint=rows["keypoint"].str.replace("_", " "))
    pens, change = marks.detector_dots(rows["detector"].unique()), ("change", "low", "high")
    figure, axes, _ = marks.dot_chart(rows, "keypoint", "detector", pens, WIDTH_IN, bounds=change)
    axes[0, 0].axvline(0, color="#444444", lw=1)
    axes[0, 0].set(xlabel="change of the share of keypoints hit, without the head")
    changes = rows.groupby("detector", sort=False)["change"].mean()
    return Figure(figure, *texts("head_change", note=note, said=changes), table)


@in_style
def invented_heads(heads: pd.DataFrame, folder: Path, truth: Annotations, found: Found, note: str) -> Figure:
    """Of each detector the person without a head to whom it gives the surest head, on a margin for it.

    Parameters
    ----------
    heads : pd.DataFrame
        As from `hicp_lib.evaluation.failures.without_head.hallucinated_heads`.
    folder : Path
        Dataset folder of Headless.
    truth : Annotations
        Of Headless.
    found : Found
        By subset and detector, then by image id.
    note : str
        What the data are, for the caption.
    """
    heads, pictures, titles = marks.own_bodies(heads), [], []
    scores = heads.groupby(["detector", "image_id"], sort=False)["score"].mean()
    for detector, image_id in scores.groupby("detector", sort=False).idxmax():
        image = read_image(Path(folder) / "images" / truth.images[image_id].file_name)
        people = found["headless", detector][image_id]
        head_px = people.keypoints_px[:, HEAD_POINTS].reshape(-1, 2)
        sides = -np.nanmin(head_px, axis=0), np.nanmax(head_px, axis=0) - image.shape[1::-1]
        (left, top), (right, bottom) = (np.clip(side, 0, max(image.shape)).astype(int) + 9 for side in sides)
        image = np.pad(image, ((top, bottom), (left, right), (0, 0)), constant_values=225)
        moved = replace(people, keypoints_px=people.keypoints_px + [left, top])
        pictures.append(draw_detections(image, moved, detector))
        titles.append(f"{detector}\nscore of the head {scores[detector, image_id]:.2f}")
    beyond = (heads["landed"] == "outside").groupby(heads["detector"], sort=False).mean()
    said = [" ".join(title.split()) for title in titles]
    told = texts("invented_heads", note=note, said=said, beyond=beyond)
    return picture_grid([pictures], *told, titles=titles, cell_in=1.8, title_pt=7)


@in_style
def false_presence(table: pd.DataFrame, note: str) -> Figure:
    """Parts outside the picture that are given inside it, a panel per decision; from `false_presence`."""
    rows = marks.own_bodies(table)
    rows = rows[(rows["n"] >= MIN_PEOPLE) | (rows["n"].max() < MIN_PEOPLE)]
    rows = rows.assign(row=rows["part"] + ", " + rows["subset"] + " (" + rows["n"].astype(str) + ")")
    pens = marks.detector_dots(rows["detector"].unique())
    figure, _, panels = marks.dot_chart(rows, "row", "detector", pens, WIDTH_IN, ["decision"])
    for axis, _, decision in panels:
        axis.set(xlim=(-0.02, None), xlabel="share given inside")
        axis.set_title(textwrap.fill(decision, 24), fontsize=8)
    heads = rows[(rows["part"] == "head") & (rows["subset"] == "headless")]
    return Figure(figure, *texts("false_presence", note=note, said=heads), table)


@in_style
def scores_by_state(table: pd.DataFrame, note: str) -> Figure:
    """Hit rate against score for visible, hidden and outside keypoints; from `scores_by_state`."""
    rows = marks.own_bodies(table)
    rows = rows[rows["n"] >= MIN_PEOPLE]
    figure, (axes,), panels = marks.panels(rows, ["detector"], WIDTH_IN, 2.9, sharey=True)
    for axis, of_detector, detector in panels:
        for state, style in STYLES["states"].items():
            part = of_detector[of_detector["state"] == state]
            pen = style | {"ms": 4, "capsize": 2, "color": detector_colour(detector)}
            axis.errorbar(part["score"], part["value"], marks.whiskers(part), label=state, **pen)
        axis.plot([0, 1], [0, 1], "--", color="#AAAAAA", lw=1)
        axis.set(xlim=(0, 1.02), ylim=(-0.02, 1.02), xlabel="score")
        axis.set_title(in_lines(detector), fontsize=8)
    axes[0].set(ylabel="share of hits")
    marks.legend_below(figure, axes)
    top = rows[rows["state"] == "outside"].groupby("detector", sort=False).tail(1)
    return Figure(figure, *texts("scores_by_state", fewest=MIN_PEOPLE, note=note, said=top), table)


@in_style
def gallery(
    cases: pd.DataFrame, folders: Mapping[str, Path], truth: Truth, found: Found, note: str,
    row: str = "detector",
) -> Figure:  # fmt: skip
    """Single cases with what is wrong in them.

    Parameters
    ----------
    cases : pd.DataFrame
        As from `worst_cases` or `lost_points`; a keypoint that is named is ringed where it truly is.
    folders : mapping of str to Path
        The subsets' dataset folders.
    truth : Truth
        By subset.
    found : Found
        By subset and detector, then by image id.
    note : str
        What the data are, for the caption.
    row : str, optional
        The column that names the rows of pictures.
    """
    cases, titles = marks.own_bodies(cases), []
    pictures: dict[str, list] = {name: [] for name in cases[row].unique()}
    for case in cases.to_dict("records"):
        subset, image_id, detector = case["subset"], case["image_id"], case["detector"]
        people, images_dir = truth[subset], Path(folders[subset]) / "images"
        of_image = (people.image_ids == image_id) & ~people.is_crowd
        image = draw_truth(people, images_dir, image_id, of_image, _TRUTH_COLOUR, n_keypoints=26)
        image = draw_detections(image, found[subset, detector].get(image_id, Detections.none()), detector)
        if "keypoint" in case:
            ringed = people.keypoints_px[people.ids == case["annotation_id"], case["keypoint"]]
            image = draw_rings(image, ringed, 20)
        pictures[case[row]].append(image)
        titles.append("\n".join(case[name] for name in _TITLES if name in case and name != row))
    said = [" ".join(case[name] for name in _TITLES if name in case) for case in cases.to_dict("records")]
    told = {"note": note, "n": len(cases), "rows": list(dict.fromkeys(said))}
    name = "gallery" if row == "detector" else "lost_points"
    width = max(map(len, pictures.values()))
    grid = list(pictures.values()), *texts(name, **told), list(pictures), titles
    return picture_grid(*grid, cell_in=WIDTH_IN / width, title_pt=7)

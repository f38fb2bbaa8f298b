"""Figures of the data: layouts, whole scenes, the cut that takes the head off, examples, what is labelled."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.patches
import numpy as np
import pandas as pd

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.files import read_json
from hicp_lib.core.images import read_image
from hicp_lib.core.keypoints import BODY, COCO_17, FACE, HANDS, INDEX, LEFT_HAND, LIMBS, TO_HALPE
from hicp_lib.formats.annotations import Annotations
from hicp_lib.simulation.body.joints import pose_from_joints, radians
from hicp_lib.simulation.body.model import load_body, pose_body
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import BODY_COLOUR, HEAD_COLOUR, STYLES
from hicp_lib.study.plots.people import draw_truth, picture_grid
from hicp_lib.study.plots.style import WIDTH_IN, Figure, in_style, new_figure, texts

_TRUTH_COLOUR = "#F0E442"
_EDGES = ("left", "top", "right", "bottom")
_PAIRS = ("eye", "ear", "shoulder", "elbow", "wrist", "hip", "knee", "ankle")
_PARTS: dict[str, Any] = {"nose": [INDEX["nose"]]}
_PARTS |= {f"{part}s": [INDEX[f"left_{part}"], INDEX[f"right_{part}"]] for part in _PAIRS}
_PARTS |= {"face (68 points)": FACE, "hands (42 points)": HANDS}


def with_truth(annotations: Annotations, images_dir: str | Path, image_id: int) -> np.ndarray:
    """An image with its annotated keypoints drawn, those of people marked as crowd left out.

    Parameters
    ----------
    annotations : Annotations
    images_dir : str or Path
    image_id : int

    Returns
    -------
    array, shape (height, width, 3)
        RGB, uint8.
    """
    rows = (annotations.image_ids == image_id) & ~annotations.is_crowd
    return draw_truth(annotations, images_dir, image_id, rows, _TRUTH_COLOUR)


def scenes(annotations: Annotations, images_dir: str | Path, image_ids: Sequence[int], note: str) -> Figure:
    """Whole images with their annotated keypoints, two abreast.

    Parameters
    ----------
    annotations : Annotations
    images_dir : str or Path
    image_ids : sequence of int
        Those shown.
    note : str
        What the data are, for the caption.
    """
    pictures = [with_truth(annotations, images_dir, i) for i in image_ids]
    n_people = [str((annotations.image_ids == i).sum()) for i in image_ids]
    said = texts("scenes", note=note, n=len(pictures), n_people=n_people)
    return picture_grid([pictures[k : k + 2] for k in range(0, len(pictures), 2)], *said, cell_in=2.8)


@in_style
def head_cuts(table: pd.DataFrame, images_dir: str | Path, note: str) -> Figure:
    """How Headless is made, as in the paper's figure.

    Red: the box of the head's keypoints and their centre; green: the body's; dashed: the cut.

    Parameters
    ----------
    table : pd.DataFrame
        Rows of `hicp_lib.datasets.subsets.plan`.
    images_dir : str or Path
        Of the whole images.
    note : str
        What the data are, for the caption.
    """
    figure, axes = new_figure(1, len(table), WIDTH_IN, 0.5 * WIDTH_IN, squeeze=False)
    for axis, (_, row) in zip(axes[0], table.iterrows(), strict=True):
        left, top, right, bottom = row[[f"basic_crop_{edge}_px" for edge in _EDGES]].astype(int)
        image = read_image(Path(images_dir) / row["file_name"])[top:bottom, left:right]
        axis.imshow(image, extent=(left - 0.5, right - 0.5, bottom - 0.5, top - 0.5))
        for part, colour in (("head", HEAD_COLOUR), ("body", BODY_COLOUR)):
            _draw_box(axis, row, part, colour)
        _draw_cut(axis, row)
        axis.set(xticks=[], yticks=[], xlim=(left - 0.5, right - 0.5), ylim=(bottom - 0.5, top - 0.5))
        axis.spines[:].set_visible(False)
        axis.grid(False)
    whole, kept = (_areas_px2(table, f"{subset}_crop") for subset in ("basic", "headless"))
    said = {"sides": list(table["cut_side"].astype(str).unique()), "n": len(table), "note": note}
    gone = {"least": (1 - kept / whole).min(), "most": (1 - kept / whole).max()}
    return Figure(figure, *texts("head_cuts", **said, **gone), table)


def _areas_px2(table: pd.DataFrame, box: str) -> pd.Series:
    left, top, right, bottom = (table[f"{box}_{edge}_px"] for edge in _EDGES)
    return (right - left) * (bottom - top)


def _draw_box(axis, row: pd.Series, part: str, colour: str) -> None:
    left, top, right, bottom = row[[f"{part}_{edge}_px" for edge in _EDGES]]
    box = matplotlib.patches.Rectangle((left, top), right - left, bottom - top, fill=False, ec=colour, lw=2)
    axis.add_patch(box)
    axis.plot(row[f"{part}_u_px"], row[f"{part}_v_px"], "o", color=colour, mec="white", mew=1.2, markersize=9)


def _draw_cut(axis, row: pd.Series) -> None:
    side = row["cut_side"]
    draw_line = axis.axhline if side in ("top", "bottom") else axis.axvline
    for colour, width in (("black", 2.6), ("white", 1.6)):
        draw_line(row[f"headless_crop_{side}_px"] - 0.5, color=colour, lw=width, ls=(0, (4, 2)))


def pairs(subsets: Mapping[str, tuple[Annotations, Path]], image_ids: Sequence[int], note: str) -> Figure:
    """The same people in each subset, with their annotated keypoints.

    Parameters
    ----------
    subsets : mapping of str to (Annotations, Path)
        By name, its annotations and its folder of images.
    image_ids : sequence of int
        Those shown.
    note : str
        What the data are, for the caption.
    """
    rows = [
        [with_truth(annotations, images_dir, i) if i in annotations.images else None for i in image_ids]
        for annotations, images_dir in subsets.values()
    ]
    of = {
        name: people.visibility[np.isin(people.image_ids, image_ids)] for name, (people, _) in subsets.items()
    }
    labelled = pd.Series({name: (flags[:, COCO_17] > 0).sum(axis=1).mean() for name, flags in of.items()})
    said = texts("pairs", subsets=list(subsets), note=note, n=len(image_ids), labelled=labelled)
    return picture_grid(rows, *said, row_titles=list(subsets), cell_in=WIDTH_IN / len(image_ids))


@in_style
def labelled_share(subsets: Mapping[str, Annotations], note: str) -> Figure:
    """Share of people in whom a part is labelled; left and right together, of face and hands the mean."""
    visible = {name: data.visibility[~data.is_crowd] > 0 for name, data in subsets.items()}
    table = pd.DataFrame(
        {"part": part, "subset": name, "share": float(labelled[:, indices].mean())}
        for name, labelled in visible.items()
        for part, indices in _PARTS.items()
        if len(labelled)
    )
    bare: dict[str, Any] = {"bounds": ["share"] * 3, "capsize": 0}
    figure, axes, _ = marks.dot_chart(table, "part", "subset", marks.subset_dots(subsets), WIDTH_IN, **bare)
    axes[0, 0].set(xlabel="share of people", xlim=(-0.02, 1.02))
    least = table.sort_values("share", kind="stable").drop_duplicates("subset")
    return Figure(figure, *texts("labelled_share", note=note, said=least), table)


@in_style
def crop_sizes(table: pd.DataFrame, min_pixels: int, note: str) -> Figure:
    """Distribution of the crops' sizes before the smallest are dropped.

    Parameters
    ----------
    table : pd.DataFrame
        As from `hicp_lib.datasets.subsets.plan`.
    min_pixels : int
        The limit.
    note : str
        What the data are, for the caption.
    """
    sizes = _areas_px2(table, "basic_crop").to_numpy(float)
    sizes = sizes[sizes > 0]
    figure, axis = new_figure(1, 1, WIDTH_IN, 2.6)
    bins = np.geomspace(max(sizes.min(), 1), sizes.max() * 1.01, 30)
    axis.hist(sizes[sizes >= min_pixels], bins, color=STYLES["subsets"]["basic"]["color"], label="kept")
    axis.hist(sizes[sizes < min_pixels], bins, color="#BBBBBB", label="too small")
    axis.axvline(min_pixels, color="black", lw=1.2, ls="--")
    axis.set(xscale="log", xlabel="area of the crop [px]", ylabel="people")
    ticks = [n * 10**k for k in range(8) for n in (1, 2, 5) if bins[0] <= n * 10**k <= bins[-1]]
    axis.set_xticks(ticks, [f"{tick:,}" for tick in ticks])
    axis.minorticks_off()
    axis.yaxis.get_major_locator().set_params(integer=True)
    axis.legend(loc="best")
    told = {"small": int((sizes < min_pixels).sum()), "n": len(sizes), "median": np.median(sizes)}
    said = texts("crop_sizes", min_pixels=min_pixels, note=note, **told)
    return Figure(figure, *said, pd.DataFrame({"pixels": sizes}))


_DRAWN_PARTS = {
    "COCO's body": (COCO_17, "#0072B2", "o", 4.5),
    "more of the body, feet": (np.setdiff1d(BODY, COCO_17), "#D55E00", "s", 4),
    "face": (FACE, "#009E73", "x", 1.8),
    "hands": (HANDS, "#CC79A7", "^", 2.2),
}
_ARMS_DEG = {"shoulder_abduction": 25, "forearm_supination": 80, "index_spread": 12, "little_spread": -15}


@in_style
def layouts() -> Figure:
    """Layouts of keypoints, as in the paper's Fig. 2, and a hand enlarged; the person faces the reader."""
    pose = pose_from_joints(radians(_ARMS_DEG, "left_") | radians(_ARMS_DEG, "right_"))
    points_m = pose_body(load_body(), "man_38_07", pose).keypoints_m[:, 1:]
    figure, axes = new_figure(2, 3, 6.4, 7.2)
    rows, made_of = [], read_json(DATA_DIR / "survey.json")["layouts"]
    for axis, (name, conventions) in zip(axes.flat, made_of.items(), strict=False):
        given = np.concatenate([TO_HALPE[convention] for convention in conventions])
        rows.append((name.replace("\n", " "), len(given), int((given >= 0).sum())))
        _draw_layout(axis, points_m, given, f"{name}, {len(given)}")
    _draw_layout(axes.flat[-1], points_m, LEFT_HAND, "a left hand, the same\nof all that give it")
    marks.legend_below(figure, axes.flat[3])
    table = pd.DataFrame(rows, columns=["layout", "points", "drawn"])
    return Figure(figure, *texts("layouts", said=table), table)


def _draw_layout(axis, points_m: np.ndarray, given: np.ndarray, title: str) -> None:
    for limb in (limb for limb in LIMBS if np.isin(limb, given).all()):
        axis.plot(*points_m[list(limb)].T, color="#BBBBBB", lw=1, zorder=1)
    for part, (indices, colour, marker, size) in _DRAWN_PARTS.items():
        shown_m = points_m[np.intersect1d(indices, given)]
        axis.plot(*shown_m.T, marker, color=colour, markersize=size, label=part)
    axis.set_title(title, loc="center", fontsize=9)
    axis.set_aspect("equal")
    axis.axis("off")

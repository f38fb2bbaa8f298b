"""HiCP: make the Basic and Headless datasets of people at close range from any annotated images.

The rules are those of `hicp_lib.datasets.crops` and `hicp_lib.datasets.heads`; where the paper leaves it
open, people are selected so:

- Crowds, and people without a labelled keypoint in the crop, are left out of both.
- People without a labelled head keypoint in the crop are not part of Headless: their head may be visible
  nevertheless. Neither are those without any other body keypoint, or with too few pixels left.
- Other people reaching into a crop stay in its annotations with `iscrowd` 1 and `"other": true`,
  so that detecting them is not a false positive.
- How the end of the face was determined, and who may still show a part of it, is stored with Headless
  (`hicp_lib.datasets.heads.CUT_RULES`).

A crop's image id, and its person's annotation id, are the person's annotation id in the source:
the same person has the same id in both datasets, independent of the selection.
"""

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from tqdm import tqdm

from hicp_lib.core.cache import content, digest
from hicp_lib.core.environment import usable_cores
from hicp_lib.core.errors import InputError
from hicp_lib.core.executor import run_jobs
from hicp_lib.core.files import regular_file, write_json
from hicp_lib.core.folders import kept_beside, locked_folder, remove_inside
from hicp_lib.core.images import Box, as_seen, inside, is_whole_png, read_image, write_png
from hicp_lib.core.keypoints import HEAD
from hicp_lib.datasets.crops import crop_people, image_name, n_pixels, on_pixels, person_crops
from hicp_lib.datasets.frames import in_frame, outside_image
from hicp_lib.datasets.heads import CUT_RULES, SIDES, TRUNK, headless_cut
from hicp_lib.formats.annotations import Annotations, ImageInfo, read_annotations, write_annotations

SUBSETS = ("basic", "headless")
_CENTRES = [f"{part}_{axis}_px" for part in ("head", "body") for axis in "uv"]
_Crop = tuple[Path, Box]  # the file to write, and its part of the image


def plan(annotations: Annotations, min_pixels: int = 20_000, headless_min_pixels: int = 1) -> pd.DataFrame:
    """Decide on the crops of every annotated person.

    Parameters
    ----------
    annotations : Annotations
        The people.
    min_pixels : int, optional
        Minimum size of a Basic crop, by the box.
    headless_min_pixels : int, optional
        Minimum size of a Headless crop. The paper's counts, 1624 and 1608, differ too little for the limit to
        have been applied again after the cut.

    Returns
    -------
    DataFrame
        One row per annotated person in the order of `annotations`: `annotation_id, image_id, file_name`; the
        outcome for the person, `basic` and `headless`: "kept" or the reason why not; and in pixels of the
        source image, NaN where undefined: `<box>_left_px, _top_px, _right_px, _bottom_px` for the boxes
        basic_crop, headless_crop (right and bottom exclusive), head and body (extent of the labelled
        keypoints), the centres `head_u_px, head_v_px, body_u_px, body_v_px`, `cut_side`, the side of the crop
        that is removed, and `cut_rule`, how the end of the face was determined.
    """
    annotations = on_pixels(annotations)
    boxes, crops = person_crops(annotations)
    large = [n_pixels(box) >= max(min_pixels, 1) for box in boxes]
    columns = (annotations.keypoints_px, annotations.visibility, crops, annotations.is_crowd, large)
    rows = [_plan_person(*person, headless_min_pixels) for person in zip(*columns, strict=True)]
    names = [annotations.images[i].file_name for i in annotations.image_ids.tolist()]
    ids = {"annotation_id": annotations.ids, "image_id": annotations.image_ids, "file_name": names}
    return pd.DataFrame(rows, columns=_columns()).assign(**ids)


def _columns() -> list[str]:
    boxes = [f"{box}_{edge}_px" for box in ("basic_crop", "headless_crop", "head", "body") for edge in SIDES]
    return ["annotation_id", "image_id", "file_name", *SUBSETS, "cut_side", "cut_rule", *boxes, *_CENTRES]


def _plan_person(
    keypoints_px: np.ndarray, visibility: np.ndarray, crop: Box, is_crowd: bool, large: bool, least: int
) -> dict:
    row: dict = {"basic": "kept", "headless": "not in Basic", **_named("basic_crop", crop)}
    labelled = (visibility > 0) & inside(keypoints_px, crop)
    why_not = {"crowd": is_crowd, "too small": not large, "no keypoints": not labelled.any()}
    if reasons := [reason for reason, holds in why_not.items() if holds]:
        return row | {"basic": reasons[0]}
    for name, part in (("head", HEAD), ("body", TRUNK)):
        points = keypoints_px[part[labelled[part]]]
        if not len(points):
            return row | {"headless": f"no {name} labelled"}
        row |= _named(name, np.concatenate([points.min(axis=0), points.max(axis=0)]))
    cut = headless_cut(keypoints_px, visibility, crop)
    assert cut is not None  # both parts are labelled
    row |= zip(_CENTRES, [*cut.head_px, *cut.body_px], strict=True)
    fate = "kept" if n_pixels(cut.kept_px) >= max(least, 1) else "too small"
    how = {"headless": fate, "cut_side": cut.side, "cut_rule": cut.rule}
    return row | how | _named("headless_crop", cut.kept_px)


def _named(box: str, edges: Iterable) -> dict[str, float]:
    return {f"{box}_{edge}_px": float(value) for edge, value in zip(SIDES, edges, strict=True)}


def crop_boxes(table: pd.DataFrame, subset: str) -> dict[int, Box]:
    """The crops of a subset of a plan: row number -> left, top, right, bottom."""
    kept = np.flatnonzero(table[subset] == "kept")
    edges = table[[f"{subset}_crop_{edge}_px" for edge in SIDES]].to_numpy()[kept].astype(int)
    return dict(zip(kept.tolist(), map(tuple, edges.tolist()), strict=True))


def crop_annotations(annotations: Annotations, table: pd.DataFrame, subset: str) -> Annotations:
    """The annotations of a subset's crops.

    Parameters
    ----------
    annotations : Annotations
        The people.
    table : DataFrame
        Their plan, from `plan`.
    subset : {"basic", "headless"}
        Which crops.

    Returns
    -------
    Annotations
        Further keys of a person: `source_id, source_image_id, source_file, source_area` (before any cut),
        `crop_px` (left, top, right, bottom in the source image), `subset`, and in Headless `cut_side` and
        `cut_rule`.
    """
    annotations = on_pixels(annotations)
    in_image = pd.Series(range(len(annotations))).groupby(annotations.image_ids).indices
    next_id = int(annotations.ids.max(initial=0)) + 1
    images, parts = {}, []
    for row, box in crop_boxes(table, subset).items():
        person_id, source_id = int(annotations.ids[row]), int(annotations.image_ids[row])
        images[person_id] = ImageInfo(person_id, image_name(person_id), box[2] - box[0], box[3] - box[1])
        people = crop_people(annotations, np.array([row, *(k for k in in_image[source_id] if k != row)]), box)
        about = {
            "subset": subset, "source_id": person_id, "source_image_id": source_id,
            "source_file": annotations.images[source_id].file_name,
            "source_area": float(annotations.areas_px2[row]), "crop_px": list(box),
        }  # fmt: skip
        if subset == "headless":
            about |= table[["cut_side", "cut_rule"]].iloc[row].to_dict()
        others_about = [{"other": True, "source_id": i} for i in people.ids[1:].tolist()]
        ids = np.r_[person_id, next_id : next_id + len(others_about)]
        next_id += len(others_about)
        image_ids, is_crowd = np.full(len(people), person_id), ids != person_id
        extras = [about, *others_about]
        parts.append(replace(people, ids=ids, image_ids=image_ids, is_crowd=is_crowd, extras=extras))
    return Annotations.concatenate(parts, images)


def summary(table: pd.DataFrame) -> dict:
    """People kept and dropped: `{"people": n, "basic": {"kept": n, reason: n, ...}, "headless": {...}}`.

    `"headless_cut_by"` counts those in Headless per rule; with the last rule a part of the face may be in the
    crop.
    """
    counts = {subset: table[subset].value_counts().to_dict() for subset in SUBSETS}
    cut_by = table.loc[table["headless"] == "kept", "cut_rule"].value_counts().to_dict()
    fates = {subset: {"kept": 0} | counts[subset] for subset in SUBSETS}
    by_rule = {rule: cut_by.get(rule, 0) for rule in CUT_RULES}
    return {"people": len(table), **fates, "headless_cut_by": by_rule}


def notes(counts: dict) -> list[str]:
    """Warnings about the result of `create_hicp`, a line each."""
    unsure = {"people": counts["headless_cut_by"][CUT_RULES[-1]]}
    lines = {
        "{keypoints} labelled keypoints and {boxes} boxes, of {people} people, lie outside their image; "
        "do the annotated sizes fit the pictures?": counts["outside_image"],
        "{people} Headless crops may show a part of the face: cut_rule 'head labels only'": unsure,
    }
    return [line.format(**of) for line, of in lines.items() if of["people"]]


def count_sensitivity(annotations: Annotations, min_pixels: int = 20_000) -> pd.DataFrame:
    """Counts under other choices that the paper leaves open: columns `rule, basic, headless` (people)."""
    rules: dict[str, dict[str, int]] = {
        f"as here: Basic at least {min_pixels} pixels, Headless of any size": {},
        f"both at least {min_pixels} pixels": {"headless_min_pixels": min_pixels},
        f"Basic at least {min_pixels // 2} pixels": {"min_pixels": min_pixels // 2},
        f"Basic at least {min_pixels * 2} pixels": {"min_pixels": min_pixels * 2},
    }
    tables = [plan(annotations, **{"min_pixels": min_pixels} | options) for options in rules.values()]
    counts = [(table[list(SUBSETS)] == "kept").sum() for table in tables]
    basic, headless = tables[0]["basic"], tables[0]["headless"]
    without = "people without keypoints kept, people without labelled head kept in Headless"
    in_headless = headless.isin(["kept", "no head labelled"]) | (basic == "no keypoints")
    in_basic = basic.isin(["kept", "no keypoints"])
    counts.append(pd.Series({"basic": in_basic.sum(), "headless": in_headless.sum()}))
    return pd.DataFrame(counts, index=pd.Index([*rules, without], name="rule")).reset_index()


def create_hicp(
    annotations_path: str | Path,
    images_dir: str | Path,
    out: str | Path,
    min_pixels: int = 20_000,
    headless_min_pixels: int = 1,
    progress: bool = False,
    keypoint_map: str | Path | None = None,
    orientation: str | None = None,
) -> dict:
    """Write the dataset folders out/basic and out/headless, and out/summary.json.

    Crops keep the original pixels (PNG). If interrupted, the next call continues; crops from other sources or
    rules are replaced.

    Parameters
    ----------
    annotations_path : str or Path
        Annotations in COCO's layout.
    images_dir : str or Path
        Folder of the annotated images.
    out : str or Path
        Folder to write to.
    min_pixels, headless_min_pixels : int, optional
        As of `plan`.
    progress : bool, optional
        Whether a bar is shown.
    keypoint_map : str or Path, optional
        As of `read_annotations`.
    orientation : {"stored", "seen"}, optional
        What was annotated of pictures with a camera's rotation flag (`hicp_lib.datasets.frames.in_frame`).

    Returns
    -------
    dict
        As from `summary`; `"outside_image"`, how many labels lie outside their image; `"rotation_flags"`,
        those of the pictures that have one, by name; and `"notes"`, those of the annotations if any.

    Raises
    ------
    InputError
        For malformed annotations, missing or wrongly sized images, a rotation flag without a given
        orientation, or an `out` that is being filled, contains the input, or is in use for something else.
    """
    out, images_dir = Path(out), Path(images_dir)
    annotations, flags = in_frame(read_annotations(annotations_path, keypoint_map), images_dir, orientation)
    turned = flags if orientation == "seen" else {}
    table = plan(annotations, min_pixels, headless_min_pixels)
    boxes = {subset: crop_boxes(table, subset) for subset in SUBSETS}
    jobs = _jobs(annotations, boxes, out)
    for given in (Path(annotations_path), images_dir):
        if given.resolve().is_relative_to(out.resolve()):
            raise InputError(f"{out}: holds {given}, which is read; give another folder to write to")
    with locked_folder(out):
        _claim(out, _digest(table, boxes, images_dir, turned), sum(jobs.values(), []))
        write = partial(_write_crops, images_dir, turned)
        todo = [(image, partial(write, image, crops)) for image, crops in jobs.items()]
        done = run_jobs(todo, usable_cores(), "threads")
        for _ in tqdm(done, total=len(todo), desc="HiCP crops", unit="image", disable=not progress):
            pass
        for subset in SUBSETS:
            write_annotations(out / subset / "annotations.json", crop_annotations(annotations, table, subset))
        counts = summary(table) | {"outside_image": outside_image(annotations), "rotation_flags": flags}
        counts |= {"notes": annotations.notes} if annotations.notes else {}
        write_json(out / "summary.json", counts, indent=2)
    return counts


def _digest(table: pd.DataFrame, boxes: dict, images_dir: Path, turned: dict[str, int]) -> str:
    """Digest of all that the pixels of the crops depend on."""
    names = sorted({table["file_name"].iloc[row] for kept in boxes.values() for row in kept})
    files = [(name, content(regular_file(images_dir / name, "give the images' folder"))) for name in names]
    ids = table["annotation_id"].tolist()
    crops = {subset: [(ids[row], box) for row, box in kept.items()] for subset, kept in boxes.items()}
    return digest([files, crops, str(images_dir.resolve()), turned])


def _claim(out: Path, digest: str, crops: Iterable[_Crop]) -> None:
    """Prepare `out`: crops with another digest are removed; other files are refused."""
    marker, names = out / "crops.json", ["summary.json", *(f"{name}/annotations.json" for name in SUBSETS)]
    before = kept_beside(out, marker.name, digest=str, names=list)
    names += [path.relative_to(out).as_posix() for path, _ in crops]
    if before["digest"] == digest:
        return
    remove_inside(out, before["names"])
    for name in names:
        if (out / name).exists():
            raise InputError(f"{out / name}: was not made by this command; choose another folder")
    write_json(marker, {"digest": digest, "names": names})


def _jobs(annotations: Annotations, boxes: dict[str, dict], out: Path) -> dict[ImageInfo, list[_Crop]]:
    """Per source image, the crops to write."""
    jobs: dict[ImageInfo, list[_Crop]] = {}
    for subset, kept in boxes.items():
        for row, box in kept.items():
            path = out / subset / "images" / image_name(int(annotations.ids[row]))
            jobs.setdefault(annotations.images[int(annotations.image_ids[row])], []).append((path, box))
    return jobs


def _write_crops(images_dir: Path, turned: dict[str, int], image: ImageInfo, crops: list[_Crop]) -> None:
    missing = [(path, box) for path, box in crops if not is_whole_png(path)]
    if not missing:
        return
    pixels = as_seen(read_image(images_dir / image.file_name), turned.get(image.file_name, 1))
    if problem := image.other_size(images_dir, pixels.shape[1::-1]):
        raise InputError(problem)
    for path, (left, top, right, bottom) in missing:
        write_png(path, pixels[top:bottom, left:right])

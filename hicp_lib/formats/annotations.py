"""Read and write COCO files of annotated people.

They are checked when they are read. Conventions of this module, where existing files differ:

- People are converted to the Halpe-136 layout: by the file's keypoint names (`layouts`), or without names by
  their number, 17 (COCO), 26, 133 or 136. People are recognised by their category's name.
- Coordinates are pixels. The origin of boxes is the corner of the first pixel, that of keypoints its centre.
  Fractions of the image, and boxes given as x1, y1, x2, y2, are refused (`units`).
- For a person whose area is absent, below a hundredth or above twice the box, 0.53 of the box is used
  instead, as in tools without segments; `Annotations.notes` says so.
- A keypoint is labelled when its flag v > 0; flags are floats and kept as they are (Halpe and COCO-WholeBody
  files have values other than 0, 1 and 2), except that v <= 0 becomes 0, and v = 3, which means a keypoint
  outside the picture in CropCOCO's layout, becomes `cropcoco.OUTSIDE`; it is written as 3 again.
- `num_keypoints` is not read (in Halpe's files it counts the body, or nothing); it is written as in
  Halpe's validation set, the number of labelled keypoints out of COCO's 17.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import write_json
from hicp_lib.core.images import image_header
from hicp_lib.core.keypoints import COCO_17, N_KEYPOINTS, NAMES
from hicp_lib.core.names import is_inside
from hicp_lib.formats.cropcoco import FLAG_OUTSIDE, OUTSIDE, outside_from_flags
from hicp_lib.formats.importers.matching import ImageMatcher
from hicp_lib.formats.json_validation import CONVENTIONS, PART_KEYS, Layouts, Rows
from hicp_lib.formats.layouts import PERSON_CATEGORY, PersonCategory, layouts_of, person_category
from hicp_lib.formats.number_lists import read_people
from hicp_lib.formats.units import corners_note, count_fractions, doubts, fractions_note

SEGMENT_OF_BOX = 0.53  # typical ratio of the segment's area to the box's, as other tools use it
_LEAST_AREA, _MOST_AREA = 0.01, 2.0  # plausible areas of a person, relative to the box
PERSON = {"id": PERSON_CATEGORY, "name": "person", "supercategory": "person"}
MAX_SIDE_PX = 100_000
_KNOWN_KEYS = {
    "id", "image_id", "category_id", "bbox", "area", "iscrowd", "keypoints", "num_keypoints", *PART_KEYS,
}  # fmt: skip


@dataclass(frozen=True)
class ImageInfo:
    """One image of a dataset.

    Attributes
    ----------
    id : int
        The id that annotations and detections refer to.
    file_name : str
        Relative to the folder of images.
    width_px, height_px : int
        Its size.
    """

    id: int
    file_name: str
    width_px: int
    height_px: int

    def other_size(self, folder: Path, size_px: tuple[int, ...] = ()) -> str:
        """That its file is not of the annotated size; empty where it is, or cannot be read.

        Parameters
        ----------
        folder : Path
            Of the images.
        size_px : tuple of int, optional
            Width and height found; by default those in the file's header, as stored.

        Returns
        -------
        str
        """
        width_px, height_px, flag = (*size_px, 1) if size_px else image_header(folder / self.file_name)
        if not width_px or (width_px, height_px) == (self.width_px, self.height_px):
            return ""
        as_stored = f" as stored (rotation flag {flag})" if flag > 1 else ""
        return (
            f"{folder / self.file_name}: is {width_px}x{height_px} pixels{as_stored}, annotated as "
            f"{self.width_px}x{self.height_px}; expected the image the annotations were made on"
        )


@dataclass(frozen=True)
class Annotations:
    """Annotated people, one row each.

    Attributes
    ----------
    images : dict of int to ImageInfo
        By image id, in the order of the file.
    ids, image_ids : array, shape (n,), dtype int64
        Of the people, and of the images they are in.
    boxes_px : array, shape (n, 4)
        x, y of the top-left corner, width, height.
    areas_px2 : array, shape (n,)
        Area of the person's segment, the s² of OKS.
    is_crowd : array of bool, shape (n,)
        Not evaluated; a detection there counts neither as correct nor as wrong.
    keypoints_px : array, shape (n, 136, 2)
        NaN where not known.
    visibility : array, shape (n, 136)
        0 not labelled, above 0 labelled (1 occluded, 2 visible), below 0 known to lie outside the picture.
    extras : list of dict
        Per person, the further keys of its JSON object.
    category : PersonCategory
        Of people in the file.
    notes : dict of str to str
        Remarks on the file, by topic: what was left out, assumed, or is doubtful.

    Examples
    --------
    >>> nobody = Annotations.concatenate([], {7: ImageInfo(7, "a.png", 640, 480)})
    >>> len(nobody), nobody.keypoints_px.shape
    (0, (0, 136, 2))
    """

    images: dict[int, ImageInfo]
    ids: np.ndarray
    image_ids: np.ndarray
    boxes_px: np.ndarray
    areas_px2: np.ndarray
    is_crowd: np.ndarray
    keypoints_px: np.ndarray
    visibility: np.ndarray
    extras: list[dict]
    category: PersonCategory = field(default_factory=PersonCategory)
    notes: dict[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def is_other(self) -> np.ndarray:
        """Which people only reach into another person's crop: array of bool, shape (n,)."""
        return np.array([bool(extra.get("other")) for extra in self.extras], dtype=bool)

    def take(self, rows: np.ndarray) -> Annotations:
        """The people of some rows (indices or a mask); all images stay."""
        rows = np.arange(len(self))[rows]
        arrays = {name: getattr(self, name)[rows] for name in _NOBODY}
        return replace(self, extras=[self.extras[i] for i in rows], **arrays)

    def of_images(self, image_ids: Collection[int]) -> Annotations:
        """The people of some images, and these images only."""
        chosen = np.array([i in image_ids for i in self.image_ids.tolist()], dtype=bool)
        images = {i: image for i, image in self.images.items() if i in image_ids}
        return replace(self.take(chosen), images=images)

    @classmethod
    def concatenate(cls, parts: Sequence[Annotations], images: dict[int, ImageInfo]) -> Annotations:
        """The people of all parts, in `images`, with their ids; there may be no parts at all."""
        arrays: dict[str, Any] = {
            name: np.concatenate([empty, *(getattr(part, name) for part in parts)])
            for name, empty in _NOBODY.items()
        }
        return cls(images=images, extras=[extra for part in parts for extra in part.extras], **arrays)

    def numbered(self) -> Annotations:
        """The same people with ids from 1."""
        return replace(self, ids=np.arange(1, len(self) + 1))


_NOBODY = {
    "ids": np.zeros(0, np.int64),
    "image_ids": np.zeros(0, np.int64),
    "boxes_px": np.zeros((0, 4)),
    "areas_px2": np.zeros(0),
    "is_crowd": np.zeros(0, bool),
    "keypoints_px": np.zeros((0, N_KEYPOINTS, 2)),
    "visibility": np.zeros((0, N_KEYPOINTS)),
}


def rows_by_image(image_ids: np.ndarray) -> dict[int, np.ndarray]:
    """The rows of each image, in their order; images by id.

    Examples
    --------
    >>> {i: rows.tolist() for i, rows in rows_by_image(np.array([7, 3, 7])).items()}
    {3: [1], 7: [0, 2]}
    """
    order = np.argsort(image_ids, kind="stable")
    ids, starts = np.unique(image_ids[order], return_index=True)
    return dict(zip(ids.tolist(), np.split(order, starts[1:]), strict=False))  # without ids: one empty part


def source_images(annotations: Annotations) -> dict[int, int]:
    """Image id -> the image it was cropped from (itself where the annotations do not say)."""
    source = {i: i for i in annotations.images}
    for image_id, extra in zip(annotations.image_ids.tolist(), annotations.extras, strict=True):
        source[image_id] = extra.get("source_image_id", source[image_id])
    return source


def refuse_other_sizes(annotations: Annotations, images_dir: Path) -> None:
    """Refuse images of another size than annotated, as `ImageInfo.other_size` says."""
    for image in annotations.images.values():
        if problem := image.other_size(images_dir):
            raise InputError(problem)


def read_annotations(path: str | Path, keypoint_map: str | Path | None = None) -> Annotations:
    """Read keypoint annotations in COCO's layout, with any keypoints whose names are known.

    Parameters
    ----------
    path : str or Path
        A JSON file with `images` and `annotations`.
    keypoint_map : str or Path, optional
        A file that says what the keypoint names mean, as in `hicp_lib.formats.layouts.layouts_of`.

    Returns
    -------
    Annotations

    Raises
    ------
    InputError
        For anything malformed; the message names the file, the row, the key and what was expected.
    """
    path = Path(path)
    data = read_people(path)
    if not isinstance(data, dict):
        problem = "is not an object; expected images, annotations and categories in COCO's layout"
        raise InputError(f"{path}: {problem}; bring MPII's and other lists of people into it")
    for key in ("images", "annotations"):
        if key not in data:
            raise InputError(f"{path}: has no {key!r}; expected a COCO annotation file")
    images = _read_images(Rows.of(path, "images", data["images"]))
    category = person_category(path, data.get("categories"))
    layouts, notes = layouts_of(f"{path}: keypoints of its category", category.keypoints, keypoint_map)
    every = Rows.of(path, "annotations", data["annotations"])
    rows = of_people(every, category, {category.id} | category.others)
    if n_others := len(every.rows) - len(rows.rows):
        notes["categories"] = f"{n_others} objects of other categories left out"
    people = _read_people(rows, images, layouts)
    notes |= people.notes
    return replace(people, category=category, notes={about: note for about, note in notes.items() if note})


def of_people(rows: Rows, people: PersonCategory, allowed: set[int]) -> Rows:
    """The people among the objects; one without a category is a person if there is no other category.

    Parameters
    ----------
    rows : Rows
    people : PersonCategory
    allowed : set of int
        The categories that objects may have.

    Raises
    ------
    InputError
        For an object of another category.
    """
    expected = f"one of {', '.join(map(str, sorted(allowed)))}; {people.id} is people"
    default = {} if people.others else {"default": people.id}
    found = rows.column("category_id", lambda of: type(of) is int and of in allowed, expected, **default)
    chosen = [row for row, of in zip(rows.rows, found, strict=True) if of not in people.others]
    return rows if len(chosen) == len(found) else replace(rows, label="people", rows=chosen)


def _read_images(rows: Rows) -> dict[int, ImageInfo]:
    ids = rows.unique_integers("id").tolist()
    names = rows.column("file_name", is_inside, "a name inside the folder of images")
    widths, heights = (_sides(rows, key) for key in ("width", "height"))
    return {i: ImageInfo(i, *rest) for i, *rest in zip(ids, names, widths, heights, strict=True)}


def _sides(rows: Rows, key: str) -> list[int]:
    rows.integers(key)
    return rows.column(key, lambda side: 1 <= side <= MAX_SIDE_PX, f"1 to {MAX_SIDE_PX} pixels")


def _read_people(rows: Rows, images: dict[int, ImageInfo], layouts: Layouts) -> Annotations:
    ids, image_ids = rows.unique_integers("id"), ImageMatcher(rows.path, "id", images).images_of(rows)
    boxes = rows.vectors("bbox", ("x", "y", "width", "height"))
    for i in np.flatnonzero((boxes[:, 2:] < 0).any(axis=1))[:1]:
        raise rows.error(i, "bbox has a negative width or height; expected [x, y, width, height] in pixels")
    flags = rows.column("iscrowd", lambda f: isinstance(f, int | float) and f in (0, 1), "0 or 1", default=0)
    is_crowd = np.array(flags, dtype=bool)
    rows.column("source_image_id", lambda of: type(of) in (int, str), "a whole number or a text", default=0)
    areas, area_note = _areas(rows, boxes, is_crowd)
    triples, found = rows.keypoints(layouts)
    sizes = np.array([(images[i].width_px, images[i].height_px) for i in image_ids.tolist()]).reshape(-1, 2)
    outside = outside_from_flags(rows, triples, sizes)
    visibility = np.where(outside, OUTSIDE, np.maximum(triples[..., 2], 0.0))
    known = (visibility > 0) | (outside & (triples[..., :2] != 0).any(axis=-1))
    keypoints = np.where(known[..., None], triples[..., :2], np.nan)
    del triples  # large data are held in memory once
    labelled = np.where((visibility > 0)[..., None], keypoints, np.nan) if outside.any() else keypoints
    fractions = [
        fractions_note(rows.path, [count_fractions(points)], what)
        for points, what in ((labelled, "keypoints"), (boxes.reshape(-1, 2, 2), "boxes"))
    ]
    shown = boxes, labelled, sizes
    is_unnamed = layouts is CONVENTIONS and "coco17" in found
    notes = {"names": "17 keypoints without names are taken for COCO's" * is_unnamed, "area": area_note}
    n_parts = sum(any(row.get(key) for key in PART_KEYS) for row in rows.rows) * (133 not in layouts)
    left_out = f"{', '.join(PART_KEYS)} of {n_parts} people left out: the names are not COCO's 17"
    notes |= {"parts": left_out * bool(n_parts), "fractions": "; ".join(filter(None, fractions))}
    notes |= {"boxes": corners_note(rows.path, *shown), "pixels": doubts(*shown)}
    return Annotations(
        images, ids, image_ids, boxes, areas, is_crowd, keypoints, visibility, rows.extras(_KNOWN_KEYS),
        notes=notes,
    )  # fmt: skip


def _areas(rows: Rows, boxes_px: np.ndarray, is_crowd: np.ndarray) -> tuple[np.ndarray, str]:
    """The areas, with implausible ones replaced, and a note on their number."""
    given = [[0 if area is None else area] for area in rows.column("area", default=None)]
    areas = rows.finite(given, 1, lambda j: "area")[:, 0]
    for i in np.flatnonzero(areas < 0)[:1]:
        raise rows.error(i, f"area is {areas[i]:g}; expected the segment's area in square pixels")
    of_box = boxes_px[:, 2] * boxes_px[:, 3]
    beyond = (areas < _LEAST_AREA * of_box) | ((areas > _MOST_AREA * of_box) & (of_box > 0))
    none = beyond & ~is_crowd
    areas = np.where(none, SEGMENT_OF_BOX * of_box, areas)
    note = (
        f"the area of {none.sum()} of {(~is_crowd).sum()} people is below a hundredth of their box, above "
        f"twice or absent; {SEGMENT_OF_BOX} of the box is taken. For all alike, give --area box or box53"
    )
    return areas, note if none.any() else ""


def write_annotations(path: str | Path, annotations: Annotations) -> None:
    """Write people as a COCO keypoint file with 136 keypoints in Halpe's order."""
    a = annotations
    flags = np.where(a.visibility < 0, FLAG_OUTSIDE, a.visibility)[..., None]
    given = np.isfinite(a.keypoints_px).all(axis=-1, keepdims=True) | (flags == FLAG_OUTSIDE)
    triples = np.where(given, np.concatenate([np.nan_to_num(a.keypoints_px), flags], axis=-1), 0.0)
    columns = {
        "id": a.ids, "image_id": a.image_ids, "category_id": np.full(len(a), PERSON_CATEGORY),
        "bbox": a.boxes_px, "area": a.areas_px2, "iscrowd": a.is_crowd.astype(int),
        "num_keypoints": (a.visibility[:, COCO_17] > 0).sum(axis=1),
        "keypoints": triples.reshape(len(a), 3 * N_KEYPOINTS),
    }  # fmt: skip
    values = zip(*(of.tolist() for of in columns.values()), strict=True)
    people = [e | dict(zip(columns, of, strict=True)) for e, of in zip(a.extras, values, strict=True)]
    category = {**PERSON, "keypoints": list(NAMES)}
    write_json(path, {"images": image_rows(a), "annotations": people, "categories": [category]})


def image_rows(annotations: Annotations) -> list[dict]:
    """The images as COCO has them in a file."""
    return [
        {"id": image.id, "file_name": image.file_name, "width": image.width_px, "height": image.height_px}
        for image in annotations.images.values()
    ]

"""Detections drawn over images: PNG files, or one self-contained HTML page.

Images are sorted worst first: with annotations by the lowest OKS among their people (0 for a missed person),
without by the lowest score of a person. Images without detected or annotated people come last.
"""

import base64
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json, write_bytes
from hicp_lib.core.folders import listed
from hicp_lib.core.images import read_image, write_png
from hicp_lib.core.keypoints import FACE, GROUPS, HANDS, LIMBS, NAMES
from hicp_lib.core.names import is_inside
from hicp_lib.detectors.runtime.to_file import IMAGE_SUFFIXES
from hicp_lib.evaluation.ap.person_oks import person_oks
from hicp_lib.formats.annotations import Annotations, refuse_other_sizes, rows_by_image
from hicp_lib.formats.detection_files import names_beside, rows_in_parts
from hicp_lib.formats.json_validation import Rows
from hicp_lib.inspection.skeletons import draw_people

MAX_SIDE_PX = 960  # images on a page are not larger than this
_TRUTH_COLOUR, _FOUND_COLOUR = "#E69F00", "#56B4E9"  # of Okabe and Ito: colour-blind-safe
_JPEG_QUALITY = 85
Note = Callable[[str], object]


@dataclass(frozen=True)
class Picture:
    """One image and its people.

    Attributes
    ----------
    path : Path
    found : Detections
        The detections.
    truth : Detections or None
        The annotated people, labelled keypoints with score 1; None without annotations.
    oks : dict of str to list of float
        By group, of every evaluated person.
    """

    path: Path
    found: Detections
    truth: Detections | None
    oks: dict[str, list[float]]

    @property
    def quality(self) -> float:
        """The sort key of images: infinite without people."""
        values = sum(self.oks.values(), []) if self.truth is not None else self.found.person_scores.tolist()
        return min(values, default=np.inf)

    def line(self) -> str:
        """A description of it."""
        known = "" if self.truth is None else f"{len(self.truth)} annotated, "
        oks = [f"; OKS {group} {min(values):.2f}" for group, values in self.oks.items() if values]
        return f"{known}{len(self.found)} found{''.join(oks)}"


def pictures(
    paths: Mapping[int, Path], found: Mapping[int, Detections], annotations: Annotations | None
) -> list[Picture]:
    """The images with detections and annotations, worst first.

    Parameters
    ----------
    paths : mapping of int to Path
        The image of each id.
    found : mapping of int to Detections
        By image id.
    annotations : Annotations or None
        The annotations, if there are any.

    Returns
    -------
    list of Picture
    """
    given = [np.isfinite(people.keypoints_px).all(axis=-1).any(axis=0) for people in found.values()]
    groups = [name for name, points in GROUPS.items() if any(of[points].any() for of in given)]  # its own
    tables = {} if annotations is None else {of: person_oks(annotations, found, of) for of in groups}
    counted = {of: table[table["n_labelled"] > 0].groupby("image_id")["oks"] for of, table in tables.items()}
    oks = {of: by_image.agg(list).to_dict() for of, by_image in counted.items()}
    truth = {} if annotations is None else _truth(annotations)
    known = [
        Picture(path, found.get(i, Detections.none()), truth.get(i), {of: oks[of].get(i, []) for of in oks})
        for i, path in paths.items()
    ]
    return sorted(known, key=lambda picture: (picture.quality, picture.path.name))


def _truth(people: Annotations) -> dict[int, Detections]:
    """The annotated people in each image, labelled keypoints with score 1."""
    labelled, rows = (people.visibility > 0).astype(float), rows_by_image(people.image_ids)
    known = {i: Detections(people.keypoints_px[of], labelled[of], np.ones(len(of))) for i, of in rows.items()}
    return {i: known.get(i, Detections.none()) for i in people.images}


def image_paths(
    detections: Path, images: Path, found: Mapping[int, Detections], annotations: Annotations | None
) -> dict[int, Path]:
    """The file of each image id: by the annotations, names in or next to the detections, or numbers as names.

    Parameters
    ----------
    detections : Path
        Their file; a list of names may be next to it, as written by `hicp detect`.
    images : Path
        Folder of the pictures.
    found : mapping of int to Detections
        Its content.
    annotations : Annotations or None

    Returns
    -------
    dict of int to Path

    Raises
    ------
    InputError
        If the file of an image id is unknown, one of two or of another size than annotated, or a name leads
        out of the folder.
    """
    if not images.is_dir():
        raise InputError(f"{images}: is not a folder; give the folder that holds the pictures")
    known = {} if annotations is None else annotations.images
    names: dict = {i: image.file_name for i, image in known.items()}

    def add(path: Path, rows: Iterable[dict], key: str, advice: str = "give --annotations") -> None:
        for row in rows:
            i, name = row.get(key), row.get("file_name")
            if isinstance(i, int) and isinstance(name, str) and names.setdefault(i, name) != name:
                raise InputError(f"{path}: image {i} may be {names[i]!r} or {name!r}; {advice}")

    if annotations is None:
        found_in = (row for part in rows_in_parts(detections) for row in part)
        add(detections, (row for row in found_in if "frame" not in row), "image_id")
        if (beside := names_beside(detections)).is_file():
            rows = Rows.of(beside, "images", read_json(beside)).rows
            add(beside, rows, "id", f"remove it if it is not the list of {detections.name}")
        if not names:
            named = ((os.path.splitext(name)[0], name) for name in listed(images, IMAGE_SUFFIXES))
            numbers = [(int(stem), name) for stem, name in named if stem.isascii() and stem.isdigit()]
            add(images, ({"id": i, "file_name": name} for i, name in numbers), "id")
    for i in found.keys() - names.keys():
        raise InputError(f"{detections}: nothing says which picture image {i} is; give --annotations")
    for name in names.values():
        if not is_inside(name):
            raise InputError(f"{detections}: file name {name!r} leads out of the folder of pictures")
    if annotations is not None:
        refuse_other_sizes(annotations, images)
    return {i: images / name for i, name in names.items()}


def write_pngs(chosen: list[Picture], out: Path, min_score: float, note: Note = print) -> None:
    """Write the images with annotations and detections drawn, numbered worst first.

    Parameters
    ----------
    chosen : list of Picture
    out : Path
        A folder.
    min_score : float
        Detected keypoints below it are left out.
    note : callable, optional
        Called for every image that cannot be shown, one line each.

    Raises
    ------
    InputError
        If none of the pictures can be read.
    """
    for rank, (picture, image) in enumerate(_readable(chosen, note), 1):
        for people, colour in ((picture.truth, _TRUTH_COLOUR), (picture.found, _FOUND_COLOUR)):
            if people is not None:
                image = draw_people(image, people.keypoints_px, people.scores, colour, min_score)
        write_png(out / f"{rank:04}_{picture.path.stem}.png", image)


def write_page(chosen: list[Picture], out: Path, title: str, note: Note = print) -> None:
    """Write one HTML file with the images in it, and a slider for the minimum score.

    Parameters
    ----------
    chosen : list of Picture
    out : Path
    title : str
    note : callable, optional
        Called for every image that cannot be shown, one line each.

    Raises
    ------
    InputError
        If none of the pictures can be read.
    """
    content = {
        "title": title, "limbs": LIMBS, "names": NAMES, "hands": HANDS.tolist(), "face": FACE.tolist(),
        "pictures": [_row(picture, image) for picture, image in _readable(chosen, note)],
        "has_truth": any(picture.truth is not None for picture in chosen),
        "colours": {"truth": _TRUTH_COLOUR, "found": _FOUND_COLOUR},
    }  # fmt: skip
    data = json.dumps(content, allow_nan=False).replace("<", "\\u003c")  # cannot end the script element
    page = (DATA_DIR / "gallery.html").read_text(encoding="utf-8")
    write_bytes(out, page.replace("GALLERY_DATA", data).encode())


def _readable(chosen: list[Picture], note: Note) -> Iterator[tuple[Picture, np.ndarray]]:
    n_bad = 0
    for picture in chosen:
        try:
            yield picture, read_image(picture.path)
        except InputError as error:
            n_bad += 1
            note(str(error))
    if chosen and n_bad == len(chosen):
        raise InputError(f"{chosen[0].path.parent}: none of its {n_bad} pictures can be read")


def _row(picture: Picture, image: np.ndarray) -> dict:
    height_px, width_px = image.shape[:2]
    scale = min(1.0, MAX_SIDE_PX / max(height_px, width_px))
    if scale < 1:
        image = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    bgr, quality = cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY]
    return {
        "name": picture.path.name, "line": picture.line(), "width": width_px, "height": height_px,
        "jpeg": base64.b64encode(cv2.imencode(".jpg", bgr, quality)[1].tobytes()).decode(),
        "truth": _points(picture.truth or Detections.none()), "found": _points(picture.found),
    }  # fmt: skip


def _points(people: Detections) -> list[list[list[float]]]:
    """For every person, the given keypoints: index, u, v, score."""
    given = np.isfinite(people.keypoints_px).all(axis=-1) & (people.scores > 0)
    rows = zip(people.keypoints_px.round(1).tolist(), people.scores.round(3).tolist(), given, strict=True)
    return [[[int(k), *uv[k], of[k]] for k in np.flatnonzero(shown)] for uv, of, shown in rows]

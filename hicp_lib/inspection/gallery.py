"""What a detector found, drawn over its pictures: PNG files, or one HTML page that needs nothing else.

Pictures come worst first: with annotations by the lowest OKS among their people (someone not found has 0),
without by the lowest score of a person. Where nobody was found and nobody is known, a picture comes last.
"""

import base64
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json, write_bytes
from hicp_lib.core.images import read_image, write_png
from hicp_lib.core.keypoints import FACE, GROUPS, HANDS, LIMBS, N_KEYPOINTS, NAMES
from hicp_lib.evaluation.ap.person_oks import person_oks
from hicp_lib.formats.annotations import Annotations
from hicp_lib.formats.detection_files import read_rows
from hicp_lib.inspection.skeletons import draw_people

MAX_SIDE_PX = 960
"""Pictures of a page are not larger than this."""

_TRUTH_COLOUR, _FOUND_COLOUR = "#E69F00", "#56B4E9"  # of Okabe and Ito: told apart by everybody
_JPEG_QUALITY = 85


@dataclass(frozen=True)
class Picture:
    """One image and who is in it.

    Attributes
    ----------
    path : Path
    found : Detections
        What the detector gives.
    truth : Annotations or None
        The people known to be in it; None where there are no annotations.
    oks : dict of str to list of float
        By group, of every person who counts.
    """

    path: Path
    found: Detections
    truth: Annotations | None
    oks: dict[str, list[float]]

    @property
    def quality(self) -> float:
        """What pictures are sorted by: infinite where there is nobody."""
        values = sum(self.oks.values(), []) if self.truth is not None else self.found.person_scores.tolist()
        return min(values, default=np.inf)

    def line(self) -> str:
        """What there is to say of it."""
        if self.truth is None:
            return f"{len(self.found)} found"
        parts = [f"{len(self.truth)} annotated, {len(self.found)} found"]
        parts += [f"OKS {group} {min(values):.2f}" for group, values in self.oks.items() if values]
        return "; ".join(parts)


def pictures(
    paths: Mapping[int, Path], found: Mapping[int, Detections], annotations: Annotations | None
) -> list[Picture]:
    """The images with what is found and known in them, worst first.

    Parameters
    ----------
    paths : mapping of int to Path
        The image of each id.
    found : mapping of int to Detections
        By image id.
    annotations : Annotations or None
        The truth, where it is known.

    Returns
    -------
    list of Picture
    """
    given = np.zeros(N_KEYPOINTS, bool)
    for people in found.values():
        given |= np.isfinite(people.keypoints_px).all(axis=-1).any(axis=0)
    groups = [name for name, keypoints in GROUPS.items() if given[keypoints].any()]  # the detector's own
    oks = {} if annotations is None else {name: person_oks(annotations, found, name) for name in groups}
    known = [
        Picture(
            path,
            found.get(i, Detections.none()),
            None if annotations is None else annotations.take(annotations.image_ids == i),
            {group: _of_image(table, i) for group, table in oks.items()},
        )
        for i, path in paths.items()
    ]
    return sorted(known, key=lambda picture: (picture.quality, picture.path.name))


def image_paths(
    detections: Path, images: Path, found: Mapping[int, Detections], annotations: Annotations | None
) -> dict[int, Path]:
    """The picture of each image id: by the annotations, or by names that stand in or beside the detections.

    Parameters
    ----------
    detections : Path
        Their file; a list of names may lie beside it, as `hicp detect` writes it.
    images : Path
        Folder of the pictures.
    found : mapping of int to Detections
        What the file holds.
    annotations : Annotations or None

    Returns
    -------
    dict of int to Path

    Raises
    ------
    InputError
        If nothing says which picture an image id is, or a name leads out of the folder.
    """
    if not images.is_dir():
        raise InputError(f"{images}: is not a folder; give the folder that holds the pictures")
    if annotations is not None:
        names = {i: image.file_name for i, image in annotations.images.items()}
    else:
        beside = detections.with_suffix(".images.json")
        rows = read_json(beside) if beside.is_file() else read_rows(detections)
        rows = [row for row in rows if isinstance(row, dict) and isinstance(row.get("file_name"), str)]
        names = {row.get("id", row.get("image_id")): row["file_name"] for row in rows if "frame" not in row}
        names = names or {int(path.stem): path.name for path in images.iterdir() if path.stem.isdecimal()}
    for i in found:
        if i not in names:
            raise InputError(f"{detections}: nothing says which picture image {i} is; give --annotations")
    for name in names.values():
        if not (images / name).resolve().is_relative_to(images.resolve()):
            raise InputError(f"{detections}: file name {name!r} leads out of the folder of pictures")
    return {i: images / name for i, name in names.items()}


def _of_image(table: pd.DataFrame, image_id: int) -> list[float]:
    counts = (table["image_id"] == image_id) & (table["n_labelled"] > 0)
    return table.loc[counts, "oks"].tolist()


def write_pngs(chosen: list[Picture], out: Path, min_score: float) -> None:
    """Write the pictures with truth and detections drawn, numbered worst first.

    Parameters
    ----------
    chosen : list of Picture
    out : Path
        A folder.
    min_score : float
        Detected keypoints below it are left out.
    """
    for rank, picture in enumerate(chosen, 1):
        image = read_image(picture.path)
        if picture.truth is not None:
            known = (picture.truth.visibility > 0).astype(float)
            image = draw_people(image, picture.truth.keypoints_px, known, _TRUTH_COLOUR)
        image = draw_people(image, picture.found.keypoints_px, picture.found.scores, _FOUND_COLOUR, min_score)
        write_png(out / f"{rank:04}_{picture.path.stem}.png", image)


def write_page(
    chosen: list[Picture], out: Path, title: str, note: Callable[[str], object] = lambda line: None
) -> None:
    """Write one HTML file with the pictures in it, and a slider for the least score.

    Parameters
    ----------
    chosen : list of Picture
    out : Path
    title : str
    note : callable, optional
        Told of every picture that cannot be shown, one line each.

    Raises
    ------
    InputError
        If none of the pictures can be read.
    """
    shown = [row for picture in chosen for row in _row(picture, note)]
    if chosen and not shown:
        raise InputError(f"{chosen[0].path.parent}: none of its {len(chosen)} pictures can be read")
    content = {
        "title": title, "limbs": LIMBS, "names": NAMES, "hands": HANDS.tolist(), "face": FACE.tolist(),
        "pictures": shown, "has_truth": any(picture.truth is not None for picture in chosen),
        "colours": {"truth": _TRUTH_COLOUR, "found": _FOUND_COLOUR},
    }  # fmt: skip
    data = json.dumps(content, allow_nan=False).replace("<", "\\u003c")  # ends no script element
    page = (DATA_DIR / "gallery.html").read_text(encoding="utf-8")
    write_bytes(out, page.replace("GALLERY_DATA", data).encode())


def _row(picture: Picture, note: Callable[[str], object]) -> Iterator[dict]:
    try:
        image = read_image(picture.path)
    except InputError as error:
        note(str(error))
        return
    height_px, width_px = image.shape[:2]
    scale = min(1.0, MAX_SIDE_PX / max(height_px, width_px))
    if scale < 1:
        image = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    options = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY]
    _, jpeg = cv2.imencode(".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), options)
    truth = picture.truth
    yield {
        "name": picture.path.name, "line": picture.line(), "width": width_px, "height": height_px,
        "jpeg": base64.b64encode(jpeg.tobytes()).decode(),
        "truth": [] if truth is None else _people(truth.keypoints_px, (truth.visibility > 0).astype(float)),
        "found": _people(picture.found.keypoints_px, picture.found.scores),
    }  # fmt: skip


def _people(keypoints_px: np.ndarray, scores: np.ndarray) -> list[list[list[float]]]:
    """Of every person, the keypoints that are given: index, u, v, score."""
    given = np.isfinite(keypoints_px).all(axis=-1) & (scores > 0)
    rows = zip(keypoints_px.round(1), scores.round(3), given, strict=True)
    return [
        [[int(k), *points[k].tolist(), float(sure[k])] for k in np.flatnonzero(which)]
        for points, sure, which in rows
    ]

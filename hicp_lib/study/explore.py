"""What readers explore on the book's pages: small pictures and numbers for the scripts in `book/_scripts`.

Every function returns an explorer's data and, by file name, what it loads beside them. Keypoints of people
are flat lists: index, coordinates and score of one after the other.
"""

import io
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from PIL import Image

from hicp_lib.core.detections import Detections
from hicp_lib.core.images import read_image
from hicp_lib.core.keypoints import LIMBS
from hicp_lib.evaluation.cases import Found, Truth
from hicp_lib.formats.annotations import Annotations
from hicp_lib.study.plots.doses import level_text
from hicp_lib.study.plots.palette import detector_colour, detector_marker

Explored = tuple[dict[str, Any], dict[str, bytes]]
MAX_SIDE_PX = 480
SAME_PEOPLE = ("basic", "headless")
"""Subsets in which equal image ids are of one person."""


def crops(
    folders: Mapping[str, Path], truth: Truth, found: Found, oks: pd.DataFrame, n_people: int = 60
) -> Explored:
    """People spread over the data set, in every subset they are in, as the detectors see them.

    Parameters
    ----------
    folders : mapping of str to Path
        Subset -> dataset folder.
    truth : Truth
        By subset.
    found : Found
        By image id, of every subset and detector.
    oks : pd.DataFrame
        As from `hicp_lib.evaluation.ap.metric_table.people_oks`.
    n_people : int, optional
        How many at most of each set of people.

    Returns
    -------
    dict of str to object
    dict of str to bytes
    """
    families: dict[str, dict[str, Annotations]] = {}
    for subset, annotations in truth.items():
        families.setdefault("pair" if subset in SAME_PEOPLE else subset, {})[subset] = annotations
    fits = dict(iter(oks.groupby(["subset", "image_id"], sort=False)))
    people, files = [], {}
    for family in families.values():
        for image_id in spread({i for annotations in family.values() for i in annotations.images}, n_people):
            views = {}
            for subset, annotations in family.items():
                if image_id in annotations.images:
                    here = {d: of[image_id] for (s, d), of in found.items() if s == subset and image_id in of}
                    file, rows = f"{subset}-{image_id}.webp", fits.get((subset, image_id), oks[:0])
                    shown, files[file] = _view(folders[subset] / "images", annotations, image_id, here)
                    views[subset] = shown | {"file": file, "oks": _rows(rows, "oks")}
            people.append({"id": image_id, "views": views})
    return styles(detector for _, detector in found) | {"people": people, "subsets": list(truth)}, files


def doses(
    folder: Path, people: Annotations, found: Mapping[str, Mapping[int, Detections]], curves: pd.DataFrame,
    n_people: int = 3,
) -> Explored:  # fmt: skip
    """The first people at every level of every dose, and AP there.

    Parameters
    ----------
    folder : Path
        As from `hicp_lib.experiments.doses.open_doses`.
    people : Annotations
        Its annotations.
    found : mapping of str to mapping of int to Detections
        By detector and image id.
    curves : pd.DataFrame
        As from `hicp_lib.evaluation.failures.dose_curves.dose_curves`.
    n_people : int, optional

    Returns
    -------
    dict of str to object
    dict of str to bytes
    """
    files: dict[str, bytes] = {}
    taken: dict[str, dict[float, list]] = {}
    for image_id, extra in zip(people.image_ids.tolist(), people.extras, strict=True):
        if extra["source_image_id"] < n_people:
            here = {name: of[image_id] for name, of in found.items() if image_id in of}
            shown, files[f"{image_id}.webp"] = _view(folder / "images", people, image_id, here)
            views = taken.setdefault(extra["dose"], {}).setdefault(extra["level"], [])
            views.append(shown | {"file": f"{image_id}.webp"})
    ap = dict(iter(curves[curves["measure"] == "AP"].groupby(["dose", "level"])))
    told = [
        {"name": dose, "levels": [level_text(dose, level) for level in levels], "views": [*levels.values()]}
        | {"ap": [_rows(ap[dose, level], "value", "low", "high") for level in levels]}
        for dose, levels in taken.items()
    ]
    n = len({extra["source_image_id"] for extra in people.extras})
    return styles(found) | {"doses": told, "n_people": n}, files


def styles(detectors: Iterable[str]) -> dict[str, Any]:
    """How detectors are drawn, and which keypoints are joined.

    Parameters
    ----------
    detectors : iterable of str

    Returns
    -------
    dict of str to object
        `detectors` and `limbs`.
    """
    names = dict.fromkeys(detectors)
    shown = [{"name": d, "colour": detector_colour(d), "marker": detector_marker(d)} for d in names]
    return {"detectors": shown, "limbs": LIMBS}


def spread(values: Iterable[int], n: int) -> list[int]:
    """Some of the values, evenly over their order.

    Parameters
    ----------
    values : iterable of int
    n : int
        How many at most.

    Returns
    -------
    list of int

    Examples
    --------
    >>> spread([5, 1, 2, 3, 4], 3), spread([], 3)
    ([1, 3, 5], [])
    """
    ordered = sorted(values)
    return ordered[:: max(1, -(-len(ordered) // n))]


def _view(
    images_dir: Path, truth: Annotations, image_id: int, found: Mapping[str, Detections]
) -> tuple[dict[str, Any], bytes]:
    """`size`, `truth` (its scores are visibilities) and `found` of a picture, and the picture made small."""
    picture = Image.fromarray(read_image(images_dir / truth.images[image_id].file_name))
    scale = min(1.0, MAX_SIDE_PX / max(picture.size))
    size = [max(1, round(scale * side_px)) for side_px in picture.size]
    small = picture.resize(size, Image.Resampling.LANCZOS)
    rows = truth.take((truth.image_ids == image_id) & ~truth.is_other)
    people = {name: flat((of.keypoints_px + 0.5) * scale, of.scores) for name, of in found.items()}
    true = flat((rows.keypoints_px + 0.5) * scale, np.maximum(rows.visibility, 0))
    return {"size": size, "truth": true, "found": people}, webp(small)


def webp(picture: Image.Image) -> bytes:
    """The content of a WebP file.

    Parameters
    ----------
    picture : PIL.Image.Image

    Returns
    -------
    bytes
    """
    picture.save(content := io.BytesIO(), format="webp", quality=70, method=4)
    return content.getvalue()


def flat(points: np.ndarray, scores: np.ndarray, digits: int = 1) -> list[list[float]]:
    """Keypoints of each person, as scripts take them.

    Parameters
    ----------
    points : array, shape (n, k, d)
    scores : array, shape (n, k)
        A keypoint is given where it is above 0 and the point finite.
    digits : int, optional
        Decimals of the coordinates.

    Returns
    -------
    list of list of float
        Index, coordinates and score of each keypoint that is given, in one list per person.

    Examples
    --------
    >>> flat(np.array([[[1.26, 2], [np.nan, 0], [3, 4]]]), np.array([[0.5, 0.5, 0.25]]))
    [[0, 1.3, 2.0, 0.5, 2, 3.0, 4.0, 0.25]]
    """
    people = []
    for places, given in zip(points, scores, strict=True):
        shown = np.flatnonzero(np.isfinite(places).all(axis=1) & (given > 0))
        rounded = places[shown].round(digits).astype(float if digits else int)
        columns = [shown, *rounded.T, given[shown].round(2)]
        rows = zip(*(column.tolist() for column in columns), strict=True)
        people.append([number for row in rows for number in row])
    return people


def _rows(table: pd.DataFrame, *columns: str) -> list[list[Any]]:
    """Rows of detector, group and numbers; None where there is none."""
    chosen = table[["detector", "group", *columns]].round(3).astype(object)
    return chosen.where(chosen.notna(), None).to_numpy().tolist()

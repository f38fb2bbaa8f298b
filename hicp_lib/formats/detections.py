"""Read and write detections: COCO keypoint results, or tables (`hicp_lib.formats.detection_files`).

They are checked when they are read, by the conventions of `hicp_lib.formats.annotations`. Detections keep the
scores they come with, which need not lie in [0, 1]. A keypoint 0, 0, 0 is missing. Equal detections are
allowed: the second is a false positive.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.formats.annotations import Annotations, of_people, rows_by_image
from hicp_lib.formats.detection_files import KNOWN_KEYS, open_detections, rows_in_parts
from hicp_lib.formats.importers.matching import ImageMatcher
from hicp_lib.formats.json_validation import Rows
from hicp_lib.formats.layouts import PERSON_CATEGORY, PersonCategory
from hicp_lib.formats.units import count_fractions, fractions_note


def read_detections(
    path: str | Path, annotations: Annotations | None = None, extras: dict[int, list[dict]] | None = None
) -> dict[int, Detections]:
    """Read COCO keypoint results (a list of `image_id, category_id, keypoints, score`).

    An empty list is valid: nobody was found. If the first result has a `file_name`, all need one, and it
    identifies the image.

    Parameters
    ----------
    path : str or Path
        A JSON file.
    annotations : Annotations, optional
        Every image must be among theirs; images without a detection get an empty result.
    extras : dict of int to list of dict, optional
        Filled with the further keys of each person's JSON object, by image id, as `write_detections` takes
        them; of a table, with what is known of the image, and the raw scores.

    Returns
    -------
    dict of int to Detections
        By image id; people keep the order of the file.

    Raises
    ------
    InputError
        For anything malformed: NaN, a wrong number of keypoints, an unknown image, ...
    """
    found = {} if annotations is None else dict.fromkeys(annotations.images, Detections.none())
    for image_ids, people, rows in _in_parts(Path(path), annotations):
        for image_id, chosen in rows_by_image(image_ids).items():
            if extras is not None:
                further = ({k: v for k, v in rows.rows[i].items() if k not in KNOWN_KEYS} for i in chosen)
                extras.setdefault(image_id, []).extend(further)
            more = people.take(chosen)
            found[image_id] = found[image_id].concatenate(more) if len(found.get(image_id, ())) else more
    return dict(sorted(found.items())) if annotations is None else found


def detections_in_parts(
    path: str | Path, annotations: Annotations | None = None, notes: dict[str, str] | None = None
) -> Iterator[tuple[np.ndarray, Detections]]:
    """As `read_detections`, some people at a time in the order of the file, so that memory need not hold it.

    Parameters
    ----------
    path : str or Path
        As of `read_detections`.
    annotations : Annotations, optional
        As of `read_detections`.
    notes : dict of str to str, optional
        Filled with remarks on the file, after the last part.

    Yields
    ------
    image_ids : array of int, shape (n,)
        Of each person.
    people : Detections
        They need not be of one image.

    Raises
    ------
    InputError
        As `read_detections`, also after the last part.
    """
    yield from ((image_ids, people) for image_ids, people, _ in _in_parts(Path(path), annotations, notes))


def _in_parts(
    path: Path, annotations: Annotations | None, notes: dict[str, str] | None = None
) -> Iterator[tuple[np.ndarray, Detections, Rows]]:
    """As `detections_in_parts`, with the objects, which have lost their keypoints."""
    category = PersonCategory() if annotations is None else annotations.category
    allowed = {category.id, PERSON_CATEGORY} - category.others
    matcher = None if annotations is None else ImageMatcher(path, "id", annotations.images)
    n, fractions = 0, []
    for part in _whole_images(rows_in_parts(path)):
        rows = Rows.of(path, "results", part, name_key="image_id", first=n)
        n += len(rows.rows)
        person_scores = rows.numbers("score")
        of_people(rows, replace(category, others=set()), allowed)
        image_ids = rows.integers("image_id") if matcher is None else matcher.images_of(rows)
        triples, _ = rows.keypoints()
        keypoints = triples[..., :2]
        np.copyto(keypoints, np.nan, where=~triples.any(axis=-1, keepdims=True))
        fractions.append(count_fractions(keypoints, rows.first))
        yield image_ids, Detections(keypoints, triples[..., 2], person_scores), rows
    if (note := fractions_note(path, fractions)) and notes is not None:
        notes["fractions"] = note


def _whole_images(parts: Iterable[Any]) -> Iterator[Any]:
    """Lists that end where another image begins, none of them empty; what is no list as it is."""
    waiting: list = []
    for part in parts:
        if not isinstance(part, list):
            yield part
            continue
        waiting += part
        images = [row.get("file_name", row.get("image_id")) for row in waiting if isinstance(row, dict)]
        end = next((i for i in range(len(images) - 1, 0, -1) if images[i] != images[i - 1]), 0)
        if end:
            yield waiting[:end]
        waiting = waiting[end:]
    if waiting:
        yield waiting


def write_detections(
    path: str | Path, detections: Mapping[int, Detections], extras: Mapping[int, list[dict]] | None = None
) -> None:
    """Write detections in the format of the file's suffix, as `hicp_lib.formats.detection_files` says.

    Parameters
    ----------
    path : str or Path
        The file to write.
    detections : mapping of int to Detections
        By image id.
    extras : mapping of int to list of dict, optional
        By image id, further keys of each person's JSON object. Of these, tables hold only what is known of
        images, and raw scores.
    """
    with open_detections(path) as write:
        for image_id, found in detections.items():
            write(int(image_id), {}, found, extras and extras.get(image_id))

"""Lists of COCO keypoint results, as COCO, Detectron2, AlphaPose and OpenPose write them.

All have `image_id, category_id, keypoints, score`; the differences between tools are a `Dialect`:

- COCO: the third number of a keypoint has no fixed meaning; a keypoint 0, 0, 0 is missing. Tables that `hicp
  detect` writes, and data sets that `hicp export` writes, are read too. Where every row has a `file_name`,
  that is the image's name, not the id.
- Detectron2's `coco_instances_results.json`: it subtracts half a pixel from its continuous coordinates when
  writing, which puts pixel centres at integers as everywhere here, so nothing is added on reading. Keypoint
  scores are the softmax mass of the best cell of a 56 x 56 grid: small numbers, of which 0.05 is high.
- AlphaPose's `alphapose-results.json`: `image_id` is a file name, or with `--eval` the number at its end. All
  keypoints are always there. The person's score is mean + box + 1.25 max, about 0.5 to 3. Keypoint scores of
  its regression models are far below those of its heat maps (its own drawings use thresholds of 0.05 and
  0.4).
- OpenPose's `--write_coco_json`: the body's 17, found (1) or not (0), and the number in the file name.
  They exceed pixel centres at integers by half a pixel, which is subtracted.

Sources: the COCO results format, and the writers of Detectron2 (`coco_evaluation.py`), AlphaPose
(`pPose_nms.py`) and OpenPose (`cocoJsonSaver.cpp`).
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.formats.annotations import PERSON_CATEGORY
from hicp_lib.formats.detection_files import KNOWN_KEYS, read_rows
from hicp_lib.formats.importers.people import People, split
from hicp_lib.formats.json_validation import Rows, shown


@dataclass(frozen=True)
class Dialect:
    """The conventions of one tool.

    Attributes
    ----------
    tool : str
        For messages.
    file_name : str
        Looked for when a folder is given.
    named_by : {"id", "number"}
        What a number in `image_id` means, see `People`.
    absent : {"zeros", "score"}
        A keypoint is not given when all three numbers are 0, or when its score is not positive.
    categories : tuple of int
        Ids that mean a person.
    offset_px : float
        By how much its coordinates exceed those with pixel centres at integers.
    """

    tool: str
    file_name: str
    named_by: Literal["id", "number"] = "id"
    absent: Literal["zeros", "score"] = "score"
    categories: tuple[int, ...] = (1,)
    offset_px: float = 0.0


COCO = Dialect("COCO", "results.json", absent="zeros")
# Without a registered COCO data set, Detectron2 counts its only class, the person, as 0.
DETECTRON2 = Dialect("Detectron2", "coco_instances_results.json", categories=(1, 0))
ALPHAPOSE = Dialect("AlphaPose", "alphapose-results.json", named_by="number")
OPENPOSE = Dialect("OpenPose", "coco.json", named_by="number", offset_px=0.5)


def read_results(path: Path, dialect: Dialect) -> People:
    """Read a list of COCO keypoint results, or in a folder the file with the tool's usual name.

    Parameters
    ----------
    path : Path
        The file, or a folder with a file of the tool's usual name.
    dialect : Dialect
        The tool's conventions.

    Returns
    -------
    People

    Raises
    ------
    InputError
        For anything malformed; the message names the file, the row, the key and what was expected.
    """
    path = path / dialect.file_name if path.is_dir() else path
    rows = Rows.of(path, "results", _checked_list(path, read_rows(path), dialect), name_key="image_id")
    sources, source_of = _sources(rows)
    for i, category in enumerate(rows.column("category_id", default=PERSON_CATEGORY)):
        if type(category) is not int or category not in dialect.categories:
            raise rows.error(i, f"category_id is {shown(category)}; expected 1 (person), leave others out")
    triples, conventions = rows.keypoints()
    given = triples[..., 2] > 0 if dialect.absent == "score" else (triples != 0).any(axis=-1)
    keypoints, scores = split(triples, given)
    return People(
        path, dialect.named_by, sources, source_of, keypoints - dialect.offset_px, scores,
        rows.numbers("score"), conventions, rows.extras(KNOWN_KEYS | {"file_name"}),
    )  # fmt: skip


def _checked_list(path: Path, value: Any, dialect: Dialect) -> list:
    if isinstance(value, dict) and dialect is ALPHAPOSE:
        raise InputError(f"{path}: was written with --format cmu or open; run AlphaPose without --format")
    if isinstance(value, dict) and (exported := _exported(value.get("annotations"))):
        return exported
    if isinstance(value, dict) and "annotations" in value:
        raise InputError(f"{path}: holds annotations; expected {dialect.tool} results, a list of objects")
    return value


def _exported(rows: Any) -> list[dict]:
    """Results from a data set that `hicp export` wrote, its flags replaced by its scores; else None."""
    try:
        triples = [np.reshape(row["keypoints"], (-1, 3)).copy() for row in rows]
        for row, of in zip(rows, triples, strict=True):
            of[:, 2] = row["confidence"]
    except (KeyError, TypeError, ValueError):
        return []
    return [row | {"keypoints": of.ravel().tolist()} for row, of in zip(rows, triples, strict=True)]


def _is_image_id(value: Any) -> bool:
    return (type(value) is int and abs(value) < 2**63) or (isinstance(value, str) and value != "")


def _sources(rows: Rows) -> tuple[list[str | int], np.ndarray]:
    """The images in the order of the file, by name where all rows have one, and the index of each row's."""
    named = bool(rows.rows) and all("file_name" in row for row in rows.rows)
    key = "file_name" if named else "image_id"
    keys = rows.column(key, _is_image_id, "a whole number or a file name")
    index = {key: i for i, key in enumerate(dict.fromkeys(keys))}
    return list(index), np.array([index[key] for key in keys], dtype=int)

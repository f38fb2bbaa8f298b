"""Detections written one image after the other, however many: JSON, CSV or Parquet, as the suffix says.

- `.json`: COCO keypoint results, a list with an object for each person, 136 keypoints in Halpe's order. What
  is known of the image (`file_name`; of a video's frame `frame` and `time_s`) stands beside `image_id`.
- `.csv`, `.parquet`: one row per image x person x keypoint given; columns `image_id`, what is known of the
  image, `person` (from 0), `person_score`, `keypoint` (Halpe's name), `u_px`, `v_px`, `score`.

The bytes follow from the detections and their order alone.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError, one_line
from hicp_lib.core.extras import require
from hicp_lib.core.files import atomic_path, read_json
from hicp_lib.core.keypoints import INDEX, N_KEYPOINTS, NAMES

SUFFIXES = (".json", ".csv", ".parquet")
_IMAGES_AT_ONCE = 1000  # of a table; a group of rows of Parquet
_OF_PERSON = ["person", "person_score", "keypoint", "u_px", "v_px", "score"]
Write = Callable[[int, Mapping[str, Any], Detections], None]


def refuse_other_suffix(path: str | Path) -> None:
    """Refuse, before anything is done, a file to write that is in none of the formats.

    Raises
    ------
    InputError
        For another suffix, or Parquet without its library.
    """
    suffix = Path(path).suffix
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: ends in {suffix or 'no suffix'!r}; expected {', '.join(SUFFIXES)}")
    if suffix == ".parquet":
        require("analysis", "pyarrow")


@contextmanager
def open_detections(path: str | Path) -> Iterator[Write]:
    """Write a file of detections, whole or not at all.

    Parameters
    ----------
    path : str or Path
        Its suffix is the format.

    Yields
    ------
    callable
        Takes, of one image after the other, its id, what is known of it, and the people in it.

    Raises
    ------
    InputError
        As `refuse_other_suffix`.
    """
    refuse_other_suffix(path)
    kind = Path(path).suffix
    with atomic_path(path) as temporary:
        if kind == ".json":
            with json_list(temporary) as append:
                yield lambda image_id, facts, found: append(*result_rows(image_id, facts, found))
            return
        with _csv(temporary) if kind == ".csv" else _parquet(temporary) as append_table:
            images: list[tuple] = []

            def write(*image: Any) -> None:
                if len(images) == _IMAGES_AT_ONCE:
                    append_table(_columns(images))
                    images.clear()
                images.append(image)

            yield write
            append_table(_columns(images))


@contextmanager
def json_list(path: Path) -> Iterator[Callable[..., None]]:
    """Write a list in JSON, item by item.

    Parameters
    ----------
    path : Path

    Yields
    ------
    callable
        Takes the next items, JSON-able, or with arrays.
    """
    with open(path, "wb") as file:
        before = b"["

        def append(*items: object) -> None:
            nonlocal before
            for item in items:
                file.write(before + orjson.dumps(item, option=orjson.OPT_SERIALIZE_NUMPY))
                before = b",\n"

        yield append
        file.write(b"]\n" if before != b"[" else b"[]\n")


def result_rows(image_id: int, facts: Mapping[str, Any], found: Detections) -> Iterator[dict]:
    """The people of an image as COCO keypoint results; `facts` are further keys of each.

    Raises
    ------
    ValueError
        For a score that is no number.
    """
    triples = np.concatenate([found.keypoints_px, found.scores[..., None]], axis=-1)
    triples[~np.isfinite(found.keypoints_px).all(axis=-1)] = 0.0
    if not (np.isfinite(triples).all() and np.isfinite(found.person_scores).all()):
        raise ValueError(f"image {image_id}: a score is not a finite number")
    for flat, score in zip(triples.reshape(len(found), -1), found.person_scores.tolist(), strict=True):
        yield {"image_id": image_id, **facts, "category_id": 1, "keypoints": flat, "score": score}


@contextmanager
def _csv(path: Path) -> Iterator[Callable[[dict], None]]:
    with open(path, "w", encoding="utf-8", newline="") as file:
        yield lambda columns: pd.DataFrame(columns).to_csv(file, index=False, header=file.tell() == 0)


@contextmanager
def _parquet(path: Path) -> Iterator[Callable[[dict], None]]:
    import pyarrow
    from pyarrow.parquet import ParquetWriter

    with ExitStack() as stack:
        writers = []

        def append(columns: dict) -> None:
            table = pyarrow.table(columns)
            if not writers:
                writers.append(stack.enter_context(ParquetWriter(path, table.schema)))
            writers[0].write_table(table)

        yield append


def _columns(images: list[tuple]) -> dict[str, Any]:
    """Rows of a table, a keypoint each, of images as `open_detections` takes them."""
    founds = [found for _, _, found in images] or [Detections.none()]
    points, scores, person_scores = (
        np.concatenate([getattr(found, name) for found in founds])
        for name in ("keypoints_px", "scores", "person_scores")
    )
    facts = pd.DataFrame(
        [{"image_id": image_id, **known} for image_id, known, _ in images] or {"image_id": []}
    )
    # Texts are that also where there is no row: Parquet asks for the same type in every group.
    facts = facts.convert_dtypes(convert_integer=False, convert_floating=False)
    of_image = np.repeat(np.arange(len(founds)), list(map(len, founds)))
    person = np.concatenate([np.arange(len(found)) for found in founds])
    rows, keypoints = np.nonzero(np.isfinite(points).all(axis=-1))
    of_person = person[rows], person_scores[rows], np.array(NAMES)[keypoints]
    u_px, v_px = points[rows, keypoints].T
    named = zip(_OF_PERSON, (*of_person, u_px, v_px, scores[rows, keypoints]), strict=True)
    return {name: facts[name].to_numpy()[of_image[rows]] for name in facts} | dict(named)


def read_rows(path: Path) -> Any:
    """What a file of COCO keypoint results holds, to be checked: a list of objects, also out of a table.

    Raises
    ------
    InputError
        If it cannot be read, or is a table without the columns that `open_detections` writes.
    """
    if path.suffix not in (".csv", ".parquet"):
        return read_json(path)
    refuse_other_suffix(path)
    try:
        read = pd.read_parquet if path.suffix == ".parquet" else _read_csv
        table = read(path)
    except (OSError, ValueError) as error:  # pyarrow's and pandas' own are among these
        raise InputError(f"{path}: cannot be read as a table ({one_line(error)})") from None
    if absent := [name for name in ["image_id", *_OF_PERSON] if name not in table]:
        raise InputError(f"{path}: has no column {absent[0]!r}; expected a table that hicp detect wrote")
    keypoints = table["keypoint"].map(INDEX)
    if keypoints.isna().any():
        raise InputError(f"{path}: keypoint {table['keypoint'][keypoints.isna()].iloc[0]!r} is not known")
    people = table.groupby(["image_id", "person"], sort=False)
    triples = np.zeros((people.ngroups, N_KEYPOINTS, 3))
    triples[people.ngroup(), keypoints.astype(int)] = table[["u_px", "v_px", "score"]]
    rest = people.first().reset_index().drop(columns=["person", "keypoint", "u_px", "v_px", "score"])
    rows = rest.rename(columns={"person_score": "score"}).to_dict("records")
    flat = triples.reshape(len(rows), -1).tolist()
    return [row | {"keypoints": keypoints} for row, keypoints in zip(rows, flat, strict=True)]


def _read_csv(path: Path) -> pd.DataFrame:
    return pd.read_csv(path, float_precision="round_trip", dtype={"file_name": str})

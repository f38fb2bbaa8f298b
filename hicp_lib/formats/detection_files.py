"""Detections written image by image, in any number: JSON, CSV or Parquet, by the file's suffix.

- `.json`: COCO keypoint results, a list with an object for each person, 136 keypoints in Halpe's order. Next
  to `image_id` stands what is known of the image (`file_name`; for a video, `frame` and `time_s`).
- `.csv`, `.parquet`: one row per image x person x keypoint given; columns `image_id`, what is known of the
  image, `person` (from 0), `person_score`, `keypoint` (Halpe's name), `u_px`, `v_px`, `score`, and
  `raw_score`, the original one where `score` was converted. Further keys of people are not in tables.

The bytes depend on the detections and their order only.
"""

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError, one_line
from hicp_lib.core.extras import require
from hicp_lib.core.files import atomic_path, remove_left
from hicp_lib.core.keypoints import INDEX, N_KEYPOINTS, NAMES
from hicp_lib.core.tables import read_table_in_parts
from hicp_lib.formats.json_validation import PART_KEYS
from hicp_lib.formats.layouts import PERSON_CATEGORY
from hicp_lib.formats.number_lists import read_people, read_people_in_parts

SUFFIXES = (".json", ".csv", ".parquet")
_TABLES = SUFFIXES[1:]
RAW_SCORES = "raw_keypoint_scores"  # a list in JSON, the column `raw_score` in tables
KNOWN_KEYS = {"image_id", "category_id", "keypoints", "score", *PART_KEYS}
CALIBRATED = "calibrated"  # whether keypoint scores are
FACTS = ("file_name", "frame", "time_s", CALIBRATED)  # in tables, too, if the first person has them
_KEYS = ["image_id", "person"]
_BUFFER_BYTES = 2**20
_PEOPLE_AT_ONCE = 1000  # per batch of a table, a row group of Parquet
_ROWS_AT_ONCE = 2**18  # of a table that is read
_Append = Callable[..., None]


def refuse_other_suffix(path: str | Path, suffixes: Sequence[str] = SUFFIXES) -> None:
    """Refuse an output file whose suffix is none of the formats, before any work is done.

    Parameters
    ----------
    path : str or Path
    suffixes : sequence of str, optional
        Of the formats.

    Raises
    ------
    InputError
        For another suffix, or Parquet without its library.
    """
    suffix = Path(path).suffix
    if suffix not in suffixes:
        raise InputError(f"{path}: ends in {suffix or 'no suffix'!r}; expected {', '.join(suffixes)}")
    if suffix == ".parquet":
        require("analysis", "pyarrow")


@contextmanager
def open_detections(path: str | Path) -> Iterator[_Append]:
    """Write a file of detections, whole or not at all; a list of images beside the earlier one is removed.

    Parameters
    ----------
    path : str or Path
        Its suffix is the format.

    Yields
    ------
    callable
        Takes, image by image, its id, what is known of it, the people in it, and optionally further keys of
        each person's JSON object.

    Raises
    ------
    InputError
        As `refuse_other_suffix`.
    """
    refuse_other_suffix(path)
    remove_left(Path(os.path.realpath(path)).parent)
    is_json = Path(path).suffix == ".json"
    with (
        atomic_path(path) as temporary,
        json_list(temporary) if is_json else _table(path, temporary) as append,
    ):
        yield lambda image_id, facts, found, extras=None: append(*result_rows(image_id, facts, found, extras))
    names_beside(path).unlink(missing_ok=True)


def names_beside(path: str | Path) -> Path:
    """The list of a file's images that `hicp detect` writes beside it, those without people too.

    Examples
    --------
    >>> names_beside("out/d.csv").name
    'd.csv.images.json'
    """
    return Path(f"{path}.images.json")


@contextmanager
def json_list(path: Path) -> Iterator[_Append]:
    """Write a list in JSON, item by item.

    Parameters
    ----------
    path : Path

    Yields
    ------
    callable
        Takes the next items, JSON-able, or with arrays.
    """
    with open(path, "wb", _BUFFER_BYTES) as file:
        file.write(b"[")
        between = b""

        def append(*items: object) -> None:
            nonlocal between
            for item in items:
                try:
                    text = orjson.dumps(item, option=orjson.OPT_SERIALIZE_NUMPY)
                except TypeError:  # integers beyond 64 bits and lone surrogates, from other tools
                    text = json.dumps(item, default=np.ndarray.tolist, allow_nan=False).encode()
                file.write(between + text)
                between = b",\n"

        yield append
        file.write(b"]\n")


def result_rows(
    image_id: int, facts: Mapping[str, Any], found: Detections, extras: Sequence[dict] | None = None,
    keypoints: np.ndarray | slice = slice(None),
) -> Iterator[dict]:  # fmt: skip
    """The people of an image as COCO keypoint results, with arrays in them.

    Parameters
    ----------
    image_id : int
    facts : mapping of str to object
        Further keys of each.
    found : Detections
    extras : sequence of dict, optional
        Further keys of one each.
    keypoints : array of int or slice, optional
        Which of the 136, all if left out.

    Yields
    ------
    dict

    Raises
    ------
    ValueError
        For a score that is no number.
    """
    triples = np.concatenate([found.keypoints_px[:, keypoints], found.scores[:, keypoints, None]], axis=-1)
    u, v, scored = np.moveaxis(np.isfinite(triples), -1, 0)
    absent = ~(u & v)
    triples[absent] = 0.0
    if not ((scored | absent).all() and np.isfinite(found.person_scores).all()):
        raise ValueError(f"image {image_id}: a score is not a finite number")
    flat = triples.reshape(len(found), 3 * triples.shape[1])
    for of, score, extra in zip(flat, found.person_scores.tolist(), extras or [{}] * len(found), strict=True):
        yield {
            **extra,
            "image_id": image_id,
            **facts,
            "category_id": PERSON_CATEGORY,
            "keypoints": of,
            "score": score,
        }


@contextmanager
def _table(path: str | Path, temporary: Path) -> Iterator[_Append]:
    """Write people as rows of a table, in batches."""
    waiting: list[dict] = []
    with ExitStack() as stack:
        is_csv = temporary.suffix == ".csv"
        write = _append_csv(temporary) if is_csv else _append_parquet(temporary, stack)
        columns: list[str] = []

        def flush() -> None:
            try:
                table = _by_keypoint(waiting)
                columns[:] = columns or table
                write(table[columns])
            except (KeyError, TypeError, ValueError) as error:  # pyarrow's own are among these
                keys = ", ".join((*FACTS, RAW_SCORES))
                problem = f"people's {keys} are no columns of a table ({one_line(error)})"
                raise InputError(f"{path}: {problem}; write .json, or give all people the same") from None
            waiting.clear()

        def append(*people: dict) -> None:
            if len(waiting) >= _PEOPLE_AT_ONCE:
                flush()
            waiting.extend(people)

        yield append
        flush()


def _append_csv(path: Path) -> _Append:
    return lambda table: table.to_csv(path, mode="a", index=False, header=not path.stat().st_size)


def _append_parquet(path: Path, stack: ExitStack) -> _Append:
    from pyarrow import Table
    from pyarrow.parquet import ParquetWriter

    writers: list[ParquetWriter] = []

    def append(table: pd.DataFrame) -> None:
        group = Table.from_pandas(table, preserve_index=False).replace_schema_metadata()
        if not writers:
            writers.append(stack.enter_context(ParquetWriter(path, group.schema)))
        writers[0].write_table(group)

    return append


def _by_keypoint(people: list[dict]) -> pd.DataFrame:
    """One row per keypoint of the people of an image, from `result_rows`."""
    triples = np.array([row["keypoints"] for row in people]).reshape(-1, N_KEYPOINTS, 3)
    rows, keypoints = np.nonzero(triples.any(axis=-1))
    values = dict(zip(("u_px", "v_px", "score"), triples[rows, keypoints].T, strict=True))
    if people and RAW_SCORES in people[0]:
        raw = np.array([row[RAW_SCORES] for row in people], dtype=float)
        values["raw_score"] = raw.reshape(len(people), N_KEYPOINTS)[rows, keypoints]
    kept = ["image_id", *(fact for fact in FACTS if people and fact in people[0]), "score"]
    table = pd.DataFrame([[row[key] for key in kept] for row in people], columns=kept)
    table = table.astype({"image_id": int, "score": float})
    table.insert(len(kept) - 1, "person", table.groupby("image_id").cumcount())
    names = pd.array(np.array(NAMES)[keypoints], dtype="string")
    return table.rename(columns={"score": "person_score"}).iloc[rows].assign(keypoint=names, **values)


def read_rows(path: Path) -> Any:
    """The unchecked content of a file of COCO keypoint results: a list of objects, also from a table.

    Raises
    ------
    InputError
        If it cannot be read, or is a table without the columns that `open_detections` writes.
    """
    if path.suffix not in _TABLES:
        return read_people(path)
    return [row for part in _rows_of_table(path) for row in part]


def rows_in_parts(path: Path) -> Iterator[Any]:
    """As `read_rows`, but a list comes as several shorter ones, so that memory need not hold all of it."""
    yield from _rows_of_table(path) if path.suffix in _TABLES else read_people_in_parts(path)


def _rows_of_table(path: Path) -> Iterator[list[dict]]:
    """People in parts of a table; of each person, the rows must be together, or in the same part."""
    refuse_other_suffix(path)
    columns = ("image_id", "person", "person_score", "keypoint", "u_px", "v_px", "score")
    waiting, keys = None, [pd.DataFrame(columns=_KEYS)]
    for part in read_table_in_parts(path, columns, _ROWS_AT_ONCE, dtype={"file_name": str}):
        table = part if waiting is None else pd.concat([waiting, part], ignore_index=True)
        is_last = (table[_KEYS] == table[_KEYS].tail(1).to_numpy()).all(axis=1)
        keys.append(table.loc[~is_last, _KEYS].drop_duplicates())
        yield _people(path, table[~is_last])
        waiting = table[is_last]  # this person may go on in the next part
    if waiting is not None:
        keys.append(waiting[_KEYS].head(1))
        yield _people(path, waiting)
    for image_id, person in pd.concat(keys)[lambda all: all.duplicated()].values[:1]:
        problem = f"the rows of person {person} of image {image_id} are far apart"
        raise InputError(f"{path}: {problem}; sort them by image_id and person")


def _people(path: Path, table: pd.DataFrame) -> list[dict]:
    try:
        keypoints = [INDEX[name] for name in table["keypoint"]]
        values = table[["u_px", "v_px", "score"]].to_numpy(float)
        if table.duplicated([*_KEYS, "keypoint"]).any():
            raise ValueError("a keypoint of a person twice")
        people = table.groupby(_KEYS, sort=False, dropna=False)
        first = people[["person_score", *table.columns.intersection(FACTS)]].first()
        raw = table["raw_score"].to_numpy(float) if "raw_score" in table else None
    except (KeyError, OSError, TypeError, ValueError) as error:  # pyarrow's and pandas' own are among these
        problem = f"{type(error).__name__}: {one_line(error)}"
        raise InputError(f"{path}: is not a table written by hicp detect ({problem})") from None
    triples = np.zeros((people.ngroups, N_KEYPOINTS, 3))
    triples[people.ngroup(), keypoints] = values
    rows = first.rename(columns={"person_score": "score"}).reset_index().to_dict("records")
    if raw is not None:
        raw_scores = np.zeros((people.ngroups, N_KEYPOINTS))
        raw_scores[people.ngroup(), keypoints] = raw
        rows = [row | {RAW_SCORES: of} for row, of in zip(rows, raw_scores.tolist(), strict=True)]
    flat = triples.reshape(len(rows), 3 * N_KEYPOINTS)
    return [row | {"keypoints": keypoints} for row, keypoints in zip(rows, flat, strict=True)]

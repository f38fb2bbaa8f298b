"""Lists of JSON objects from outside (COCO files), checked key by key and made into arrays."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import N_KEYPOINTS, NAMES, TO_HALPE, to_halpe

# Beyond any image and any detector's raw output, and small enough for squares and products.
MAX_ABS = 1e9
MAX_INTEGER = 2**53  # every JSON reader has them exact up to here
CONVENTIONS = {17: "coco17", 26: "halpe26", 133: "wholebody133", 136: "halpe136"}
# COCO-WholeBody files spread their 133 keypoints over five keys, in this order.
PART_KEYS = ("foot_kpts", "face_kpts", "lefthand_kpts", "righthand_kpts")


@dataclass(frozen=True)
class Rows:
    """The objects of one list in a file; `label` says how messages name the list.

    `name_key` is the key that tells a reader which row is meant ("id", or "image_id").
    Every method returns one value (or vector) per row, or raises `InputError` for the first
    row that is not as expected.
    """

    path: Path
    label: str
    rows: list[dict]
    name_key: str = "id"

    @classmethod
    def of(cls, path: Path, label: str, value: Any, name_key: str = "id") -> Rows:
        """Check that `value` is a list of JSON objects."""
        if not isinstance(value, list):
            raise InputError(f"{path}: {label} is {shown(value)}; expected a list of objects")
        for i, row in enumerate(value):
            if not isinstance(row, dict):
                raise InputError(f"{path}: {label}[{i}] is {shown(row)}; expected an object")
        return cls(path, label, value, name_key)

    def error(self, i: int, problem: str) -> InputError:
        """The error for row i."""
        name = self.rows[i].get(self.name_key)
        named = f" ({self.name_key} {name})" if type(name) is int and abs(name) <= MAX_INTEGER else ""
        return InputError(f"{self.path}: {self.label}[{i}]{named}: {problem}")

    def column(self, key: str) -> list:
        """The values of a key every row must have."""
        for i, row in enumerate(self.rows):
            if key not in row:
                raise self.error(i, f"has no {key!r}; every row needs one")
        return [row[key] for row in self.rows]

    def integers(self, key: str) -> np.ndarray:
        """Whole numbers, shape (n,), int64."""
        values = self.column(key)
        for i, value in enumerate(values):
            if type(value) is not int or abs(value) > MAX_INTEGER:
                raise self.error(i, f"{key} is {shown(value)}; expected a whole number")
        return np.array(values, dtype=np.int64)

    def unique_integers(self, key: str) -> np.ndarray:
        """Whole numbers that differ from row to row, shape (n,), int64."""
        values = self.integers(key)
        first: dict[int, int] = {}
        for i, value in enumerate(values.tolist()):
            if first.setdefault(value, i) != i:
                raise self.error(
                    i, f"{key} is used before, by {self.label}[{first[value]}]; it must be unique"
                )
        return values

    def numbers(self, key: str) -> np.ndarray:
        """Finite numbers, shape (n,)."""
        return self.finite([[value] for value in self.column(key)], 1, lambda j: key)[:, 0]

    def vectors(self, key: str, names: Sequence[str]) -> np.ndarray:
        """Lists of finite numbers, one for each of `names`, shape (n, len(names))."""
        values = self.column(key)
        for i, value in enumerate(values):
            if not isinstance(value, list) or len(value) != len(names):
                raise self.error(i, f"{key} is {shown(value)}; expected [{', '.join(names)}]")
        return self.finite(values, len(names), lambda j: f"{key}[{j}] ({names[j]})")

    def keypoints(self) -> np.ndarray:
        """Triples (x, y, v) in the Halpe-136 order, zeros where the file's convention has no such keypoint.

        Accepts 17 (COCO), 26 (Halpe body), 133 (COCO-WholeBody, also spread over its five
        keys) and 136 (Halpe) keypoints, row by row.

        Returns
        -------
        array, shape (n, 136, 3)
        """
        values = self.column("keypoints")
        flat = [self._one_list(i, value) for i, value in enumerate(values)]
        result = np.zeros((len(flat), N_KEYPOINTS, 3))
        sizes = np.array([len(value) // 3 for value in flat])
        for count, convention in CONVENTIONS.items():
            chosen = np.flatnonzero(sizes == count)
            if len(chosen):
                lists = [flat[i] for i in chosen]
                triples = self.finite(lists, 3 * count, _keypoint_namer(convention), chosen)
                result[chosen] = to_halpe(triples.reshape(-1, count, 3), convention, axis=-2, fill=0.0)
        return result

    def conventions(self) -> list[str]:
        """Per row, the convention its keypoints come in, a key of `hicp_lib.core.keypoints.TO_HALPE`."""
        lists = enumerate(self.column("keypoints"))
        return [CONVENTIONS[len(self._one_list(i, value)) // 3] for i, value in lists]

    def extras(self, known: Collection[str]) -> list[dict]:
        """Per row, the keys other than `known`; refused where JSON could not be written from them again."""
        extras = [{key: value for key, value in row.items() if key not in known} for row in self.rows]
        for i, extra in enumerate(extras):
            try:
                json.dumps(extra, allow_nan=False)
            except (ValueError, RecursionError):
                raise self.error(
                    i, "a further key holds NaN, infinity or a value nested too deeply"
                ) from None
        return extras

    def _one_list(self, i: int, value: Any) -> list:
        if not isinstance(value, list):
            raise self.error(i, f"keypoints is {shown(value)}; expected a list of x, y, v per keypoint")
        row = self.rows[i]
        if len(value) == 51 and all(isinstance(row.get(key), list) for key in PART_KEYS):
            value = list(chain(value, *(row[key] for key in PART_KEYS)))
        if len(value) % 3 or len(value) // 3 not in CONVENTIONS:
            counts = ", ".join(str(count) for count in CONVENTIONS)
            raise self.error(i, f"keypoints has {len(value)} numbers; expected 3 per keypoint, of {counts}")
        return value

    def finite(
        self, lists: list[list], width: int, name: Callable[[int], str], rows: Sequence[int] | None = None
    ) -> np.ndarray:
        """Lists of `width` numbers (of `rows`, default all) as a float array; `name` says what entry j is."""
        try:
            # The types first: numpy would take True for 1 and "3" for 3.
            if set(map(type, chain.from_iterable(lists))) <= {int, float}:
                array = np.array(lists, dtype=float).reshape(len(lists), width)
                if (np.abs(array) <= MAX_ABS).all():
                    return array
        except OverflowError:  # a whole number beyond floats
            pass
        i, j = next(
            (i, j) for i, values in enumerate(lists) for j, x in enumerate(values) if not _is_finite(x)
        )
        problem = f"{name(j)} is {shown(lists[i][j])}; expected a finite number up to {MAX_ABS:g}"
        raise self.error(i if rows is None else int(rows[i]), problem)


def _is_finite(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) <= MAX_ABS


def _keypoint_namer(convention: str) -> Callable[[int], str]:
    indices = TO_HALPE[convention]
    return lambda j: f"keypoints[{j}] ({NAMES[indices[j // 3]]} {'xyv'[j % 3]})"


def shown(value: Any) -> str:
    """A value as a short piece of one line."""
    if isinstance(value, bool | None):
        return {True: "true", False: "false", None: "null"}[value]
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, str):
        return f"the text {value[:40]!r}"
    return "too large a number" if isinstance(value, int) and abs(value) > 1e30 else str(value)

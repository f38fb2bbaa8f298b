"""Lists of JSON objects from external files (COCO), checked key by key and converted to arrays."""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import N_KEYPOINTS, NAMES, TO_HALPE

# Larger than any image or detector output, and small enough for squares and products.
MAX_ABS = 1e9
MAX_INTEGER = 2**53  # exact in every JSON reader up to here
CONVENTIONS = {17: "coco17", 26: "halpe26", 133: "wholebody133", 136: "halpe136"}
Layouts = Mapping[int, str | np.ndarray]
Flat = list | np.ndarray
_AT_ONCE = 2**12  # rows made into arrays at a time
# COCO-WholeBody files spread their 133 keypoints over five keys, in this order: of each, how many numbers.
PART_KEYS = {"foot_kpts": 18, "face_kpts": 204, "lefthand_kpts": 63, "righthand_kpts": 63}
_REQUIRED = object()
_Check = Callable[[Any], bool]


@dataclass(frozen=True)
class Rows:
    """The objects of one list in a file.

    Every method returns one value (or vector) per row, or raises `InputError` for the first invalid row.

    Attributes
    ----------
    path : Path
        The file, for messages.
    label : str
        How messages name the list.
    rows : list of dict
        The objects.
    name_key : str
        Key that identifies a row in messages ("id", or "image_id").
    first : int
        The number of the first row in the file's list, of which this may be a part.

    Examples
    --------
    >>> rows = Rows.of(Path("a.json"), "people", [{"id": 3, "area": 20.5}, {"id": 4, "area": []}])
    >>> rows.unique_integers("id")
    array([3, 4])
    >>> rows.integers("area")
    Traceback (most recent call last):
    hicp_lib.core.errors.InputError: a.json: people[0] (id 3): area is 20.5; expected a whole number
    """

    path: Path
    label: str
    rows: list[dict]
    name_key: str = "id"
    first: int = 0

    @classmethod
    def of(cls, path: Path, label: str, value: Any, name_key: str = "id", first: int = 0) -> Rows:
        """Check that a value is a list of JSON objects.

        Parameters
        ----------
        path : Path
            The file it was read from.
        label : str
            How messages name the list.
        value : Any
            What JSON gave.
        name_key : str, optional
            Key that identifies a row in messages.
        first : int, optional
            The number of its first row in the file.

        Returns
        -------
        Rows
        """
        if not isinstance(value, list):
            raise InputError(f"{path}: {label} is {shown(value)}; expected a list of objects")
        for i, row in enumerate(value):
            if not isinstance(row, dict):
                raise InputError(f"{path}: {label}[{first + i}] is {shown(row)}; expected an object")
        return cls(path, label, value, name_key, first)

    def error(self, i: int, problem: str) -> InputError:
        """The error for row i."""
        name = self.rows[i].get(self.name_key)
        named = f" ({self.name_key} {name})" if type(name) is int and abs(name) <= MAX_INTEGER else ""
        return InputError(f"{self.path}: {self.label}[{self.first + i}]{named}: {problem}")

    def column(
        self, key: str, valid: _Check = lambda _: True, expected: str = "", default: Any = _REQUIRED
    ) -> list:
        """The values of a key.

        Parameters
        ----------
        key : str
            The key.
        valid : callable, optional
            Whether a value is as expected.
        expected : str, optional
            What a value should be, for the message.
        default : Any, optional
            Value of rows without the key; by default every row needs one.

        Returns
        -------
        list
        """
        values = [row.get(key, default) for row in self.rows]
        for i, value in enumerate(values):
            if value is _REQUIRED:
                raise self.error(i, f"has no {key!r}; every row needs one")
            if not valid(value):
                raise self.error(i, f"{key} is {shown(value)}; expected {expected}")
        return values

    def integers(self, key: str) -> np.ndarray:
        """Whole numbers, shape (n,), int64."""
        return np.array(self.column(key, _is_integer, "a whole number"), dtype=np.int64)

    def unique_integers(self, key: str) -> np.ndarray:
        """Whole numbers that differ from row to row, shape (n,), int64."""
        values = self.integers(key)
        first: dict[int, int] = {}
        for i, value in enumerate(values.tolist()):
            if first.setdefault(value, i) != i:
                raise self.error(i, f"{key} is used before, by {self.label}[{first[value]}]; make it unique")
        return values

    def numbers(self, key: str, default: Any = _REQUIRED) -> np.ndarray:
        """Finite numbers, shape (n,); `default` as of `column`."""
        return self.finite([[value] for value in self.column(key, default=default)], 1, lambda j: key)[:, 0]

    def vectors(self, key: str, names: Sequence[str]) -> np.ndarray:
        """Lists of finite numbers, one for each of `names`, shape (n, len(names))."""
        n = len(names)
        values = self.column(key, lambda v: isinstance(v, list) and len(v) == n, f"[{', '.join(names)}]")
        return self.finite(values, n, lambda j: f"{key}[{j}] ({names[j]})")

    def keypoints(self, layouts: Layouts = CONVENTIONS) -> tuple[np.ndarray, Counter[str]]:
        """Triples (x, y, v) in the Halpe-136 order, zeros where the file's layout has no such keypoint.

        Unless `layouts` is given, accepts 17 (COCO), 26 (Halpe body), 133 (COCO-WholeBody, also in its five
        keys, four of which may be absent) and 136 (Halpe) keypoints, row by row. The rows lose their
        `keypoints`, so that large data are held in memory once.

        Parameters
        ----------
        layouts : Layouts, optional
            As of `points`.

        Returns
        -------
        values : array, shape (n, 136, 3)
        found : Counter
            As of `points`.
        """
        lists = dict(enumerate(self._keypoint_lists(layouts)))
        for row in self.rows:
            del row["keypoints"]
        return self.points("keypoints", lists, layouts)

    def points(
        self, key: str, lists: dict[int, Flat], layouts: Layouts, width: int = 3
    ) -> tuple[np.ndarray, Counter[str]]:
        """Flat lists of numbers of some rows, `width` for each keypoint, in the Halpe-136 order.

        Parameters
        ----------
        key : str
            For messages.
        lists : dict of int to list or array
            By row; emptied.
        layouts : Layouts
            By the number of keypoints, a key of `hicp_lib.core.keypoints.TO_HALPE`, or what that would hold.
        width : int, optional
            Numbers per keypoint.

        Returns
        -------
        values : array, shape (n, 136, width)
            0 where the layout has no such keypoint, and in rows without a list.
        found : Counter
            Rows by the layout's name, "by their names" where it has none.
        """
        values, found = np.zeros((len(self.rows), N_KEYPOINTS, width)), Counter[str]()
        for n, layout in layouts.items():
            chosen = [i for i, numbers in lists.items() if len(numbers) == width * n]
            indices = TO_HALPE[layout] if isinstance(layout, str) else layout
            names = _triples_namer(key, indices) if width == 3 else lambda j: f"{key}[{j}]"
            known = (of for of, theirs in TO_HALPE.items() if np.array_equal(theirs, indices))
            found += Counter({next(known, "by their names"): len(chosen)})
            for some in (chosen[i : i + _AT_ONCE] for i in range(0, len(chosen), _AT_ONCE)):
                points = self.finite([lists.pop(i) for i in some], width * n, names, some)
                points = points.reshape(-1, n, width)[:, indices >= 0]
                values[np.ix_(np.array(some), indices[indices >= 0])] = points
        return values, found

    def extras(self, known: Collection[str]) -> list[dict]:
        """Per row, the keys other than `known`; refused if they could not be written as JSON again."""
        extras = [{key: value for key, value in row.items() if key not in known} for row in self.rows]
        for i, extra in enumerate(extras):
            try:
                json.dumps(extra, allow_nan=False)
            except (ValueError, RecursionError):
                raise self.error(i, "a further key holds NaN, infinity or too deep a nesting") from None
        return extras

    def _keypoint_lists(self, layouts: Collection[int]) -> list[Flat]:
        """Each row's keypoints in one list; its length is one of `layouts`, times 3."""
        lists = self.column("keypoints", lambda v: isinstance(v, Flat), "a list of x, y, v per keypoint")
        for i, row in enumerate(self.rows):
            parts = {key: of for key in PART_KEYS if (of := row.get(key)) not in (None, [])}
            for key, of in parts.items():
                if not (isinstance(of, list) and len(of) == PART_KEYS[key]):
                    raise self.error(i, f"{key} is {shown(of)}; expected a list of {PART_KEYS[key]} numbers")
            if parts and len(lists[i]) == 51 and 133 in layouts:
                of_parts = (parts.get(key, [0] * n) for key, n in PART_KEYS.items())
                lists[i] = list(chain(_listed(lists[i]), *of_parts))
            n = len(lists[i])
            if n % 3 or n // 3 not in layouts:
                counts = ", ".join(map(str, layouts))
                raise self.error(i, f"keypoints has {n} numbers; expected 3 per keypoint, of {counts}")
        return lists

    def finite(
        self, lists: Sequence[Flat], width: int, name: Callable[[int], str], rows: Sequence[int] | None = None
    ) -> np.ndarray:
        """Lists of finite numbers as an array.

        Parameters
        ----------
        lists : sequence of list or array
            The numbers.
        width : int
            Length of each list.
        name : callable
            What messages call entry j.
        rows : sequence of int, optional
            The rows that the lists are of; all when left out.

        Returns
        -------
        array, shape (len(lists), width)
        """
        try:
            # Check types first: numpy would accept True as 1 and "3" as 3.
            plain = chain.from_iterable(of for of in lists if isinstance(of, list))
            if set(map(type, plain)) <= {int, float}:
                array = np.array(lists, dtype=float).reshape(len(lists), width)
                if (np.abs(array) <= MAX_ABS).all():
                    return array
        except OverflowError:  # an integer too large for floats
            pass
        of = list(map(_listed, lists))
        i, j = next((i, j) for i, row in enumerate(of) for j, x in enumerate(row) if not _is_finite(x))
        problem = f"{name(j)} is {shown(of[i][j])}; expected a finite number up to {MAX_ABS:g}"
        raise self.error(i if rows is None else rows[i], problem)


def _listed(numbers: Flat) -> list:
    return numbers.tolist() if isinstance(numbers, np.ndarray) else numbers


def _is_integer(value: Any) -> bool:
    return type(value) is int and abs(value) <= MAX_INTEGER


def _is_finite(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) <= MAX_ABS


def _triples_namer(key: str, indices: np.ndarray) -> Callable[[int], str]:
    names = [NAMES[i] if i >= 0 else "other" for i in indices]
    return lambda j: f"{key}[{j}] ({names[j // 3]} {'xyv'[j % 3]})"


def is_number(value: object) -> TypeGuard[float]:
    """Whether a value from external data is a finite number; truth values are not.

    Parameters
    ----------
    value : object

    Returns
    -------
    bool

    Examples
    --------
    >>> [is_number(value) for value in (3, 0.5, True, float("nan"), "3")]
    [True, True, False, False, False]
    """
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        return False
    number: Any = value  # NumPy's types lack this in their annotations
    return bool(abs(number) <= sys.float_info.max)


def shown(value: Any) -> str:
    """A short, one-line description of a value for messages.

    Examples
    --------
    >>> shown(None), shown([1, 2]), shown({}), shown("a"), shown(0.5)
    ('null', 'a list of 2', 'an object', "the text 'a'", '0.5')
    """
    if isinstance(value, bool | None):
        return {True: "true", False: "false", None: "null"}[value]
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, str):
        return f"the text {value[:40]!r}"
    return "too large a number" if isinstance(value, int) and abs(value) > 1e30 else str(value)

"""People from another tool's files: already in the Halpe-136 layout, with scores as written."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.folders import listed
from hicp_lib.formats.importers.matching import NamedBy
from hicp_lib.formats.json_validation import Rows


@dataclass(frozen=True)
class People:
    """All people in a tool's output, one row each, before they are matched with images.

    Attributes
    ----------
    path : Path
        The file or folder that was read.
    named_by : {"stem", "id", "number"}
        What `sources` are: "stem" (a file name without suffix), "id" (an image id, or a file name where it is
        text), "number" (as "id", but a number is the one at the end of a file name).
    sources : list of str or int
        The images that the files mention, each once, including those without people.
    source_of : array of int, shape (n,)
        Index into `sources`.
    keypoints_px : array, shape (n, 136, 2)
        NaN where not given.
    raw_scores : array, shape (n, 136)
        The tool's own keypoint scores; 0 where not given.
    person_scores : array, shape (n,)
        The scores by which people are ranked.
    conventions : Counter of str
        How many people come in each convention, keys of `hicp_lib.core.keypoints.TO_HALPE`.
    extras : list of dict
        Per person, the further data in the file.
    """

    path: Path
    named_by: NamedBy
    sources: list[str | int]
    source_of: np.ndarray
    keypoints_px: np.ndarray
    raw_scores: np.ndarray
    person_scores: np.ndarray
    conventions: Counter[str]
    extras: list[dict]

    def __len__(self) -> int:
        return len(self.person_scores)


def split(triples: np.ndarray, given: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triples (x, y, score), shape (n, 136, 3), as coordinates and scores; NaN and 0 where not given."""
    return np.where(given[..., None], triples[..., :2], np.nan), np.where(given, triples[..., 2], 0.0)


@dataclass(frozen=True)
class FileRows(Rows):
    """Objects from many files checked as one list.

    Attributes
    ----------
    places : list of (Path, int)
        Which file and entry each came from.
    """

    places: list[tuple[Path, int]] = field(default_factory=list)

    @classmethod
    def joined(cls, folder: Path, label: str, by_file: dict[Path, list[dict]]) -> tuple[FileRows, np.ndarray]:
        """The objects of each file one after the other.

        Parameters
        ----------
        folder : Path
            What was read, for messages.
        label : str
            How messages name the lists.
        by_file : dict of Path to list of dict
            The objects.

        Returns
        -------
        rows : FileRows
        source_of : array of int, shape (n,)
            The index of each one's file.
        """
        objects = [row for rows in by_file.values() for row in rows]
        places = [(file, i) for file, rows in by_file.items() for i in range(len(rows))]
        counts = [len(rows) for rows in by_file.values()]
        return cls(folder, label, objects, places=places), np.repeat(np.arange(len(counts)), counts)

    def error(self, i: int, problem: str) -> InputError:
        path, entry = self.places[i]
        return InputError(f"{path}: {self.label}[{entry}]: {problem}")


def json_files(folder: Path, endings: tuple[str, ...], what: str) -> dict[str, Path]:
    """Files of a folder by their name without the ending, in natural order.

    Parameters
    ----------
    folder : Path
        Where they are.
    endings : tuple of str
        Possible endings of their names; the first that any file has is used.
    what : str
        Which folder to give, for messages.

    Returns
    -------
    dict of str to Path

    Raises
    ------
    InputError
        If it is not a folder, or contains no such file.
    """
    names = listed(folder, what=what)
    for ending in endings:
        files = {n.removesuffix(ending): folder / n for n in names if n.endswith(ending)}
        if files:
            return files
    raise InputError(f"{folder}: holds no file *{endings[0]}; give {what}")

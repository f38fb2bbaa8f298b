"""Read the quantities of a claim from a run's result tables, and find what is missing."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd
from pandas.api.types import is_numeric_dtype

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json
from hicp_lib.detectors.registry import COMBINED, DETECTORS
from hicp_lib.recordings.recording import SIMULATION_FILE
from hicp_lib.study.claims.statements import CLASS, SYSTEMS, Selection

_IMPORTED = "-imported"


@dataclass(frozen=True)
class Quantity:
    """A number of a result table.

    Attributes
    ----------
    value : float
        NaN if undefined, such as the distance of a keypoint that was never found.
    low, high : float
        Its 95 % interval; the number itself if it has none.
    row : dict of str to object
        Its row.
    name : str
        The row's name, in the evidence.
    n : int
        Number of rows it was selected from.
    """

    value: float
    low: float
    high: float
    row: dict[str, Any]
    name: str
    n: int = 1

    def __str__(self) -> str:
        if math.isnan(self.value):
            return f"{self.name} nothing found"
        interval = f" [{self.low:.3g}, {self.high:.3g}]" if self.low < self.high else ""
        return f"{self.name} {self.value + 0:.3g}{interval}".strip()  # + 0: never "-0"


class MissingError(Exception):
    """The results lack what a claim needs."""


def select(side: Selection | float, results: Path) -> tuple[list[Quantity], list[str]]:
    """The quantities of the selected rows; a number is a quantity itself.

    Parameters
    ----------
    side : Selection or float
    results : Path
        Folder with one folder of result files per notebook.

    Returns
    -------
    list of Quantity
    list of str
        The systems it names that have no such row.

    Raises
    ------
    MissingError
        If there is no such table, or no such row though it names no system.
    InputError
        If the table lacks a column of the selection.
    """
    if isinstance(side, float):
        return [Quantity(side, side, side, {}, "")], []
    table = _read(side, results)
    columns = _systems(table)
    run = {name for column in columns for name in table[column]}
    for column, wanted in side.where.items():
        if column not in SYSTEMS:
            table = table[table[column].isin(_listed(wanted))]
    present = {name for column in columns for name in table[column]}
    for column in columns:
        table = table[table[column].isin(_members(side.where.get(column), table[column]))]
    quantities = [_quantity(side, row) for row in table.to_dict("records")]
    absent = [name for column in SYSTEMS for name in side.named(column) if name not in present]
    if not quantities and not absent:
        about = [column for column in columns if column in side.where] or list(side.where)
        asked = ", ".join(f"{column} {side.where[column]}" for column in about).replace(CLASS, "any ")
        raise MissingError(f"{side.notebook}/{side.table} has no result for {asked}")
    if side.greatest and quantities:
        known = [quantity for quantity in quantities if not math.isnan(quantity.value)] or quantities
        quantities = [replace(max(known, key=lambda quantity: quantity.value), n=len(known))]
    return quantities, [name for name in absent if name not in run] or absent


def is_rendered(results: Path, notebook: str) -> bool:
    """Whether a notebook's run used rendered people or simulated recordings.

    Its stamp names the source and the given recordings; one of these may be simulated, too, which its folder
    says.
    """
    path = results / notebook / "provenance.json"
    if not path.is_file():
        raise MissingError(f"{notebook} has no results in this run")
    parameters = read_json(path)["parameters"]
    recordings = [value for name, value in parameters.items() if name.startswith("recording")]
    made = [parameters["source"] == "rendered"] if "source" in parameters else []
    if recordings:
        given = [Path(folder) for folders in recordings for folder in _listed(folders) if folder]
        made.append(not given or any((folder / SIMULATION_FILE).is_file() for folder in given))
    return any(made) or not made  # a notebook with neither parameter makes its own data


def _read(selection: Selection, results: Path) -> pd.DataFrame:
    """A result table, imported detections under their detector's name."""
    path = results / selection.notebook / f"{selection.table}.parquet"
    if not path.is_file():
        raise MissingError(f"{selection.notebook}/{selection.table} is not among the results of this run")
    table = pd.read_parquet(path)
    asked = {*selection.where, *selection.name, selection.value, selection.low, selection.high} - {""}
    if unknown := asked - set(table.columns):
        there = ", ".join(table.columns)
        raise InputError(f"{path}: a claim asks for column {min(unknown)!r}; there are {there}")
    return table.assign(**{name: table[name].str.removesuffix(_IMPORTED) for name in _systems(table)})


def _systems(table: pd.DataFrame) -> list[str]:
    """The columns that name detectors; a number may be compared with an `other` one."""
    return [name for name in SYSTEMS if name in table and not is_numeric_dtype(table[name])]


def _listed(value: Any) -> list:
    return value if isinstance(value, list) else [value]


def _members(wanted: Any, present: Iterable[str]) -> list[str]:
    """Resolve names to systems, and classes to their members; None means all but combinations."""
    if wanted is None:
        return [name for name in present if not name.startswith(COMBINED)]
    classes = {f"{CLASS}combined": [name for name in present if name.startswith(COMBINED)]}
    for name, entry in DETECTORS.items():
        classes.setdefault(f"{CLASS}{entry.facts.paradigm}", []).append(name)
    return [name for value in _listed(wanted) for name in classes.get(value, [value])]


def _quantity(selection: Selection, row: dict[str, Any]) -> Quantity:
    name = " ".join(_plain(row[column]) for column in selection.name)
    if pd.isna(row[selection.value]) or math.isinf(row[selection.value]):
        return Quantity(math.nan, math.nan, math.nan, row, name)
    columns = [column or selection.value for column in (selection.value, selection.low, selection.high)]
    value, *bounds = (float(row[column]) * selection.scale for column in columns)
    return Quantity(value, min(bounds), max(bounds), row, name)


def _plain(label: Any) -> str:
    """A row's label for reading: 160 for 160.0, "left wrist" for "left_wrist"."""
    return f"{label:g}" if isinstance(label, float) else str(label).replace("_", " ")

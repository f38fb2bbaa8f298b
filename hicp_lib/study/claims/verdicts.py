"""Verdicts: what a run's result files say about each claim.

A test *holds* when the whole 95 % interval of the difference lies on the claimed side, *fails* when
none of it does, and is *open* otherwise, or where there is no interval (NaN). Tables of differences come
with intervals of their own, from paired draws; the difference of two rows with an interval each takes the
widest: that asks for more than a paired comparison would, never for less.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json
from hicp_lib.detectors.registry import COMBINED, DETECTORS, command_to_use
from hicp_lib.recordings.recording import SIMULATION_FILE
from hicp_lib.study.claims.statements import Claim, Comparison, Selection

REPRODUCED = "reproduced"
ON_RENDERED_DATA = "reproduced on rendered data only"
NOT_REPRODUCED = "not reproduced"
NOT_TESTABLE = "not testable here"
VERDICTS = (REPRODUCED, ON_RENDERED_DATA, NOT_REPRODUCED, NOT_TESTABLE)

_TABLE_COLUMNS = ["section", "claim", "tested", "paper", "ours", "verdict", "why_not", "command", "of_class"]
_CLASS = "@"
_PHOTOGRAPHS = "hicp report -p source halpe -p annotations_path HALPE.json -p images_dir DIR"


@dataclass(frozen=True)
class Verdict:
    """A claim's verdict.

    Attributes
    ----------
    claim : Claim
    verdict : str
        One of `VERDICTS`.
    ours : str
        The evidence.
    reason, command : str
        Why the claim was not tested, and what would test it.
    of_class : str
        What the run says of the class that the claim's systems belong to; no part of the verdict.
    """

    claim: Claim
    verdict: str
    ours: str = ""
    reason: str = ""
    command: str = ""
    of_class: str = ""


@dataclass(frozen=True)
class Quantity:
    """A number of a result table.

    Attributes
    ----------
    value : float
    low, high : float
        Its 95 % interval; the number itself where it has none.
    row : dict of str to object
        The row it is from.
    name : str
        The row's, in the evidence.
    """

    value: float
    low: float
    high: float
    row: dict[str, Any]
    name: str


class _MissingError(Exception):
    """What a claim needs is not among the results; carries the command that would give it."""

    def __init__(self, reason: str, command: str):
        super().__init__(reason)
        self.command = command


def judge_claims(claims: list[Claim], results: Path) -> list[Verdict]:
    """The verdict on every claim.

    Parameters
    ----------
    claims : list of Claim
    results : Path
        Folder with one folder of result files per notebook.

    Returns
    -------
    list of Verdict

    Raises
    ------
    InputError
        If a claim asks for a column that its table does not have.
    """
    return [_with_class(_judge_claim(claim, results), results) for claim in claims]


def verdict_table(verdicts: list[Verdict]) -> pd.DataFrame:
    """One row per claim: `section, claim, tested, paper, ours, verdict, why_not, command, of_class`."""
    rows = [
        (
            c.section,
            c.text,
            c.statement,
            c.paper or "–",
            v.ours or "–",
            v.verdict,
            v.reason,
            v.command,
            v.of_class or "–",
        )
        for c, v in ((verdict.claim, verdict) for verdict in verdicts)
    ]
    return pd.DataFrame(rows, columns=_TABLE_COLUMNS)


def for_reading(table: pd.DataFrame, verdict: str) -> pd.DataFrame:
    """The claims with one verdict, for a page.

    `table` from `verdict_table`; columns `section, claim` (with what was tested), `paper` and `ours`, or in
    the place of the last, for what could not be tested, `why not, and what would test it`; and, where some
    claim has one, `of its class`.
    """
    rows = table[table["verdict"] == verdict]
    shown = rows[["section"]].assign(claim=rows["claim"] + " Tested: " + rows["tested"], paper=rows["paper"])
    of_class = {"of its class": rows["of_class"]} if (rows["of_class"] != "–").any() else {}
    if verdict != NOT_TESTABLE:
        return shown.assign(ours=rows["ours"], **of_class)
    open_at = rows["ours"].map(lambda ours: "" if ours == "–" else f" ({ours})")
    reasons = rows["why_not"] + open_at + ": " + rows["command"]
    return shown.assign(**{"why not, and what would test it": reasons}, **of_class)


def verdict_counts(table: pd.DataFrame) -> dict[str, int]:
    """How many claims got each verdict, by `VERDICTS`; `table` from `verdict_table`."""
    return {verdict: int((table["verdict"] == verdict).sum()) for verdict in VERDICTS}


def _with_class(verdict: Verdict, results: Path) -> Verdict:
    """The verdict, with what the run says of the class beside it."""
    claim = verdict.claim
    if not claim.class_tests:
        return verdict
    of_class = _judge_claim(replace(claim, tests=claim.class_tests), results)
    said = ": ".join(text for text in (of_class.reason, of_class.ours) if text)
    return replace(verdict, of_class=f"{claim.class_statement} {of_class.verdict.capitalize()}: {said}")


def _judge_claim(claim: Claim, results: Path) -> Verdict:
    if not claim.tests:
        return Verdict(claim, NOT_TESTABLE, reason=claim.reason, command=claim.command)
    try:
        rendered = any([is_rendered(results, notebook) for notebook in _notebooks(claim)])
        rendered |= claim.only_on == "rendered people"
        if claim.only_on == "photographs" and rendered:
            raise _MissingError("the claim is about photographs; this run saw rendered people", _PHOTOGRAPHS)
        outcomes, evidence = zip(*(_try(test, results) for test in claim.tests), strict=True)
    except _MissingError as missing:
        return Verdict(claim, NOT_TESTABLE, reason=str(missing), command=missing.command)
    ours = "; ".join(dict.fromkeys(text for texts in evidence for text in texts))
    ours = f"{ours} {claim.unit}".strip()
    if False in outcomes:
        return Verdict(claim, NOT_REPRODUCED, ours)
    if None in outcomes:
        reason = "the 95 % intervals leave it open; more scenes or frames would decide"
        return Verdict(claim, NOT_TESTABLE, ours, reason, "hicp report -p n_scenes 1000 -p n_frames 1000")
    return Verdict(claim, ON_RENDERED_DATA if rendered else REPRODUCED, ours)


def _notebooks(claim: Claim) -> set[str]:
    """The notebooks whose results a claim rests on."""
    sides = [side for test in claim.tests for side in (test.left, test.right)]
    return {side.notebook for side in sides if isinstance(side, Selection)}


def _try(test: Comparison, results: Path) -> tuple[bool | None, list[str]]:
    """Whether a test holds (None: open), and the quantities it rests on in words."""
    left = select(test.left, results)
    if isinstance(test.right, float):
        right, shown_right = [Quantity(test.right, test.right, test.right, {}, "")], False
    else:
        right, shown_right = select(test.right, results), True
    pairs = [(a, b) for a in left for b in right if all(a.row.get(c) == b.row.get(c) for c in test.match)]
    if not pairs:
        reason = f"no two rows of {test.left.table} agree in {', '.join(test.match)}"
        raise _MissingError(reason, "hicp report")
    shown = [a for a, _ in pairs] + [b for _, b in pairs if shown_right]
    return holds(test, pairs), [_in_words(quantity) for quantity in shown]


def holds(test: Comparison, pairs: list[tuple[Quantity, Quantity]]) -> bool | None:
    """True when every pair's interval is on the claimed side, False when one is wholly off it, else None.

    Parameters
    ----------
    test : Comparison
    pairs : list of (Quantity, Quantity)
        The left and the right side.

    Examples
    --------
    >>> from hicp_lib.study.claims.statements import Selection
    >>> test = Comparison(">", Selection("02_evaluation_2d", "ap", {}, "value"), 0.5)
    >>> half, left = Quantity(0.5, 0.5, 0.5, {}, ""), Quantity(0.7, 0.6, 0.8, {}, "mmpose")
    >>> holds(test, [(left, half)]), holds(test, [(half, left)]), holds(test, [(left, left)])
    (True, False, None)
    """
    outcomes = [_compare(test, a.low - b.high, a.high - b.low) for a, b in pairs]
    return False if False in outcomes else None if None in outcomes else True


def _compare(test: Comparison, low: float, high: float) -> bool | None:
    if test.relation == "within":
        claimed = -test.tolerance, test.tolerance
        inside = claimed[0] <= low and high <= claimed[1]
        outside = high < claimed[0] or low > claimed[1]
    else:
        if test.relation == "<":
            low, high = -high, -low
        inside, outside = low > test.margin, high <= test.margin
    return True if inside else False if outside else None


def select(selection: Selection, results: Path) -> list[Quantity]:
    """The quantities of the rows a selection asks for; rows without a number are left out."""
    path = results / selection.notebook / f"{selection.table}.parquet"
    if not path.is_file():
        raise _MissingError(f"{selection.notebook} has no results in this run", "hicp report")
    table = pd.read_parquet(path)
    asked = {*selection.where, *selection.unlike, *selection.name}
    asked |= {selection.value, selection.low, selection.high} - {""}
    if unknown := asked - set(table.columns):
        raise InputError(
            f"{path}: a claim asks for column {min(unknown)!r}; there are {', '.join(table.columns)}"
        )
    table = table[table[selection.value].map(lambda value: value is not None and math.isfinite(value))]
    present = {name for column in ("detector", "other") if column in table for name in table[column]}
    for column, wanted in selection.where.items():
        table = table[table[column].isin(_values(wanted))]
    for column, unwanted in selection.unlike.items():
        table = table[~table[column].isin(_values(unwanted))]
    if table.empty:
        raise _absent(selection, present)
    quantities = [_quantity(selection, row) for row in table.to_dict("records")]
    if selection.pick == "each":
        return quantities
    return [(min if selection.pick == "least" else max)(quantities, key=lambda quantity: quantity.value)]


def _values(given: Any) -> list:
    """The values a column may have, imported detections of a detector and members of a class among them."""
    values = given if isinstance(given, list) else [given]
    values = [member for value in values for member in _members(value)]
    return values + [f"{value}-imported" for value in values if isinstance(value, str)]


def _members(value: Any) -> list:
    """What a value stands for: "@top-down" for the detectors of that paradigm, any other for itself."""
    if not (isinstance(value, str) and value.startswith(_CLASS)):
        return [value]
    return [name for name, entry in DETECTORS.items() if entry.facts.paradigm == value.removeprefix(_CLASS)]


def _absent(selection: Selection, present: set[str]) -> _MissingError:
    """Why a selection is empty: a detector it names was not run, or else its table has no such row."""
    for column in ("detector", "other"):
        names = selection.where.get(column, [])
        for name in [names] if isinstance(names, str) else names:
            if not present & set(_values(name)):
                if name.startswith(_CLASS):
                    return _MissingError(f"no {name.removeprefix(_CLASS)} detector was run", "hicp report")
                return _MissingError(f"{name} was not run", _command_to_run(name))
    asked = ", ".join(f"{column} {value}" for column, value in selection.where.items())
    return _MissingError(f"{selection.notebook} has no result for {asked}", "hicp report")


def _command_to_run(name: str) -> str:
    """What runs a detector, or a combination of two, in the report."""
    base = name.removeprefix(COMBINED).partition("+")[0]
    report = f"hicp report -p detectors mediapipe,{base}" + (f" -p body {base}" if base != name else "")
    needs_model = base in DETECTORS and DETECTORS[base].needs_model
    return f"{command_to_use(base)} && {report}" if needs_model else report


def _quantity(selection: Selection, row: dict[str, Any]) -> Quantity:
    value, low, high = (
        float(row[column or selection.value]) * selection.scale
        for column in (selection.value, selection.low, selection.high)
    )
    name = " ".join(_plain(row[column]) for column in selection.name)
    low, high = sorted((low, high))
    return Quantity(value, low, high, row, name)


def _plain(label: Any) -> str:
    """A row's label for reading: 160 for 160.0, "left wrist" for "left_wrist"."""
    return f"{label:g}" if isinstance(label, float) else str(label).replace("_", " ")


def _in_words(quantity: Quantity) -> str:
    text = f"{quantity.name} {quantity.value:.3g}".strip()
    if quantity.low < quantity.high:
        text += f" [{quantity.low:.3g}, {quantity.high:.3g}]"
    return text


def is_rendered(results: Path, notebook: str) -> bool:
    """Whether a notebook's run saw rendered people or simulated recordings.

    Its stamp names the source and the recordings it was given; one of these may be simulated as well, and
    says so in its folder.
    """
    path = results / notebook / "provenance.json"
    if not path.is_file():
        raise _MissingError(f"{notebook} has no results in this run", "hicp report")
    parameters = read_json(path)["parameters"]
    recordings = [value for name, value in parameters.items() if name.startswith("recording")]
    made = [parameters["source"] == "rendered"] if "source" in parameters else []
    if recordings:
        given = [Path(folder) for folder in recordings if folder]
        made.append(not given or any((folder / SIMULATION_FILE).is_file() for folder in given))
    return any(made) or not made  # a notebook that takes neither makes all it looks at

"""Claims as data: what the paper says, in our words, and the statement about result files that tests it.

`data/claims.json` holds `tables` (where quantities are read, by short names), `claims`, `sentences` (the
paper's numbers and orderings, each with the claims that cover it or the reason why none does) and what
`hicp_lib.study.claims.reading` reads. The tests of one claim must all hold. A test compares `left` with
`right` (each a number or a selection of rows in a result table) by a `relation`:

    >, <       the difference left - right lies above `margin`, or below -`margin`
    similar    left and right differ by less than `margin`

A claim that names systems is tested on these only. A selection without a detector means *every* one that was
run, except combinations (which share the body of another), and needs at least `EVERY_NEEDS` of them. A claim
may have a further statement about the class of its systems, or under choices of ours (`class_statement`,
`class_tests`): it shows how far the claim generalises, and does not affect the verdict.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json

CLAIMS_FILE = DATA_DIR / "claims.json"
CLASS = "@"
SYSTEMS = ("detector", "other")  # columns that name a detector
RELATIONS = (">", "<", "similar")
ONLY_ON = ("photographs", "rendered people")


@dataclass(frozen=True)
class Selection:
    """Rows of a result table.

    Attributes
    ----------
    notebook, table : str
        The file `<notebook>/<table>.parquet` of the results.
    where : dict of str to object
        Column -> the value rows must have there, or a list of such values; imported detections
        (`mmpose-imported`) count as the detector's. "@top-down" and "@bottom-up" are all detectors of the
        registry that are so, "@combined" all combinations.
    value : str
        Column of the quantity.
    greatest : bool
        Only the row with the greatest value, for statements about at least one of them.
    low, high : str
        Columns of the quantity's interval; the number counts as exact when they are "".
    scale : float
        Factor that converts the quantity to the claim's unit.
    name : tuple of str
        Columns that name a row in the evidence.
    """

    notebook: str
    table: str
    where: dict[str, Any]
    value: str
    greatest: bool = False
    low: str = ""
    high: str = ""
    scale: float = 1.0
    name: tuple[str, ...] = ("detector",)

    def named(self, column: str) -> list[str]:
        """The systems to which `column` is restricted; empty if every one or a class is meant."""
        given = self.where.get(column, [])
        names = given if isinstance(given, list) else [given]
        return [name for name in names if not name.startswith(CLASS)]

    def every(self, column: str) -> bool:
        """Whether every detector that was run is meant, or every one of a class."""
        return not self.greatest and not self.named(column)


@dataclass(frozen=True)
class Comparison:
    """One comparison; every selected row on the left is compared with every one on the right.

    Attributes
    ----------
    relation : str
        One of `RELATIONS`.
    left : Selection
    right : Selection or float
    margin : float
        For `>` and `<`, the difference must be larger than this; for `similar`, smaller.
    match : tuple of str
        Columns that must agree between the two rows compared.
    """

    relation: str
    left: Selection
    right: Selection | float
    margin: float = 0.0
    match: tuple[str, ...] = ()

    @property
    def claimed(self) -> tuple[float, float]:
        """Bounds of the claimed difference left - right."""
        above, below = (self.margin, math.inf), (-math.inf, -self.margin)
        return {">": above, "<": below, "similar": (-self.margin, self.margin)}[self.relation]

    @property
    def selections(self) -> list[Selection]:
        """The sides that select rows."""
        return [side for side in (self.left, self.right) if isinstance(side, Selection)]


@dataclass(frozen=True)
class Claim:
    """A claim of the paper.

    Attributes
    ----------
    id, section, text : str
        Section of the paper, and the claim in our words.
    statement : str
        What the tests check, for readers.
    paper : str
        The paper's value, "" if it gives none.
    unit : str
        Of the quantities that the evidence shows.
    tests : tuple of Comparison
        All must hold.
    only_on : str
        "", or one of `ONLY_ON`. "photographs": the claim is about these, and nothing rendered can test it.
        "rendered people": its tables hold nothing else, whatever data the run was given.
    reason : str
        For a claim that no result can test here: the reason.
    class_statement : str
        The same about the class the named systems belong to, for readers; "" for none.
    class_tests : tuple of Comparison
        Its tests.
    """

    id: str
    section: str
    text: str
    statement: str
    paper: str = ""
    unit: str = ""
    tests: tuple[Comparison, ...] = ()
    only_on: str = ""
    reason: str = ""
    class_statement: str = ""
    class_tests: tuple[Comparison, ...] = ()


def read_claims(path: Path = CLAIMS_FILE) -> list[Claim]:
    """Read the claims.

    Parameters
    ----------
    path : Path, optional
        In the layout of `data/claims.json`.

    Returns
    -------
    list of Claim

    Raises
    ------
    InputError
        Names the claim and what is wrong with it.

    Examples
    --------
    >>> claims = read_claims()
    >>> len({claim.id for claim in claims}) == len(claims)
    True
    """
    content = read_json(path)
    rows = content.get("claims") if isinstance(content, dict) else None
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise InputError(f"{path}: expected a list of claims, each an object, under the key 'claims'")
    claims = []
    for number, row in enumerate(rows):
        try:
            claims.append(_claim(row, content.get("tables", {})))
        except (TypeError, KeyError, ValueError, AttributeError) as error:
            name = row.get("id", f"number {number}")
            raise InputError(
                f"{path}: claim {name}: {error}; see hicp_lib/study/claims/statements.py for the layout"
            ) from None
    repeated = {claim.id for claim in claims if [c.id for c in claims].count(claim.id) > 1}
    if repeated:
        raise InputError(f"{path}: claim {min(repeated)} is there twice; give each its own id")
    return claims


def _claim(row: dict[str, Any], tables: dict[str, Any]) -> Claim:
    tests = {key: tuple(_test(test, tables) for test in row.get(key, [])) for key in ("tests", "class_tests")}
    claim = Claim(**row | tests)
    if not claim.tests and not claim.reason:
        raise ValueError("has neither tests nor a reason why it has none")
    if bool(claim.class_tests) != bool(claim.class_statement):
        raise ValueError("needs both a class_statement and class_tests, or neither")
    if claim.only_on not in ("", *ONLY_ON):
        raise ValueError(f"only_on is {claim.only_on!r}; expected one of {', '.join(ONLY_ON)}")
    return claim


def _test(row: dict[str, Any], tables: dict[str, Any]) -> Comparison:
    if row["relation"] not in RELATIONS:
        raise ValueError(f"relation {row['relation']!r} is unknown; use one of {', '.join(RELATIONS)}")
    if row["relation"] == "similar" and not row.get("margin", 0) > 0:
        raise ValueError("`similar` needs a margin above 0")
    sides = {side: _side(row[side], tables) for side in ("left", "right")}
    if not isinstance(sides["left"], Selection):
        raise ValueError("the left side must select rows of a table")
    return Comparison(**row | sides | {"match": tuple(row.get("match", ()))})


def _side(side: Any, tables: dict[str, Any]) -> Selection | float:
    if isinstance(side, (int, float)):
        return float(side)
    if side["table"] in tables:
        base = tables[side["table"]]
        side = base | side | {"table": base["table"], "where": base.get("where", {}) | side["where"]}
    notebook, _, table = side["table"].partition("/")
    if not table:
        raise ValueError(f"table {side['table']!r} is neither one of `tables` nor NOTEBOOK/TABLE")
    name = tuple(side.get("name", ("detector",)))
    return Selection(**side | {"notebook": notebook, "table": table, "name": name})

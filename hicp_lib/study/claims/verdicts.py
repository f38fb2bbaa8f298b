"""Verdicts on claims, from a run's result files.

A test *holds* when the whole interval of the difference lies on the claimed side, *fails* when none of it
does, and is *open* otherwise, or without an interval (NaN). Two quantities are similar when the whole
interval lies within the margin: two one-sided tests. Tables of differences have their own intervals, from
paired resamples; for the difference of two rows with separate intervals the widest possible one is used,
which is never less strict than a paired comparison. With k comparisons in a claim, each uses a level of 1 -
.05 / k (Bonferroni), so that all are correct with 95 %, whether they hold or fail: the half-widths of the 95
% intervals are scaled as for a normal distribution.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import NormalDist

import numpy as np

from hicp_lib.study.claims.selecting import MissingError, Quantity, is_rendered, select
from hicp_lib.study.claims.statements import SYSTEMS, Claim, Comparison

REPRODUCED = "reproduced"
ON_RENDERED_DATA = "reproduced on rendered data only"
NOT_REPRODUCED = "not reproduced"
UNDECIDED = "undecided"
PARTLY = "partly tested"
NOT_TESTABLE = "not testable here"
VERDICTS = (REPRODUCED, ON_RENDERED_DATA, NOT_REPRODUCED, UNDECIDED, PARTLY, NOT_TESTABLE)
EVERY_NEEDS = 3  # minimum number of detectors for "every"
SHOWN = 6  # maximum number of values shown as evidence

_SURE = NormalDist().inv_cdf(0.975)


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
    reason : str
        Why the claim was not tested, or not decided.
    n_comparisons : int
        Number of comparisons in the claim.
    of_class : Verdict or None
        The result for the class of the claim's systems; not part of the verdict.
    """

    claim: Claim
    verdict: str
    ours: str = ""
    reason: str = ""
    n_comparisons: int = 0
    of_class: "Verdict | None" = None


@dataclass(frozen=True)
class Pair:
    """Two quantities that a test compares.

    Attributes
    ----------
    test : Comparison
    left, right : Quantity
    """

    test: Comparison
    left: Quantity
    right: Quantity

    def interval(self, n_comparisons: int = 1) -> tuple[float, float]:
        """The interval of the difference, for this number of comparisons."""
        value = self.left.value - self.right.value
        grows = NormalDist().inv_cdf(1 - 0.025 / n_comparisons) / _SURE
        low, high = self.left.low - self.right.high, self.left.high - self.right.low
        return value - grows * (value - low), value + grows * (high - value)

    def slack(self, n_comparisons: int = 1) -> tuple[float, float]:
        """Distances of the interval's worse and better end within the claimed bounds; below 0 outside."""
        (low, high), (above, below) = self.interval(n_comparisons), self.test.claimed
        return float(np.minimum(low - above, below - high)), float(np.minimum(high - above, below - low))

    def outcome(self, n_comparisons: int = 1) -> bool | None:
        """Whether it holds; None if open.

        Examples
        --------
        >>> from hicp_lib.study.claims.statements import Selection
        >>> test = Comparison(">", Selection("02_evaluation_2d", "ap", {}, "value"), 0.5)
        >>> half, left = Quantity(0.5, 0.5, 0.5, {}, ""), Quantity(0.7, 0.55, 0.85, {}, "mmpose")
        >>> [Pair(test, *two).outcome() for two in ((left, half), (half, left), (left, left))]
        [True, False, None]
        >>> Pair(test, left, half).outcome(n_comparisons=10) is None
        True
        """
        worse, better = self.slack(n_comparisons)
        return True if worse > 0 else False if better <= 0 else None


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
        If a table lacks a column of a claim.
    """
    beyond = [_judge(replace(of, tests=of.class_tests), results) if of.class_tests else None for of in claims]
    own = (_judge(claim, results) for claim in claims)
    return [replace(said, of_class=of_class) for said, of_class in zip(own, beyond, strict=True)]


def _judge(claim: Claim, results: Path) -> Verdict:
    if not claim.tests:
        return Verdict(claim, NOT_TESTABLE, reason=claim.reason)
    try:
        rendered = _saw_rendered(claim, results)
        pairs, absent = _compared(claim, results)
    except MissingError as missing:
        return Verdict(claim, NOT_TESTABLE, reason=str(missing))
    limits = [f"no result of {', '.join(absent)}"] * bool(absent)
    if not pairs:
        return Verdict(claim, NOT_TESTABLE, reason=limits[0])
    said = _decide(claim, pairs, rendered)
    too_few = [names for names in _every(pairs) if len(names) < EVERY_NEEDS]
    limits += [f"only {len(names)} of at least {EVERY_NEEDS}: {', '.join(names)}" for names in too_few]
    if said.verdict == NOT_REPRODUCED and not absent:  # one that contradicts "every" is enough
        return replace(said, reason="; ".join(limits))
    if not limits:
        return said
    part = ", ".join(filter(None, [f"what was tested is {said.verdict}", said.reason]))
    return replace(said, verdict=PARTLY, reason="; ".join([*limits, part]))


def _saw_rendered(claim: Claim, results: Path) -> bool:
    notebooks = {side.notebook for test in claim.tests for side in test.selections}
    rendered = any([is_rendered(results, notebook) for notebook in sorted(notebooks)])
    rendered |= claim.only_on == "rendered people"
    if claim.only_on == "photographs" and rendered:
        raise MissingError("the claim is about photographs; this run saw rendered people")
    return rendered


def _compared(claim: Claim, results: Path) -> tuple[list[Pair], list[str]]:
    """The comparisons of a claim's tests, and the named systems that were not run."""
    pairs, absent = list[Pair](), dict[str, None]()
    for test in claim.tests:
        (left, absent_left), (right, absent_right) = select(test.left, results), select(test.right, results)
        agree = [(a, b) for a in left for b in right if all(a.row[c] == b.row[c] for c in test.match)]
        matching = [Pair(test, *two) for two in agree]
        if not matching + absent_left + absent_right:
            raise MissingError(f"no two rows of {test.left.table} agree in {', '.join(test.match)}")
        pairs += matching
        absent |= dict.fromkeys(absent_left + absent_right)
    return pairs, list(absent)


def _decide(claim: Claim, pairs: list[Pair], rendered: bool) -> Verdict:
    n = sum(pair.left.n * pair.right.n for pair in pairs)
    outcomes = [pair.outcome(n) for pair in pairs]
    decided = False if False in outcomes else None if None in outcomes else True
    decisive = [pair for pair, outcome in zip(pairs, outcomes, strict=True) if outcome is decided]
    decisive.sort(key=lambda pair: pair.slack(n)[0])
    verdict = {None: UNDECIDED, False: NOT_REPRODUCED, True: ON_RENDERED_DATA if rendered else REPRODUCED}
    said = Verdict(claim, verdict[decided], _evidence(claim, pairs, decisive), n_comparisons=n)
    if decided is not None:
        return said
    half = float(np.max([np.ptp(pair.interval(n)) / 2 for pair in decisive]))  # NaN if one has none
    reason = f"the least difference that this run could have seen is {half:.2g} {claim.unit}".strip()
    if math.isnan(half):
        reason = "too few images for an interval, or nothing found"
    return replace(said, reason=reason)


def _every(pairs: Iterable[Pair]) -> list[list[str]]:
    """Who was run, of each selection that means every detector, or every one of a class."""
    run: dict[tuple, set[str]] = {}
    for pair in pairs:
        for selection, quantity in zip(pair.test.selections, (pair.left, pair.right), strict=False):
            for column in SYSTEMS:
                if selection.every(column) and isinstance(quantity.row.get(column), str):
                    key = column, str(selection.where.get(column))
                    run.setdefault(key, set()).add(quantity.row[column])
    return [sorted(names) for names in run.values()]


def _evidence(claim: Claim, pairs: list[Pair], decisive: list[Pair]) -> str:
    """The numbers that decide, closest calls first, and whom a claim on every detector was tested on."""
    sides = [side for pair in decisive for side in (pair.left, pair.right) if side.row]
    texts = list(dict.fromkeys(str(side) for side in sides))
    parts = [f"{'; '.join(texts[:SHOWN])} {claim.unit}".strip()]
    if len(texts) > SHOWN:
        parts.append(f"{len(texts) - SHOWN} numbers more")
    if others := {name for names in _every(pairs) for name in names if name not in parts[0]}:
        parts.append(f"also tested on {', '.join(sorted(others))}")
    return "; ".join(parts)

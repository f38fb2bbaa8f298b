"""Short ways to say a claim and the rows it is judged on."""

from hicp_lib.study.claims.statements import Claim, Comparison, Selection
from hicp_lib.study.claims.verdicts import Verdict, judge_claims


def of(*detectors: str, **more) -> Selection:
    """The change of these detectors; of every one where none is named."""
    where = {"group": "body"} | ({"detector": list(detectors)} if detectors else {})
    return Selection("02", "loss", where, "change", low="low", high="high", **more)


LOSES = Comparison("<", of(), 0.0)
NAMED = Comparison("<", of("mmpose", "alphapose"), 0.0)


def claim(*tests: Comparison, **more) -> Claim:
    return Claim("c", "IV", "text", "statement", tests=tests, **more)


def rows(**changes: tuple[float, float, float]) -> list[dict]:
    """One row per detector: change, low, high."""
    return [
        {"group": "body", "detector": name.replace("_", "-"), "change": c, "low": low, "high": high}
        for name, (c, low, high) in changes.items()
    ]


def verdict(made: Claim, results) -> Verdict:
    return judge_claims([made], results)[0]

"""What is right to say of the files that `hicp inspect` is tried on."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "data" / "examples" / "native"


@dataclass(frozen=True)
class Case:
    """What is right to say of a file; texts are parts of what is said, needs all there are."""

    make: Callable[[Path], Path]
    kind: str
    says: dict[str, str]
    notes: list[str] = field(default_factory=list)
    needs: dict[str, str] = field(default_factory=dict)
    problem: str = ""


CASES: dict[str, Case] = {}


def case(kind: str, says: dict[str, str] | None = None, **more):
    """Register what is right of the file that the function makes in a folder."""

    def registered(make):
        CASES[make.__name__] = Case(make, kind, says or {}, **more)
        return make

    return registered


def dump(path: Path, value: object) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value))
    return path

"""All hostile inputs, by name."""

from __future__ import annotations

from itertools import chain

from tests.hostile import special_files
from tests.hostile.case import Case, unique

MODULES = (special_files,)


def corpus() -> dict[str, Case]:
    return unique(chain.from_iterable(module.cases() for module in MODULES))

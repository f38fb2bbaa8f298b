"""Hostile inputs are refused in one line, soon and cheaply; nothing is executed, lost or left.

Every ninth of them is tried here, of each kind some; `python -m tests.hostile` tries them all.
"""

from __future__ import annotations

import pytest

from tests.hostile.corpus import corpus
from tests.hostile.judge import Judge

EVERY = 9
CASES = list(corpus().values())


@pytest.fixture(scope="module")
def judge(tmp_path_factory, weights):
    judge = Judge(tmp_path_factory.mktemp("hostile"), weights)
    yield judge
    judge.close()


@pytest.mark.parametrize("case", CASES[::EVERY], ids=lambda case: ascii(case.name))
def test_hostile_inputs_are_refused(judge, case):
    assert judge.faults(case) == []

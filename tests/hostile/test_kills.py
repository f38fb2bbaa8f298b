"""Killed at any moment, or with a file cut off by a power cut, the same command comes to the same bytes.

Some of each kind; `python -m tests.hostile.kills --n 200` does more.
"""

from __future__ import annotations

import random

import pytest

from tests.hostile.judge import Ready
from tests.hostile.kills import GO_ON, Killing


@pytest.fixture(scope="module")
def ready(tmp_path_factory, weights):
    ready = Ready(tmp_path_factory.mktemp("ready"), {})
    yield ready
    ready.close()


@pytest.mark.parametrize("kind", ["detect", "create", "import bag", "draw"])
def test_killed_or_cut_off_the_next_run_comes_to_the_same_bytes(tmp_path, ready, kind):
    killing, moments = Killing(tmp_path, kind, ready), random.Random(kind)
    assert [fault for _ in range(3) for fault in killing.killed(moments)] == []
    if kind in GO_ON:
        assert [fault for _ in range(3) for fault in killing.cut(moments)] == []

"""What is simulated looks as it did: statistics in blocks of small results, within stated tolerances."""

import json

import numpy as np
import pytest

from tests.simulation.block_statistics import CASES, EXPECTED_FILE, computed, statistics

EXPECTED = json.loads(EXPECTED_FILE.read_text())
# Of a column's largest mean or standard deviation. Single precision of another processor moves results by a
# millionth; a ray that just misses an edge, a pixel of a small picture.
TOLERANCE = {"render": 0.02}
OTHERWISE = 5e-4


@pytest.mark.parametrize("case", CASES)
def test_results_have_the_statistics_they_had(case):
    found = computed(case)
    assert len(found) == len(EXPECTED[case])
    for number, (now, before) in enumerate(zip(found, EXPECTED[case], strict=True)):
        before = np.array(before)
        assert now.shape == before.shape, f"array {number}"
        scale = np.abs(before).max(axis=(0, 1)) + 1e-6
        off = np.abs(now - before) / scale
        worst = np.unravel_index(off.argmax(), off.shape)
        assert off[worst] <= TOLERANCE.get(case, OTHERWISE), (
            f"array {number}, block, statistic, column {worst}"
        )


def test_statistics_tell_blocks_apart_and_keep_order():
    values = np.arange(16.0)
    assert statistics(values)[:, 0, 0].tolist() == [1.5, 5.5, 9.5, 13.5]
    assert not np.allclose(statistics(values), statistics(values[::-1]))
    assert statistics(np.ones((2, 3))).shape == (2, 2, 3)

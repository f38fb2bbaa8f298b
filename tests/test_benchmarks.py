"""Every benchmark runs at its smallest size and compares with a named baseline; the README names them all."""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys

import pytest

from hicp_lib.core.checkout import CHECKOUT

FOLDER = CHECKOUT / "benchmarks"
BENCHMARKS = sorted(path.name for path in FOLDER.glob("*.py") if path.name != "timing.py")


def smallest(name: str, out, **environment: str) -> tuple[dict, str]:
    """What a benchmark wrote, and what it printed."""
    done = subprocess.run(
        [sys.executable, FOLDER / name, "--smallest", "--json", out],
        capture_output=True,
        text=True,
        timeout=600,
        env=os.environ | environment,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(out.read_text()), done.stdout


@pytest.mark.parametrize("name", BENCHMARKS)
def test_a_benchmark_runs_and_compares_with_a_named_baseline(name, tmp_path, weights):
    result, said = smallest(name, tmp_path / "result.json")
    assert result["rows"] and result["left_out"] is None
    for row in result["rows"]:
        assert row["what"] and row["baseline"]
        assert math.isfinite(row["ratio"]) and row["ratio"] > 0
        assert f"| {row['what']} | " in said and f" | {row['baseline']} | " in said


def test_what_is_absent_is_left_out_in_one_line(tmp_path):
    result, said = smallest("workers.py", tmp_path / "result.json", HICP_CACHE=str(tmp_path))
    assert not result["rows"]
    (line,) = [line for line in said.splitlines() if line.startswith("left out: ")]
    assert "hicp models fetch" in line


def test_the_readme_has_each_benchmark_and_no_other():
    named = re.findall(r"^## `(.*)`$", (FOLDER / "README.md").read_text(), re.MULTILINE)
    assert sorted(named) == BENCHMARKS

"""Compare the results of two reports to the last bit, except measured times.

    python tools/compare_reports.py ONE/results/full OTHER/results/full

Prints a line per file that differs, with the differences, and exits with 1 if there is any. Only measurements
of the machine are left out (`is_measured` of `hicp_lib/report/repetition.py`, and
`MEASURED`): a page saves it under the name `time`, and values of it end in `_time_ms`.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from hicp_lib.report.repetition import MEASURED_NAME, is_measured

MEASURED = {
    "captions.json": {MEASURED_NAME},
    "provenance.json": {"wall_s", "peak_memory_mb", "machine"},
}
"""Entries, by file, that differ from run to run or from machine to machine."""


def differences(one: Path, other: Path) -> Iterator[str]:
    """A line per file that differs between two folders of results."""
    names = [{p.relative_to(folder) for p in folder.rglob("*") if p.is_file()} for folder in (one, other)]
    for name in sorted(names[0] | names[1]):
        if name not in names[0] & names[1]:
            yield f"{name}: only in {one if name in names[0] else other}"
        elif not is_measured(name.stem) and (found := _difference(one / name, other / name)):
            yield f"{name}: {found}"


def _difference(one: Path, other: Path) -> str:
    """What differs between two files of one name; empty if nothing does."""
    if one.name == "values.json" or one.name in MEASURED:
        return ", ".join(_entries(*(_unmeasured(path) for path in (one, other))))
    if one.read_bytes() == other.read_bytes():
        return ""
    if one.suffix == ".parquet":
        return _columns(*(pd.read_parquet(path) for path in (one, other)))
    if one.suffix == ".json":
        found = ", ".join(_entries(*(json.loads(path.read_text()) for path in (one, other))))
        return found or "other bytes"
    return "other bytes"


def _unmeasured(path: Path) -> dict[str, Any]:
    left_out = MEASURED.get(path.name, set())
    entries = json.loads(path.read_text())
    return {key: e for key, e in entries.items() if key not in left_out and not is_measured(key)}


def _entries(one: Any, other: Any, at: str = "") -> Iterator[str]:
    """Where two JSON values differ."""
    if isinstance(one, dict) and isinstance(other, dict):
        for key in sorted(one.keys() | other.keys()):
            yield from _entries(one.get(key), other.get(key), f"{at}.{key}".lstrip("."))
    elif json.dumps(one) != json.dumps(other):
        long = isinstance(one, (dict, list)) or isinstance(other, (dict, list))
        yield at if long else f"{at} {one!r} against {other!r}"


def _columns(one: pd.DataFrame, other: pd.DataFrame) -> str:
    """Which columns of two tables differ, in how many rows and by how much at most."""
    if one.columns.tolist() != other.columns.tolist() or len(one) != len(other):
        return f"{one.shape} with {list(one)} against {other.shape} with {list(other)}"
    said = []
    for name in one:
        a, b = one[name], other[name]
        differ = np.array([repr(x) != repr(y) for x, y in zip(a, b, strict=True)], bool)
        if a.dtype != b.dtype or differ.any():
            numbers = pd.api.types.is_float_dtype(a) and pd.api.types.is_float_dtype(b)
            most = f", by up to {(a - b).abs().max():.2g}" if numbers else ""
            said.append(f"{name} in {differ.sum()} of {len(a)} rows{most}")
    return "; ".join(said) or "other bytes, the same values"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("one", type=Path, help="folder of results, such as results/full")
    parser.add_argument("other", type=Path)
    arguments = parser.parse_args()
    for folder in (arguments.one, arguments.other):
        if not any(folder.glob("*/provenance.json")):
            sys.exit(f"{folder}: holds no results; give a folder such as results/full after a report")
    n = 0
    for line in differences(arguments.one, arguments.other):
        print(line)
        n += 1
    files = [path for path in arguments.one.rglob("*") if path.is_file()]
    times = sorted(str(p.relative_to(arguments.one)) for p in files if is_measured(p.stem))
    print(f"{n} of {len(files)} files differ; left out as times: {', '.join(times) or 'no file'}")
    sys.exit(n > 0)


if __name__ == "__main__":
    main()

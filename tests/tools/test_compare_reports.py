"""Two reports are compared to the last bit, and only what is measured of a machine may differ."""

import json
import sys
from pathlib import Path

import compare_reports
import numpy as np
import pandas as pd
import pytest


def page(folder: Path, wall_s: float, **files: object) -> None:
    folder.mkdir(parents=True)
    captions = {"time": {"alt": f"{wall_s}"}, "curve": {"alt": "rises"}}
    values = {"median_time_ms": {"a": wall_s}, "ap": 0.5}
    provenance = {"wall_s": wall_s, "peak_memory_mb": wall_s, "machine": {"cpu": wall_s}, "parameters": {}}
    contents = {"captions": captions, "values": values, "provenance": provenance} | files
    for name, content in contents.items():
        (folder / f"{name}.json").write_text(json.dumps(content))
    table = pd.DataFrame({"x": [0.1, np.nan], "name": ["a", "b"]})
    table.to_parquet(folder / "curve.parquet")
    for kind in ("csv", "png"):
        (folder / f"time.{kind}").write_text(f"{wall_s}")


@pytest.fixture
def compare(tmp_path, monkeypatch, capsys):
    """What the tool prints of two folders, and its status."""

    def run() -> tuple[int | str, str]:
        monkeypatch.setattr(sys, "argv", ["compare_reports", f"{tmp_path}/one", f"{tmp_path}/other"])
        with pytest.raises(SystemExit) as ended:
            compare_reports.main()
        return ended.value.code, capsys.readouterr().out

    return run


def test_times_may_differ(tmp_path, compare):
    page(tmp_path / "one" / "01", 1.0)
    page(tmp_path / "other" / "01", 2.0)
    assert compare() == (0, "0 of 6 files differ; left out as times: 01/time.csv, 01/time.png\n")


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("values.json", '{"ap": 0.5000000000000001}', "ap 0.5 against 0.5000000000000001"),
        ("captions.json", '{"curve": {"alt": "falls"}}', "curve.alt 'rises' against 'falls'"),
        ("provenance.json", '{"parameters": {"n": 1}}', "parameters.n None against 1"),
        ("curve.png", "", "only in"),
    ],
)
def test_what_else_differs_is_told(tmp_path, compare, name, content, expected):
    page(tmp_path / "one" / "01", 1.0)
    page(tmp_path / "other" / "01", 1.0)
    (tmp_path / "other" / "01" / name).write_text(content)
    status, said = compare()
    assert status == 1 and said.startswith(f"01/{name}: {expected}") and "1 of 6 files differ" in said


def test_tables_are_compared_to_the_last_bit(tmp_path, compare):
    page(tmp_path / "one" / "01", 1.0)
    page(tmp_path / "other" / "01", 1.0)
    table = pd.DataFrame({"x": [np.nextafter(0.1, 1), np.nan], "name": ["a", "b"]})
    table.to_parquet(tmp_path / "other" / "01" / "curve.parquet")
    status, said = compare()
    assert status == 1 and "01/curve.parquet: x in 1 of 2 rows, by up to 1.4e-17" in said


def test_what_is_no_folder_of_results_is_refused(tmp_path, compare):
    status, _ = compare()
    assert status == f"{tmp_path}/one: holds no results; give a folder such as results/full after a report"

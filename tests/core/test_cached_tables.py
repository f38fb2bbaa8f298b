"""Tables are made once of the same inputs, and again when an input differs or the file is damaged."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core import cached_tables as kept_tables
from hicp_lib.core.cached_tables import cached
from hicp_lib.core.detections import Detections

CALLS: list[str] = []


def table_of(source, scale: float = 1.0) -> pd.DataFrame:
    CALLS.append("made")
    columns = {"x_m": [scale / 3, np.nan], "part": pd.Categorical(["a", "b"]), "text": ["é", None]}
    return pd.DataFrame(columns, index=[5, 7])


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch) -> Path:
    """Where the tables are kept."""
    monkeypatch.setenv("HICP_CACHE", str(tmp_path))
    CALLS.clear()
    return tmp_path / "tables" / "table_of"


def one_person(u_px: float = 1.0) -> Detections:
    return Detections(np.full((1, 136, 2), u_px), np.ones((1, 136)), np.ones(1))


def test_a_table_is_made_once_and_the_same_to_the_last_bit(folder):
    first = cached(table_of, {"a": [one_person()]}, scale=0.7)
    pd.testing.assert_frame_equal(first, table_of(None, 0.7), check_exact=True)
    CALLS.clear()
    pd.testing.assert_frame_equal(cached(table_of, {"a": (one_person(),)}, 0.7), first, check_exact=True)
    assert CALLS == []
    assert len(list(folder.iterdir())) == 1


INPUTS = [
    None, True, 1, 1.0, "1", [1, 2], [2, 1], {"a": 1, "b": 2}, {"b": 2, "a": 1},
    one_person(), one_person(2.0), np.zeros(4), np.zeros((2, 2)), np.zeros(4, np.float32),
    np.array(["a", None], object),
    pd.DataFrame({"x_m": [1.0]}), pd.DataFrame({"y_m": [1.0]}), pd.DataFrame({"x_m": [1]}),
    pd.DataFrame({"x_m": [1.0]}, index=[1]), pd.DataFrame({"part": ["a", None]}),
]  # fmt: skip


def test_other_inputs_make_other_tables(folder):
    for value in INPUTS:
        cached(table_of, value)
    assert len(CALLS) == len(INPUTS) == len(list(folder.iterdir()))


def test_files_count_by_what_the_system_says_of_them(tmp_path):
    path = tmp_path / "recording" / "0.png"
    path.parent.mkdir()
    path.write_bytes(b"depth")
    for source in (path, path.parent):
        os.utime(path, (1, 1))
        cached(table_of, source)
        os.utime(path, (2, 2))
        cached(table_of, source)
    assert len(CALLS) == 4


def test_a_damaged_table_and_one_of_other_code_are_made_again(folder, monkeypatch):
    whole = cached(table_of, 1)
    (path,) = folder.iterdir()
    content = bytearray(path.read_bytes())
    content[10] ^= 1
    for damaged in (bytes(content), content[:-9], b""):
        path.write_bytes(damaged)
        pd.testing.assert_frame_equal(cached(table_of, 1), whole, check_exact=True)
    monkeypatch.setattr(kept_tables, "key", lambda *_, **__: "of other code")
    cached(table_of, 1)
    assert len(CALLS) == 5


def test_what_is_not_known_by_content_is_refused():
    with pytest.raises(TypeError, match="content of function is not known"):
        cached(table_of, table_of)

"""Tables of others: columns once each, no more cells than fit the file."""

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from pyarrow import parquet

from hicp_lib.core.errors import InputError
from hicp_lib.core.tables import read_table, read_table_in_parts

CSV = {
    "a column twice": ("a,b,a\n1,2,3\n", "column 'a' 2 times"),
    "a column missing": ("a,c\n1,2\n", "no column 'b'"),
    "very many columns": ("a,b" + ",x" * 10**6 + "\n1,2" + ",1" * 10**6 + "\n", "1000002 columns"),
    "rows that differ": ("a,b\n1,2\n1,2,3\n", "cannot be read as a table"),
    "a field without a title": ("a,b\n0,1,2\n1,3,4\n", "cannot be read as a table .*[Ll]ength of header"),
    "nothing": ("", "cannot be read as a table"),
    "no text": (b"\xff\xfe\x00a,b".decode("latin-1"), "cannot be read as a table|no column"),
}


@pytest.mark.parametrize("case", CSV)
def test_csv_that_is_no_such_table_is_refused_in_one_line(tmp_path, case):
    content, said = CSV[case]
    path = tmp_path / "t.csv"
    path.write_text(content, encoding="latin-1")
    with pytest.raises(InputError, match=said) as told:
        read_table(path, ["a", "b"])
    message = str(told.value)
    assert message.startswith(str(path)) and "\n" not in message and len(message) < 600


@pytest.mark.filterwarnings("error")
def test_numbers_of_csv_are_read_to_the_last_bit_and_without_a_warning(tmp_path):
    numbers = np.random.default_rng(0).uniform(0, 1000, 10_000)
    pd.DataFrame({"a": numbers}).to_csv(tmp_path / "t.csv", index=False)
    assert read_table(tmp_path / "t.csv", ["a"])["a"].tolist() == numbers.tolist()


def test_parquet_is_read_where_its_columns_are_there_once(tmp_path):
    path = tmp_path / "t.parquet"
    columns = [pa.array([1]), pa.array([2]), pa.array([3])]
    parquet.write_table(pa.Table.from_arrays(columns, names=["a", "b", "c"]), path)
    assert read_table(path, ["b", "a"]).to_dict("records") == [{"a": 1, "b": 2, "c": 3}]
    with pytest.raises(InputError, match="no column 'd'"):
        read_table(path, ["a", "d"])
    parquet.write_table(pa.Table.from_arrays(columns, names=["a", "b", "a"]), path)
    with pytest.raises(InputError, match="column 'a' 2 times"):
        read_table(path, ["a", "b"])
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(InputError, match="t.parquet: cannot be read as a table"):
        read_table(path, ["a", "b"])


def test_columns_that_pandas_has_as_its_index_are_columns(tmp_path):
    pd.DataFrame({"a": [3, 1, 7], "b": [4, 2, 0]}).set_index("a").to_parquet(tmp_path / "t.parquet")
    assert read_table(tmp_path / "t.parquet", ["a", "b"])["a"].tolist() == [3, 1, 7]


@pytest.mark.parametrize("n_rows", [None, 1, 2])
def test_a_comma_behind_each_row_moves_no_column(tmp_path, n_rows):
    (tmp_path / "t.csv").write_text("a,b\n1,2,\n3,4,\n")
    parts = read_table_in_parts(tmp_path / "t.csv", ["a", "b"], n_rows)
    assert pd.concat(parts).to_dict("list") == {"a": [1, 3], "b": [2, 4]}


def test_a_small_file_that_stands_for_very_many_cells_is_not_unpacked(tmp_path, monkeypatch):
    path = tmp_path / "t.parquet"
    pd.DataFrame({"a": np.zeros(3_000_000), "b": 0.0}).to_parquet(path)
    assert path.stat().st_size < 100_000
    with pytest.raises(InputError, match="6000000 cells in"):
        read_table(path, ["a", "b"])
    monkeypatch.setenv("HICP_LIMITS", "2")
    assert len(read_table(path, ["a", "b"])) == 3_000_000

"""Values with bounds, and tables with a column per case."""

import numpy as np
import pandas as pd

from hicp_lib.study.table_format import wide, with_bounds


def test_a_value_stands_with_its_interval_and_nothing_is_a_dash():
    assert with_bounds(0.714, 0.65, 0.7749) == "0.71 [0.65, 0.77]"
    assert with_bounds(12.34, 11.0, 13.06, digits=1) == "12.3 [11.0, 13.1]"
    assert with_bounds(np.nan, np.nan, np.nan) == "–" and with_bounds(0.714, np.nan, np.nan) == "0.71"


def test_rows_and_columns_come_in_their_order():
    rows = [("b", 2, "late", "w"), ("a", 1, "early", "x"), ("b", 2, "early", "y"), ("a", 1, "late", "z")]
    table = pd.DataFrame(rows, columns=["name", "n", "when", "text"])
    shown = wide(table, ["name", "n"], "when")
    assert list(shown) == ["name", "n", "late", "early"]
    assert shown.values.tolist() == [["b", 2, "w", "y"], ["a", 1, "z", "x"]]
    assert list(wide(table, ["name", "n"], "when", ("early", "never", "late"))) == [
        "name",
        "n",
        "early",
        "late",
    ]

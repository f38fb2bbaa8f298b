"""Columns in their units, values with bounds, and tables with a column per case."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.study.table_format import bounds_of, in_cm, in_units, not_available, wide, with_bounds


def test_a_value_stands_with_its_interval_and_nothing_is_a_dash():
    assert with_bounds(0.714, 0.65, 0.7749) == "0.71 [0.65, 0.77]"
    assert with_bounds(12.34, 11.0, 13.06, digits=1) == "12.3 [11.0, 13.1]"
    assert with_bounds(-0.004, -0.006, 0.0) == "0.00 [-0.01, 0.00]"
    assert with_bounds(np.nan, np.nan, np.nan) == "–" and with_bounds(0.714, np.nan, np.nan) == "0.71"


def test_bounds_take_the_columns_and_the_factor_they_are_given():
    rows = pd.DataFrame({"value": [0.5], "low": [0.4], "high": [0.6], "x_m": [0.012], "x_m_low": [0.0114]})
    assert bounds_of(rows) == ["0.50 [0.40, 0.60]"]
    assert bounds_of(rows, ("x_m", "x_m_low", "x_m"), factor=100, digits=1) == ["1.2 [1.1, 1.2]"]


def test_lengths_are_in_centimetres_side_by_side():
    assert in_cm([0.03, np.nan]) == ["3.0", "–"]
    assert in_cm([0.0396, np.nan], [0.021, 0.5]) == ["4.0 / 2.1", "– / 50.0"]
    with pytest.raises(ValueError):
        in_cm([0.03], [0.03, 0.04])


@pytest.mark.parametrize(
    ("column", "value", "unit", "number", "text"),
    [
        ("retreat_m", 0.1234, "cm", 12.34, "12.3"),
        ("rms_m", 0.0123, "mm", 12.3, "12"),
        ("under_10cm_s", 0.456, "s", 0.456, "0.46"),
        ("delay_s", 0.0604, "ms", 60.4, "60"),
        ("time_ms", 60.4, "ms", 60.4, "60"),
        ("seen_share", 0.456, "%", 45.6, "46"),
        ("turned_rad", np.pi / 180, "°", 1.0, "1.0"),
    ],
)
def test_columns_are_in_the_unit_of_their_title(column, value, unit, number, text):
    table, titles = pd.DataFrame({"case": ["a"], column: [value]}), {"case": "who", column: f"what [{unit}]"}
    assert in_units(table, titles).iloc[0].tolist() == ["a", pytest.approx(number)]
    assert in_units(table, titles, text=True).iloc[0].tolist() == ["a", text]


def test_text_has_a_dash_for_what_did_not_happen_and_a_wrong_unit_is_refused():
    table = pd.DataFrame({"back_s": [0.5, np.nan]})
    assert in_units(table, {"back_s": "back after [s]"}, text=True).squeeze().tolist() == ["0.50", "–"]
    with pytest.raises(KeyError):
        in_units(table, {"back_s": "back after [cm]"})


def test_rows_and_columns_come_in_their_order():
    rows = {"name": ["b", "a", "b", "a"], "n": [2, 1, 2, 1], "text": ["w", "x", "y", "z"]}
    table = pd.DataFrame(rows | {"when": ["too_late", "early", "early", "too_late"]})
    shown = wide(table, ["name", "n"], "when", table["text"])
    assert list(shown) == ["name", "n", "too late", "early"]
    assert shown.values.tolist() == [["b", 2, "w", "y"], ["a", 1, "z", "x"]]
    ordered = wide(table, ["name", "n"], "when", table["text"], ("early", "never", "too_late"))
    assert list(ordered) == ["name", "n", "early", "too late"]


def test_a_wide_table_shows_bounds_if_nothing_else_is_said():
    table = pd.DataFrame({"case": ["a", "a"], "metric": ["AP", "AR"], "value": [0.5, np.nan],
                          "low": [0.4, np.nan], "high": [0.6, np.nan]})  # fmt: skip
    assert wide(table, ["case"], "metric").iloc[0].tolist() == ["a", "0.50 [0.40, 0.60]", "–"]


def test_a_wide_table_of_nothing_has_the_columns_that_name_its_rows():
    nothing = pd.DataFrame({"case": [], "metric": [], "value": [], "low": [], "high": []})
    assert list(wide(nothing, ["case"], "metric")) == ["case"]


def test_what_is_not_there_is_said():
    assert not_available("truth.parquet").iloc[0].tolist() == [
        "truth.parquet",
        "not available for this recording",
    ]

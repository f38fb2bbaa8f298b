"""Tables for reading say what the numbers are."""

import numpy as np
import pandas as pd

from hicp_lib.study.relative_text import causes_text, distances_text, shares_text


def test_shares_have_a_column_per_method_and_the_order_they_came_in():
    rows = [("upper", d, m, p, t, v, v - 0.1, v + 0.1)
            for d, p, m, v in (("b", "left wrist", "robust", 0.7), ("b", "left wrist", "paper", 0.5),
                               ("a", "left hand", "robust", np.nan), ("a", "left hand", "paper", 0.2))
            for t in (0.05, 0.1)]  # fmt: skip
    columns = ["view", "detector", "method", "part", "threshold_m", "value", "low", "high"]
    table, caption = shares_text(pd.DataFrame(rows, columns=columns), 0.05, "Shares.")
    assert list(table) == ["view", "detector", "part", "robust", "paper"]
    assert table.iloc[0].tolist() == ["upper", "b", "left wrist", "0.70 [0.60, 0.80]", "0.50 [0.40, 0.60]"]
    assert table.iloc[1]["robust"] == "–"
    assert caption == "Shares. Of 1 cases, paper has the higher share in 0, robust in 1."


def test_distances_are_in_centimetres_and_unknown_ones_left_out():
    columns = ["view", "detector", "part", "method", "n_images", "spread_m", "spread_m_low", "spread_m_high"]
    table = pd.DataFrame([("upper", "a", "left wrist", "paper", 9.2, 0.012, 0.011, 0.0144)], columns=columns)
    assert distances_text(table).to_dict("records") == [
        {
            "view": "upper",
            "detector": "a",
            "part": "left wrist",
            "method": "paper",
            "images": "9",
            "spread [cm]": "1.2 [1.1, 1.4]",
        }
    ]


def test_causes_have_a_column_each():
    rows = [("upper", "a", "left wrist", cause, s, 2 * s) for cause, s in (("depth", 0.01), ("pixel", 0.02))]
    table = causes_text(
        pd.DataFrame(rows, columns=["view", "detector", "part", "cause", "spread_m", "bias_m"])
    )
    assert table.iloc[0].to_dict() == {
        "view": "upper", "detector": "a", "part": "left wrist", "depth": "1.0 / 2.0", "pixel": "2.0 / 4.0",
    }  # fmt: skip


def test_what_is_not_there_is_said():
    assert "not available" in shares_text(None, 0.05)[0]["here"].item()
    assert "not available" in causes_text(pd.DataFrame(columns=["view", "cause", "spread_m"]))["here"].item()

"""Found apart from placed: who is found at all, and how well those are."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.evaluation.ap.found_and_placed import FOUND, OKS_OF_FOUND, WELL_PLACED, found_and_placed
from hicp_lib.evaluation.statistics.resampling import Draws

CASE = {"subset": "basic", "group": "body", "detector": "mediapipe"}


def people(oks: list[float], detector: str = "mediapipe") -> pd.DataFrame:
    return pd.DataFrame({**CASE, "detector": detector, "source_image": range(len(oks)), "oks": oks})


def by_what(table: pd.DataFrame) -> pd.DataFrame:
    return table.set_index("what")[["value", "n"]]


def test_who_is_found_counts_from_a_tenth_and_the_rest_is_of_the_found():
    table = by_what(found_and_placed(people([0.0, 0.0999, 0.1, 0.5, 0.9, 0.9])))
    assert table.loc[FOUND].tolist() == pytest.approx([4 / 6, 6])
    assert table.loc[OKS_OF_FOUND].tolist() == pytest.approx([0.6, 4])
    assert table.loc[WELL_PLACED].tolist() == pytest.approx([3 / 4, 4])


def test_of_nobody_found_there_is_no_quality():
    both = pd.concat([people([0.0, 0.05]), people([0.8, 0.05], "posenet")])
    table = found_and_placed(both)
    assert table["detector"].unique().tolist() == ["mediapipe", "posenet"]
    nobody = by_what(table[table["detector"] == "mediapipe"])
    assert nobody.loc[FOUND].tolist() == [0.0, 2]
    assert np.isnan(nobody.loc[OKS_OF_FOUND, "value"]) and nobody.loc[OKS_OF_FOUND, "n"] == 0


def test_intervals_hold_the_value_and_are_of_source_images():
    alone = people(list(np.linspace(0, 1, 40)))
    together = alone.assign(source_image=alone["source_image"] // 20)
    row = found_and_placed(alone, Draws(200)).iloc[0]
    assert row["low"] < row["value"] < row["high"]
    assert (
        found_and_placed(together, Draws(200))["low"].isna().all()
    )  # two images say nothing of their spread


def test_all_found_and_none_well_placed_is_not_certain():
    table = found_and_placed(people([0.5] * 40), Draws(50)).set_index("what")
    assert table.loc[FOUND, ["low", "value", "high"]].tolist() == pytest.approx([0.025 ** (1 / 40), 1, 1])
    assert table.loc[OKS_OF_FOUND, ["low", "high"]].tolist() == [0.5, 0.5]  # a mean, not a share

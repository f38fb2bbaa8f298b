"""Photographs beside a run: the figures that are kept, and how far two orders agree."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.evaluation.ap.metric_table import draw_cases, metric_table
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.study import photographs as module
from hicp_lib.study.photographs import (
    PHOTOGRAPHED,
    RENDERED,
    beside,
    people_table,
    photographs,
    rank_agreement,
)
from tests.evaluation.made_people import make_scene

NAMES = ("movenet-thunder", "posenet", "mediapipe")


@pytest.fixture(scope="module")
def drawn():
    truth, found = make_scene(0)
    return draw_cases({"basic": truth}, {("basic", name): found for name in NAMES}, Draws(20), ["body"])


def test_what_is_kept_belongs_together():
    metrics, draws, people, images = map(photographs, ("metrics", "draws", "people", "images"))
    ap = metrics[metrics["metric"] == "AP"].set_index(["subset", "detector"])
    for (subset, detector), row in ap.iterrows():
        low, high = np.percentile(draws[f"{subset} {detector}"], [2.5, 97.5])
        assert (low, high) == pytest.approx((row["low"], row["high"]), abs=1e-3)
    assert images["sha256"].str.fullmatch("[0-9a-f]{64}").all() and images["sha256"].is_unique
    assert people.groupby("subset").size().le(images["n_people"].sum()).all()


def test_detectors_that_both_have_stand_beside_each_other(drawn):
    table = beside(metric_table(drawn))
    assert set(table["where"]) == {RENDERED, PHOTOGRAPHED}
    assert set(table["detector"]) == set(NAMES) and set(table["subset"]) == {"basic"}
    assert not table.duplicated(["where", "subset", "detector"]).any()


def test_agreement_of_orders(drawn, monkeypatch):
    def same(table: str, sign: float = 1) -> pd.DataFrame:
        rising = {f"basic {name}": np.linspace(k, k + 0.5, 20) * sign for k, name in enumerate(NAMES)}
        rows = [("AP", "basic", name, sign * k) for k, name in enumerate(NAMES)]
        columns = ["metric", "subset", "detector", "value"]
        return pd.DataFrame(rising) if table == "draws" else pd.DataFrame(rows, columns=columns)

    class Its:
        def __init__(self, value):
            self.AP = value

    ours = {("basic", n, "body"): (Its(k), {"AP": np.full(20, k, float)}) for k, n in enumerate(NAMES)}
    for sign in (1, -1):
        monkeypatch.setattr(module, "photographs", lambda table, sign=sign: same(table, sign))
        (row,) = rank_agreement(ours).itertuples()
        assert (row.n_detectors, row.tau, row.low, row.high) == pytest.approx((3, sign, sign, sign))


def test_one_detector_has_no_order(drawn):
    one = {case: of for case, of in drawn.items() if case[1] == NAMES[0]}
    assert rank_agreement(one).empty


def test_people_are_counted_with_those_who_reach_in():
    truth, _ = make_scene(0)
    table = people_table({"basic": truth})
    assert len(table) == (~truth.is_crowd).sum()
    for row in table.itertuples():
        image = truth.image_ids[truth.ids == row.annotation_id][0]
        assert row.n_others == (truth.image_ids == image).sum() - 1

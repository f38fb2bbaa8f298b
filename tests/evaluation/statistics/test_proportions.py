"""Shares with intervals."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.evaluation.statistics.proportions import mean_with_interval, proportions


def test_shares_are_means_of_what_is_known():
    rows = pd.DataFrame({"who": ["b", "a", "a", "a"], "source_image": [1, 1, 2, 3], "hit": [1, 0, 1, np.nan]})
    table = proportions(rows, ["who"], "hit", n_resamples=50)
    assert table["who"].tolist() == ["b", "a"] and table["value"].tolist() == [1, 0.5]
    assert table["n"].tolist() == [1, 2] and table["n_images"].tolist() == [1, 2]


def test_rows_of_one_image_are_drawn_together():
    images = np.repeat(np.arange(20), 50)
    alone = mean_with_interval(images % 2, np.arange(1000))
    together = mean_with_interval(images % 2, images)
    assert alone[0] == together[0] == 0.5
    # Fifty equal rows say no more than one.
    assert (together[2] - together[1]) / (alone[2] - alone[1]) == pytest.approx(np.sqrt(50), rel=0.15)


def test_of_nothing_there_is_no_mean():
    assert np.isnan(mean_with_interval(np.zeros(0), np.zeros(0))).all()

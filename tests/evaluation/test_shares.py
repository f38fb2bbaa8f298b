"""Shares with intervals."""

import numpy as np
import pandas as pd

from hicp_lib.evaluation.shares import mean_with_interval, shares


def test_shares_are_means_of_what_is_known():
    rows = pd.DataFrame({"who": ["b", "a", "a", "a"], "source_image": [1, 1, 2, 3], "hit": [1, 0, 1, np.nan]})
    table = shares(rows, ["who"], "hit", n_resamples=50)
    assert table["who"].tolist() == ["b", "a"] and table["value"].tolist() == [1, 0.5]
    assert table["n"].tolist() == [1, 2] and table["n_images"].tolist() == [1, 2]


def test_rows_of_one_image_are_drawn_together():
    flags = np.repeat([0, 1], 500)
    alone = mean_with_interval(flags, np.arange(1000))
    together = mean_with_interval(flags, flags)
    assert alone[0] == together[0] == 0.5
    assert alone[2] - alone[1] < 0.08 and together[1:] == (0, 1)


def test_of_nothing_there_is_no_mean():
    assert np.isnan(mean_with_interval(np.zeros(0), np.zeros(0))).all()

"""Limbs as lines: those whose both ends are known, one after the other."""

import numpy as np
import pandas as pd

from hicp_lib.study.plots.skeleton import BODY_LIMBS, HAND_LIMBS, limb_lines


def test_limbs_are_lines_between_known_ends():
    rows = [
        ("left_shoulder", 0, 1),
        ("left_elbow", 2, 3),
        ("left_wrist", np.nan, 5),
        ("nose", 7, 8),
        ("left_elbow", 9, 9),
    ]
    table = pd.DataFrame(rows, columns=["keypoint", "x", "y"])
    np.testing.assert_array_equal(limb_lines(table, ["x", "y"]), [[0, 1], [2, 3], [np.nan, np.nan]])
    assert limb_lines(table, ["x", "y"], HAND_LIMBS).shape == (0, 2)
    assert limb_lines(table, ["y"], BODY_LIMBS)[:2].tolist() == [[1], [3]]

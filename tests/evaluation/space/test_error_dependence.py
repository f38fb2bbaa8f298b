"""What errors depend on: bins of numbers, labels, and their quartiles."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.evaluation.space.error_dependence import error_dependence, errors_by
from hicp_lib.evaluation.space.mocap_error import JOINTS

N = 60
FRAMES = np.arange(N)


def errors_of(error_m=0.01, score: float = 0.8) -> pd.DataFrame:
    """Every joint found in every frame; the error by frame, or the same in all."""
    table = pd.DataFrame({"frame": np.repeat(np.arange(N), len(JOINTS)), "keypoint": np.tile(JOINTS, N)})
    by_frame = np.repeat(np.broadcast_to(error_m, N), len(JOINTS))
    return table.assign(detector="made-up", method="paper", score=score, error_m=by_frame)


def test_errors_are_binned_by_another_column_sides_together():
    errors = errors_of(0.01 + FRAMES / 1000)
    table = errors_by(errors, "frame", [0, 20, 40, 100]).query("part == 'wrist'")
    assert table["bin"].tolist() == ["0 to 20", "20 to 40", "40 to 100"]
    assert table["middle"].tolist() == [10, 30, 70] and table["n"].tolist() == [40, 40, 40]
    assert table["median_m"].to_numpy() == pytest.approx([0.0195, 0.0395, 0.0595])
    assert (table["lower_m"] < table["median_m"]).all() and (table["median_m"] < table["upper_m"]).all()


def test_errors_are_grouped_by_labels():
    errors = errors_of(0.01 + (FRAMES >= 50) * 0.1)
    errors["sight"] = np.where(errors["frame"] >= 50, "hidden", "clear")
    table = errors_by(errors, "sight").query("part == 'elbow'").set_index("bin")
    assert table.loc["clear", ["n", "median_m"]].tolist() == pytest.approx([100, 0.01])
    assert table.loc["hidden", ["n", "median_m"]].tolist() == pytest.approx([20, 0.11])


def test_bins_are_closed_on_the_left_and_a_score_of_one_has_its_own():
    errors = errors_of(0.01).query("keypoint == 'left_wrist'")
    scores = np.resize([0.3, 0.5, 0.7, 0.9, 1.0], len(errors))
    errors = errors.assign(score=scores, distance_m=np.resize([0.4, 0.79, 0.8, 1.0, 3.99], N), sight="clear")
    table = error_dependence(errors, 0.1)
    of_score = table[table["by"] == "score"].set_index("bin")["n"]
    assert of_score.to_dict() == {"0.3 to 0.5": 12, "0.5 to 0.7": 12, "0.7 to 0.9": 12, "0.9 to 1.001": 24}
    of_distance = table[table["by"] == "distance_m"].set_index("bin")["n"]
    assert of_distance.to_dict() == {
        "0.4 to 0.6": 12, "0.6 to 0.8": 12, "0.8 to 1": 12, "1 to 1.2": 12, "3 to 4": 12,
    }  # fmt: skip
    assert table.loc[table["by"] == "sight", ["bin", "n"]].to_numpy().tolist() == [["clear", N]]


def test_quartiles_of_the_error():
    errors = errors_of(0.001 * FRAMES).assign(sight="clear")
    row = errors_by(errors.query("keypoint == 'left_wrist'"), "sight").iloc[0]
    quartiles = np.quantile(0.001 * np.arange(N), [0.25, 0.5, 0.75])
    assert row[["lower_m", "median_m", "upper_m"]].tolist() == pytest.approx(quartiles.tolist())


def test_where_nothing_was_found_the_error_depends_on_nothing():
    errors = errors_of(score=0.05).assign(distance_m=1.0, sight="clear")
    assert error_dependence(errors).empty and "median_m" in error_dependence(errors)

"""The paper's tables: what was measured stands above the paper's own rows."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.evaluation.space.mocap_error import JOINTS, MIN_SCORES, TABLE_JOINTS
from hicp_lib.study.paper_tables import above_floor, beside_paper, paper_medians
from hicp_lib.study.plots.palette import PERFECT


def medians() -> pd.DataFrame:
    """The columns that the paper's tables are of, for six joints found 60 to 65 times in 70 frames."""
    rows = [
        ("a", method, joint, score, 60 + k, 0.04 + 0.01 * (method == "robust"), 0.038, 0.0421)
        for method in ("paper", "robust")
        for k, joint in enumerate(JOINTS)
        for score in MIN_SCORES
    ]
    columns = ["detector", "method", "keypoint", "min_score", "count", "median_m", "low_m", "high_m"]
    return pd.DataFrame(rows, columns=columns)


def test_what_was_measured_stands_above_the_papers_rows():
    table = beside_paper(medians(), paper_medians(), 0.3)
    named = ["alphapose (paper)", "mmpose (paper)", "detectron2 (paper)", "openpose (paper)"]
    assert table["detector"].tolist() == ["a", "a", *named]
    assert table["lifting"].tolist() == ["paper", "robust", *["paper"] * 4]
    assert list(table.columns[2:]) == [joint.replace("_", " ") for joint in TABLE_JOINTS]
    assert table["left wrist"].tolist()[:2] == ["62 / 4.0 [3.8, 4.2]", "62 / 5.0 [3.8, 4.2]"]
    assert table.loc[3, "left elbow"] == "419 / 3.4"


def test_what_stands_above_the_floor_is_by_the_papers_lifting_here_and_there():
    rows = pd.concat([medians(), medians().assign(detector=PERFECT, median_m=0.03)])
    differences = medians().assign(other=PERFECT, value_m=0.01, low_m=0.008, high_m=0.0121)
    others = differences.assign(other="b", value_m=0.2)
    table = above_floor(rows, pd.concat([differences, others]), paper_medians(), 0.1).set_index("detector")
    assert table.index.tolist() == ["a", *(f"{n} (paper)" for n in paper_medians()["detector"].unique())]
    assert table.loc["a", "left wrist"] == "1.0 [0.8, 1.2]"
    assert table.loc["openpose (paper)", "left wrist"] == "2.6" and table.shape == (5, len(TABLE_JOINTS))


def test_a_joint_that_was_never_found_is_a_plain_zero():
    never = medians().assign(count=0, median_m=np.nan, low_m=np.nan, high_m=np.nan)
    assert beside_paper(never, paper_medians(), 0.1).loc[0, "right wrist"] == "0"


def test_the_papers_tables_are_whole():
    paper = paper_medians()
    assert len(paper) == 4 * 4 * 2 and paper["median_m"].between(0.02, 0.2).all()
    first = paper.query("detector == 'mmpose' and keypoint == 'left_elbow' and min_score == 0.3").iloc[0]
    assert (first["count"], first["median_m"]) == (419, 0.034)
    assert first["found"] == pytest.approx(419 / 480) and paper["found"].max() < 1
    assert not paper.duplicated(["detector", "keypoint", "min_score"]).any()

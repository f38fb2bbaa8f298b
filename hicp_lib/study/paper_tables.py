"""The paper's Tables III and IV (section IV-C), beside what was measured here."""

import pandas as pd

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.files import read_json
from hicp_lib.evaluation.space.mocap_error import TABLE_JOINTS
from hicp_lib.study.plots.palette import PERFECT
from hicp_lib.study.table_format import bounds_of, wide


def paper_medians() -> pd.DataFrame:
    """The paper's Tables III and IV: columns `detector, keypoint, min_score, count, median_m, found`, the
    last the count as a share of its frames, about 480.
    """
    table = read_json(DATA_DIR / "paper.json")["mocap"]
    frame = pd.DataFrame(table["rows"], columns=table["columns"])
    return frame.assign(median_m=frame.pop("median_cm") / 100, found=frame["count"] / table["n_frames"])


def beside_paper(medians: pd.DataFrame, paper: pd.DataFrame, min_score: float) -> pd.DataFrame:
    """One of the paper's two tables, what was measured here above the paper's own rows.

    Parameters
    ----------
    medians, paper : pd.DataFrame
        As from `median_errors` and `paper_medians`.
    min_score : float
        Whose table: one of `MIN_SCORES`.

    Returns
    -------
    pd.DataFrame
        Columns `detector, lifting` and one per joint: "count / median [cm]", here with the 95 % interval.
    """
    rows = pd.concat([medians, paper.assign(detector=paper["detector"] + " (paper)", method="paper")])
    rows = rows[(rows["min_score"] == min_score) & rows["keypoint"].isin(TABLE_JOINTS)]
    texts = zip(rows["count"], bounds_of(rows, ("median_m", "low_m", "high_m"), 100, 1), strict=True)
    cells = [f"{count:.0f} / {text}" if count else "0" for count, text in texts]
    return wide(rows, ["detector", "method"], "keypoint", cells).rename(columns={"method": "lifting"})


def above_floor(
    medians: pd.DataFrame, differences: pd.DataFrame, paper: pd.DataFrame, min_score: float
) -> pd.DataFrame:
    """What stands above the perfect detector's medians, here and in the paper, by the paper's lifting.

    Parameters
    ----------
    medians, differences, paper : pd.DataFrame
        As from `median_errors`, `median_differences` and `paper_medians`.
    min_score : float
        One of `MIN_SCORES`.

    Returns
    -------
    pd.DataFrame
        Columns `detector` and one per joint, in cm, here with the 95 % interval.
    """
    of_floor = (medians["detector"] == PERFECT) & (medians["method"] == "paper")
    floor_m = medians[of_floor].drop_duplicates("keypoint").set_index("keypoint")["median_m"]
    theirs = paper.assign(detector=paper["detector"] + " (paper)", method="paper", other=PERFECT)
    theirs["value_m"] = theirs["median_m"] - theirs["keypoint"].map(floor_m)
    rows = pd.concat([differences, theirs]).query("other == @PERFECT and method == 'paper'")
    rows = rows[(rows["min_score"] == min_score) & rows["keypoint"].isin(TABLE_JOINTS)]
    return wide(rows, ["detector"], "keypoint", bounds_of(rows, ("value_m", "low_m", "high_m"), 100, 1))

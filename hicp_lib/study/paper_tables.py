"""The paper's tables: its survey (I: `data/survey.json`, II: the registry); III and IV with our results."""

from collections.abc import Collection

import pandas as pd

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.files import read_json
from hicp_lib.detectors.registry import DETECTORS, command_to_run, command_to_use
from hicp_lib.evaluation.space.mocap_error import TABLE_JOINTS
from hicp_lib.study.plots.palette import PERFECT
from hicp_lib.study.table_format import bounds_of, wide

PAPER_SYSTEMS = ("openpose", "mmpose", "alphapose", "detectron2", "mediapipe")


def surveyed_data_sets() -> pd.DataFrame:
    """Data sets with annotated keypoints, one row each; numbers are points per person."""
    return pd.DataFrame(read_json(DATA_DIR / "survey.json")["data_sets"])


def surveyed_detectors(run: Collection[str]) -> pd.DataFrame:
    """Detectors (the paper's Table II), one row each, the paper's five first.

    Parameters
    ----------
    run : sequence of str
        Names of the detectors that were run; one that was imported as NAME-imported counts.

    Returns
    -------
    pd.DataFrame
        Columns `system, detector, paradigm, keypoints, training data, tracking, input`, `parameters [M]`,
        `operations [G]` (NaN where the user's weights decide) and `here`: "run", or the command that would
        run it.

    Examples
    --------
    >>> table = surveyed_detectors(["mediapipe", "mmpose-imported"]).set_index("detector")
    >>> table.at["mediapipe", "here"], table.at["mmpose", "here"]
    ('run', 'run')
    """
    rows = [
        {"system": DETECTORS[name].label, "detector": name}
        | vars(DETECTORS[name].facts)
        | {"here": _status(name, run)}
        for name in dict.fromkeys([*PAPER_SYSTEMS, *DETECTORS])
    ]
    table = pd.DataFrame(rows)
    counts = table[["n_parameters", "n_operations"]].astype(float) / [1e6, 1e9]
    titles = {
        "training_data": "training data",
        "n_parameters": "parameters [M]",
        "n_operations": "operations [G]",
    }
    return table.assign(**counts).rename(columns=titles)


def _status(name: str, run: Collection[str]) -> str:
    if name in run or f"{name}-imported" in run:
        return "run"
    if name in ("mediapipe-pose", "mediapipe-hands") and "mediapipe" in run:
        return "run, within mediapipe"
    command = command_to_use if DETECTORS[name].needs_model else command_to_run
    fetched = "hicp models fetch rtmw-l-384x288, then " if name == "mmpose" else ""
    return f"not run; {fetched}{command(name)}"


def paper_medians() -> pd.DataFrame:
    """The paper's Tables III and IV: columns `detector, keypoint, min_score, count, median_m, found`, the
    last the count as a share of its frames, about 480.
    """
    table = read_json(DATA_DIR / "paper.json")["mocap"]
    frame = pd.DataFrame(table["rows"], columns=table["columns"])
    return frame.assign(median_m=frame.pop("median_cm") / 100, found=frame["count"] / table["n_frames"])


def beside_paper(medians: pd.DataFrame, paper: pd.DataFrame, min_score: float) -> pd.DataFrame:
    """One of the paper's two tables: our rows above those of the paper.

    Parameters
    ----------
    medians, paper : pd.DataFrame
        As from `median_errors` and `paper_medians`.
    min_score : float
        Selects the table: one of `MIN_SCORES`.

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
    """Medians above those of the perfect detector (the floor), here and in the paper, by the paper's lifting.

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

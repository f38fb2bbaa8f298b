"""What the paper found, as the result tables of a run that repeats it, and the opposite of each finding.

Numbers are the paper's where it gives them (`data/paper.json`). Orderings and "similar", which it gives in
words, are made numbers of a size that no margin leaves in doubt. `OPPOSITES` names, for every claim, what
would have to come out otherwise for the claim to be wrong: each of these alone.
"""

import itertools
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pandas as pd

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.files import read_json

MORE, LESS, SIMILAR = 0.2, -0.2, 0.0
WITH_HANDS = ("mmpose", "alphapose", "openpose")
BODY = ("mmpose", "alphapose", "detectron2", "openpose")
OTHERS = ("mmpose", "alphapose", "detectron2")  # than OpenPose
BOTH, VIEWS, SIDES = ("basic", "headless"), ("upper", "lower"), ("left", "right")
WRISTS, ELBOWS, SHOULDERS = (
    tuple(f"{side}_{joint}" for side in SIDES) for joint in ("wrist", "elbow", "shoulder")
)
HANDS, HIPS = ("left hand", "right hand"), ("left hip", "right hip")
ARMS = tuple(f"{side} {joint}" for joint in ("elbow", "wrist") for side in SIDES)
PARTS = (*ARMS, *HANDS, *(f"{side} shoulder" for side in SIDES))
COMBINATIONS = ("combined:mmpose+mediapipe-hands", "combined:alphapose+mediapipe-hands")
KINDS = (
    "whole upper body",
    "no head",
    "only left arm",
    "both arms",
    "both arms without shoulders",
    "only legs",
)
EXCEPTIONS = ("only head", "only right arm")
GIVEN = "outside the picture: given"
BORDER = "outside the picture: of those given, put at the border or beyond"
SCORE = "outside the picture: mean score, less that of visible keypoints"

AP, LEVEL = "02_evaluation_2d/pairs", "02_evaluation_2d/precision_recall"
LOSS, ANY_JOINT = "02_evaluation_2d/head_loss_table", "04_mocap_3d/found"
IN_3D, MOCAP = "03_relative_3d/pairs", "04_mocap_3d/medians"
ODD, REMARKS = "03_relative_3d/implausible", "05_failure_analysis/paper_remarks"
STEADY, FOUND = "03_relative_3d/stability", "03_relative_3d/found"
ALIKE, BY_PARTS = "03_relative_3d/similar_views", "05_failure_analysis/order_by_parts"
SEEN, MEDIAN_PAIRS, BETWEEN = f"{MOCAP}:seen", "04_mocap_3d/pairs", "04_mocap_3d/between_scores"
BEYOND, ARM = "04_mocap_3d/beyond", "04_mocap_3d/sides"
IN_METRES = ("value_m", "low_m", "high_m")
VALUES = {  # columns of the number and of its interval, "" for none
    "01_dataset/counts": ("people", "", ""),
    LOSS: ("change", "low", "high"),
    MOCAP: ("median_m", "low_m", "high_m"),
    SEEN: ("found", "found_low", "found_high"),  # in the same table
    MEDIAN_PAIRS: IN_METRES,
    BETWEEN: IN_METRES,
}
N_FRAMES = 480  # of the paper's recording, about

Row = tuple[
    str, dict[str, Any], float, float
]  # table, labels (several where one is a tuple), value, half-width


def pair(metric: str, group: str, detector: Any, other: Any, subset: Any = BOTH) -> dict[str, Any]:
    return {"subset": subset, "group": group, "metric": metric, "detector": detector, "other": other}


def in_space(view: str, detector: Any, other: Any) -> dict[str, Any]:
    labels = {"view": view, "part": HANDS, "detector": detector, "other": other, "method": "paper"}
    return labels | {"measure": "within 5 cm of the median"}


def by_parts(kind: Any, detector: str, other: Any) -> dict[str, Any]:
    return {"class": kind, "group": "body", "metric": "AP", "detector": detector, "other": other}


def odd(measure: str, part: Any, detector: Any, view: Any = VIEWS) -> dict[str, Any]:
    return {"measure": measure, "part": part, "view": view, "detector": detector, "method": "paper"}


def in_view(view: str, part: Any, detector: Any, **more) -> dict[str, Any]:
    return {"view": view, "part": part, "detector": detector, "method": "paper"} | more


def joint(keypoint: Any, score: Any, detector: Any) -> dict[str, Any]:
    return {"detector": detector, "keypoint": keypoint, "min_score": score, "method": "paper"}


def remark(measure: str, detector: str) -> dict[str, Any]:
    return {"measure": measure, "detector": detector, "status": "run"}


def size(level: int) -> dict[str, Any]:
    return {"dose": "resolution", "level": level, "group": "hand", "detector": "mediapipe",
            "measure": "visible keypoints hit"}  # fmt: skip


FLICKERS = {"measure": "flicker rate"}
BENT, HIPS_IN, TILT = "broken fingers", "hips in the abdomen", "shoulder line tilt [rad]"
COUNTS = "01_dataset/counts"
CLEARANCE = "06_hri_avoidance/clearance"
AT_10_CM = {"threshold_m": 0.1, "reference": "median"}

WORLD: list[Row] = [
    (COUNTS, {"data set": "basic", "what became of a person": "kept"}, 1624, 0),
    (COUNTS, {"data set": "headless", "what became of a person": "kept"}, 1608, 0),
    # Bodies: top-down before OpenPose; MMPose more precise only on Headless, with the higher recall.
    (AP, pair("AP", "body", OTHERS, "openpose"), MORE, 0.03),
    (AP, pair("AP", "body", "mmpose", ("alphapose", "detectron2"), "headless"), MORE, 0.03),
    (AP, pair("AP", "body", "mmpose", ("alphapose", "detectron2"), "basic"), SIMILAR, 0.01),
    (AP, pair("AR", "body", "mmpose", ("alphapose", "detectron2", "openpose")), MORE, 0.03),
    (AP, pair("AP", "body", "alphapose", "detectron2"), SIMILAR, 0.01),
    (AP, pair("AR", "body", "alphapose", "detectron2"), SIMILAR, 0.01),
    # Hands: OpenPose more of them than AlphaPose and MediaPipe, less precise; these two similar; MMPose most.
    (AP, pair("AR", "hand", "mmpose", ("alphapose", "openpose")), MORE, 0.03),
    (AP, pair("AR50", "hand", "mmpose", ("alphapose", "openpose")), MORE, 0.03),
    (AP, pair("AR50", "hand", "openpose", ("alphapose", "mediapipe")), MORE, 0.03),
    (AP, pair("AP", "hand", "openpose", ("alphapose", "mediapipe")), LESS, 0.03),
    (AP, pair("AP", "hand", "mediapipe", "alphapose"), SIMILAR, 0.01),
    (AP, pair("AR", "hand", "mediapipe", "alphapose"), SIMILAR, 0.01),
    (LEVEL, {"subset": "basic", "metric": "AP", "group": "hand", "detector": WITH_HANDS}, 0.2, 0.03),
    (LEVEL, {"subset": "basic", "metric": "AP", "group": "body", "detector": BODY}, 0.7, 0.03),
    ("05b_dose_curves/doses", size(160), 0.4, 0.03),
    ("05b_dose_curves/doses", size(640), 0.6, 0.03),
    # In space.
    (IN_3D, in_space("upper", "mediapipe", ("mmpose", "alphapose", "openpose")), SIMILAR, 0.01),
    (FOUND, in_view("lower", HANDS, "mediapipe", measure="found"), 1.0, 0),
    (STEADY, in_view("lower", PARTS, "openpose", **AT_10_CM), 0.45, 0.03),
    (ODD, odd(TILT, "shoulders", "mmpose", "lower"), 0.3, 0.03),
    (ODD, odd(TILT, "shoulders", "mmpose", "upper"), 0.1, 0.03),
    (ALIKE, in_view("lower", ARMS, "openpose", **FLICKERS), 0.5, 0.03),
    (ALIKE, in_view("lower", ARMS, OTHERS, **FLICKERS), 0.2, 0.03),
    (IN_3D, in_space("lower", COMBINATIONS, ("mmpose", "alphapose")), MORE, 0.03),
    (IN_3D, in_space("upper", COMBINATIONS, ("mmpose", "alphapose")), SIMILAR, 0.01),
    # Beside motion capture, with Tables III and IV below.
    (ANY_JOINT, in_view("mocap", "any arm joint", "openpose", measure="found"), 0.4, 0.03),
    (ARM, in_view("mocap", "right arm", "openpose", measure="found", other="left arm"), MORE, 0.03),
    (MOCAP, joint(SHOULDERS, 0.1, BODY), 0.25, 0.001),
    (SEEN, joint(SHOULDERS, 0.1, BODY), 0.8, 0.01),
    (BEYOND, joint(ELBOWS, (0.3, 0.1), "detectron2") | {"threshold_m": 0.1}, 0.6, 0.02),
    # Failures.
    (LOSS, {"group": "body", "detector": "mmpose"}, -0.1, 0.03),
    (LOSS, {"group": "body", "detector": ("alphapose", "detectron2")}, -0.3, 0.03),
    (LOSS, {"group": "body", "detector": "openpose"}, -0.5, 0.03),
    (BY_PARTS, by_parts(EXCEPTIONS, "detectron2", ("mmpose", "alphapose", "openpose")), MORE, 0.03),
    (BY_PARTS, by_parts(KINDS, "mmpose", "detectron2"), MORE, 0.03),
    (ODD, odd(HIPS_IN, HIPS, "openpose"), 0.3, 0.03),
    (ODD, odd(HIPS_IN, HIPS, OTHERS), 0.02, 0.01),
    (ODD, odd(BENT, HANDS, ("mmpose", "openpose")), 0.3, 0.03),
    (ODD, odd(BENT, HANDS, "alphapose"), 0.02, 0.01),
    (REMARKS, remark(GIVEN, "mmpose"), 0.9, 0.03),
    (REMARKS, remark(GIVEN, "alphapose"), 0.3, 0.03),
    (REMARKS, remark(BORDER, "mmpose"), 0.8, 0.03),
    (REMARKS, remark(SCORE, "mmpose"), -0.3, 0.03),
    (REMARKS, remark("mean score of shoulders, less that of the other joints", "detectron2"), -0.2, 0.03),
    (REMARKS, remark("hands given without their wrist", "openpose"), 0.0, 0),
    # The robot gave way, judged by eye.
    (CLEARANCE, {"until": "until they leave", "gains": "published", "detector": "ground truth"}, 0.15, 0.02),
]  # fmt: skip

# By claim: table, labels of the rows that come out otherwise, what becomes of a number.
Turn = tuple[str, dict[str, Any], Callable[[float], float]]


def is_now(value: float) -> Callable[[float], float]:
    return lambda _: value


def times(factor: float) -> Callable[[float], float]:
    return lambda value: factor * value


SURE_PAIR = {"detector": ("mmpose", "alphapose"), "min_score": 0.3}


OPPOSITES: dict[str, list[Turn]] = {
    "basic-count": [(COUNTS, {"data set": "basic"}, is_now(1608))],
    "headless-count": [(COUNTS, {"data set": "headless"}, is_now(1624))],
    "top-down": [(AP, pair("AP", "body", name, "openpose", "headless"), is_now(LESS)) for name in OTHERS],
    "mmpose-recall": [
        (AP, pair("AR", "body", "mmpose", "detectron2", "basic"), is_now(LESS)),
        (AP, pair("AR", "hand", "mmpose", "openpose", "headless"), is_now(LESS)),
        (AP, pair("AR50", "hand", "mmpose", "alphapose"), is_now(SIMILAR)),  # higher, but not markedly
    ],
    "best-body": [
        (AP, pair("AP", "body", "mmpose", "alphapose", "headless"), is_now(SIMILAR - 0.05)),
        (AP, pair("AP", "body", "mmpose", "detectron2", "basic"), is_now(MORE)),
        (AP, pair("AP", "body", "mmpose", "alphapose", "basic"), is_now(LESS)),
    ],
    "alike-bodies": [
        (AP, pair(metric, "body", "alphapose", "detectron2", "basic"), is_now(value))
        for metric in ("AP", "AR") for value in (MORE, LESS)
    ],
    "fingers-hard": [
        (LEVEL, {"group": "hand", "detector": "alphapose"}, is_now(0.9)),
    ],
    "openpose-hands": [
        (AP, pair("AR50", "hand", "openpose", "mediapipe"), is_now(LESS)),
        (AP, pair("AP", "hand", "openpose", "alphapose"), is_now(MORE)),
    ],
    "mediapipe-hicp": [
        (AP, pair(metric, "hand", "mediapipe", "alphapose", "headless"), is_now(value))
        for metric in ("AP", "AR") for value in (MORE, LESS)
    ],
    "resolution": [("05b_dose_curves/doses", size(160), is_now(0.8))],
    "hands-3d": [
        (IN_3D, in_space("upper", "mediapipe", "mmpose"), is_now(MORE)),
        (IN_3D, in_space("upper", "mediapipe", "openpose"), is_now(LESS)),
        (FOUND, in_view("lower", "left hand", "mediapipe"), is_now(0.9)),
    ],
    "stability-fractions": [(STEADY, in_view("lower", "left wrist", "openpose"), is_now(0.9))],
    "mmpose-tilt": [(ODD, odd(TILT, "shoulders", "mmpose", "lower"), is_now(0.02))],
    "openpose-unstable": [(ALIKE, in_view("lower", "left elbow", "openpose"), is_now(0.02))],
    "wrists-best": [(MOCAP, SURE_PAIR | {"keypoint": WRISTS}, times(3))],
    "elbows-best": [(MOCAP, SURE_PAIR | {"keypoint": ELBOWS}, times(0.5))],
    "alike-mocap": [
        (MEDIAN_PAIRS, joint("left_wrist", 0.3, "alphapose") | {"other": "mmpose"}, is_now(value))
        for value in (-0.03, 0.03)
    ],
    "wrists-any": [(MOCAP, joint("left_wrist", 0.3, "openpose"), times(2))],
    "elbows-worse": [(MOCAP, joint("left_elbow", 0.3, "alphapose"), times(0.5))],
    "detectron2-elbows": [
        (BEYOND, joint("right_elbow", score, "detectron2"), is_now(0.2)) for score in (0.3, 0.1)
    ],
    "openpose-few": [(SEEN, joint("right_elbow", 0.3, "openpose"), is_now(0.9))],
    "openpose-arm": [(ANY_JOINT, {"part": "any arm joint"}, is_now(value)) for value in (0.1, 0.8)],
    "openpose-right": [(ARM, {"part": "right arm"}, is_now(LESS))],
    "threshold": [(BETWEEN, joint("left_elbow", 0.3, "mmpose"), is_now(value)) for value in (-0.02, 0.02)],
    "detectron2-scale": [(SEEN, joint("left_wrist", 0.3, "detectron2"), is_now(0.6))],
    "shoulders-worst": [(MOCAP, {"keypoint": "right_shoulder", "detector": "mmpose"}, is_now(0.03))],
    "headless-body": [(LOSS, {"detector": "alphapose"}, is_now(0.2))],
    "loses-least": [(LOSS, {"detector": "mmpose"}, is_now(-0.45))],
    "openpose-partial": [(LOSS, {"detector": "openpose"}, is_now(-0.2))],
    "order-by-parts": [
        (BY_PARTS, by_parts("only head", "detectron2", "openpose"), is_now(LESS)),
        (BY_PARTS, by_parts("only right arm", "detectron2", "mmpose"), is_now(LESS)),
        (BY_PARTS, by_parts("only left arm", "mmpose", "detectron2"), is_now(LESS)),
    ],
    "hips-abdomen": [(ODD, odd(HIPS_IN, HIPS, BODY), is_now(0.02))],
    "broken-fingers": [(ODD, odd(BENT, HANDS, BODY), is_now(0.02))],
    "mmpose-edge": [
        (REMARKS, remark(BORDER, "mmpose"), is_now(0.2)),
        (REMARKS, remark(SCORE, "mmpose"), is_now(0.2)),
    ],
    "alphapose-conservative": [
        (REMARKS, remark(GIVEN, "alphapose"), is_now(1.0)),
        (ODD, odd(BENT, HANDS, "alphapose"), is_now(0.5)),
    ],
    "detectron2-shoulders": [
        (REMARKS, remark("mean score of shoulders, less that of the other joints", "detectron2"), is_now(0.2))
    ],
    "openpose-fingers": [(REMARKS, remark("hands given without their wrist", "openpose"), is_now(0.3))],
    "clearance-5cm": [(CLEARANCE, {"gains": "published"}, is_now(0.02))],
    "clearance-10cm": [(CLEARANCE, {"gains": "published"}, is_now(0.07))],
    "best-whole-body": [
        (SEEN, joint("left_wrist", 0.3, "detectron2"), is_now(0.98)),
        (MEDIAN_PAIRS, joint("right_elbow", 0.3, "mmpose") | {"other": "openpose"}, is_now(0.02)),
    ],
    "combination": [
        (IN_3D, in_space("lower", COMBINATIONS[0], "mmpose"), is_now(LESS)),
        (IN_3D, in_space("upper", COMBINATIONS[1], "alphapose"), is_now(LESS)),
    ],
}  # fmt: skip


def _expanded(labels: dict[str, Any]) -> Iterable[dict[str, Any]]:
    columns = [value if isinstance(value, tuple) else (value,) for value in labels.values()]
    return (dict(zip(labels, values, strict=True)) for values in itertools.product(*columns))


def _rows() -> Iterable[Row]:
    yield from WORLD
    tables = read_json(DATA_DIR / "paper.json")["mocap"]
    rows = [dict(zip(tables["columns"], row, strict=True)) for row in tables["rows"]]
    for row in rows:
        labels, median_m = joint(row["keypoint"], row["min_score"], row["detector"]), row["median_cm"] / 100
        yield MOCAP, labels, median_m, 0.001
        yield SEEN, labels, row["count"] / N_FRAMES, 0.01
        for other in rows:
            same = {name for name in ("keypoint", "min_score", "detector") if row[name] == other[name]}
            difference_m = median_m - other["median_cm"] / 100
            if same == {"keypoint", "min_score"}:
                yield MEDIAN_PAIRS, labels | {"other": other["detector"]}, difference_m, 0.001
            if same == {"keypoint", "detector"} and row["min_score"] == 0.3:
                yield BETWEEN, labels | {"other": other["min_score"]}, difference_m, 0.001


def world() -> dict[str, pd.DataFrame]:
    """The paper's findings, a table by NOTEBOOK/TABLE; differences are there in both directions.

    Raises
    ------
    ValueError
        If two findings contradict each other.
    """
    found: dict[str, dict[str, dict]] = {}
    for table, labels, value, half in _rows():
        for one in _expanded(labels):
            for row, signed in _both_ways(one, value):
                numbers = zip(_values(table), (signed, signed - half, signed + half), strict=True)
                full = row | {name: number for name, number in numbers if name}
                key, rows = json.dumps(row, sort_keys=True), found.setdefault(table, {})
                if any(
                    abs(rows.setdefault(key, full)[name] - full[name]) > 1e-9
                    for name in full
                    if name not in row
                ):
                    raise ValueError(f"two findings on {table} {key}: {rows[key]} and {full}")
    tables = {table: pd.DataFrame(rows.values()) for table, rows in found.items()}
    tables[MOCAP] = tables[MOCAP].merge(tables.pop(SEEN), validate="one_to_one")
    return tables


def _values(table: str) -> tuple[str, str, str]:
    return VALUES.get(table, ("value", "low", "high"))


def _both_ways(row: dict[str, Any], value: float) -> list[tuple[dict[str, Any], float]]:
    """A difference is there in both directions, and its name with it."""
    if not isinstance(row.get("other"), str):
        return [(row, value)]
    one = "part" if row["other"].endswith("arm") else "detector"
    turned_row = row | {one: row["other"], "other": row[one]}
    return [(r | {"pair": f"{r[one]} less {r['other']}"}, v) for r, v in ((row, value), (turned_row, -value))]


def turned(tables: dict[str, pd.DataFrame], turn: Turn) -> dict[str, pd.DataFrame]:
    """The tables with one finding the other way round, its interval with it."""
    target, labels, change = turn
    name = target.partition(":")[0]
    table = tables[name].copy()
    rows = pd.Series(True, index=table.index)
    for label, value in labels.items():
        rows &= table[label].isin(value if isinstance(value, tuple) else (value,))
    assert rows.any(), f"no row of {name} has {labels}"
    columns = [column for column in _values(target) if column]
    moved = table.loc[rows, columns[0]].map(change) - table.loc[rows, columns[0]]
    for column in columns:
        table[column] = table[column].astype(float)
        table.loc[rows, column] += moved
    return tables | {name: table}


def write(folder: Path, tables: dict[str, pd.DataFrame]) -> Path:
    """As the results of a run on photographs and a recording of a lab's own."""
    for name, table in tables.items():
        path = folder / f"{name}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        table.to_parquet(path)
        stamp = {"parameters": {"source": "halpe", "recording": "a lab's own"}}
        (path.parent / "provenance.json").write_text(json.dumps(stamp))
    return folder

"""The front page: its sentences are true of whatever a run found, and of a run that lacks most of it."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pandas as pd
import pytest

from hicp_lib.core.checkout import CHECKOUT
from hicp_lib.report.prose import Results, render_page

MAIN, TOGETHER, SPACE, FAILURES = "02_evaluation_2d", "02b_combination", "04_mocap_3d", "05_failure_analysis"
ROBOT, PHOTOGRAPHS, CLAIMS = "06_hri_avoidance", "02c_photographs", "07_claims"
PLAIN, SURE = {"group": "body", "labelled": "all", "metric": "AP"}, "score of at least 0.3"
FOUND = {"group": "body", "what": "found"}
HEAD = {"subset": "headless", "part": "head", "decision": SURE, "n_found": 10}
FIGURES = {MAIN: ["same_person", "head_loss"], SPACE: ["distributions"], ROBOT: ["clearances"]}


def between(value: float | None, half: float | None = 0.05) -> dict:
    """A number with its interval, or without one."""
    known = value is not None and half is not None
    return {"value": value, "low": value - half if known else None, "high": value + half if known else None}


def loss(
    detector: str, basic: float, headless: float, half: float | None = 0.05, group: str = "body"
) -> dict:
    change = {"basic": basic, "headless": headless, "change": headless - basic, "n_people": 40}
    return {"group": group, "detector": detector, **change} | {
        name: bound for name, bound in between(headless - basic, half).items() if name != "value"
    }


class Run:
    """Results of a study that the front page can be made of."""

    def __init__(self, folder: Path):
        self.folder = folder
        for name in (MAIN, CLAIMS):
            self.values(name)
        scores = {"a": (0.9, 0.8), "mediapipe": (0.8, 0.3)}
        self.values(
            MAIN, data_note="rendered people (9 scenes)", median_time_ms={"a": 70.0, "mediapipe": 50.0}
        )
        self.table(MAIN, "head_loss_table", [loss(name, *of) for name, of in scores.items()])
        shares = {"a": 0.98, "mediapipe": 0.5}
        found = [FOUND | {"subset": "headless", "detector": d, "value": v} for d, v in shares.items()]
        self.table(MAIN, "found_and_placed", found)
        of = [(s, d, v[k]) for k, s in enumerate(("basic", "headless")) for d, v in scores.items()]
        self.table(
            MAIN, "by_definition", [PLAIN | {"subset": s, "detector": d} | between(v) for s, d, v in of]
        )
        pairs = [{"detector": "a", "other": "mediapipe", "subset": s, **PLAIN} for s in ("basic", "headless")]
        self.table(MAIN, "pairs", [pairs[0] | between(0.02), pairs[1] | between(0.5)])
        self.table(MAIN, "not_run", [{"system": name, "here": "not run"} for name in ("OpenPose", "MMPose")])
        verdicts = ["reproduced", "reproduced_on_rendered_data_only", "not_reproduced"]
        verdicts += ["undecided", "partly_tested", "not_testable_here"]
        self.values(CLAIMS, n_claims=9, **dict.fromkeys(verdicts, 1) | {"not_testable_here": 4})
        self.table(
            CLAIMS,
            "claims",
            [{"verdict": "not reproduced", "claim": "Down is up.", "tested": "Up is down.", "ours": "up 3"}],
        )

    def values(self, notebook: str, **values) -> None:
        folder = self.folder / notebook
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "values.json").write_text(json.dumps(values))
        figures = {
            name: {"file": f"{name}.webp", "caption": "C", "alt": "A"} for name in FIGURES.get(notebook, [])
        }
        (folder / "captions.json").write_text(json.dumps(figures))
        stamp = {"parameters": {"body": "a", "detectors": ["mediapipe"]}}
        (folder / "provenance.json").write_text(json.dumps(stamp))

    def table(self, notebook: str, name: str, rows: list[dict]) -> None:
        pd.DataFrame(rows).to_parquet(self.folder / notebook / f"{name}.parquet")

    def page(self) -> str:
        """The page's text on one line, references resolved."""
        text = render_page(CHECKOUT / "book" / "index.md", Results(self.folder, "quick"), "quick")
        text = re.sub(r"&#(\d+);", lambda found: chr(int(found[1])), text)
        for table in re.findall(r"(?:^|\n)\s*\n(\|.*\n.*)", text):
            assert table.partition("\n")[2].startswith("|---"), f"a row out of its table: {table}"
        return " ".join(text.split())


@pytest.fixture
def run(tmp_path) -> Run:
    return Run(tmp_path)


def test_a_run_of_one_page_says_what_it_found_and_nothing_of_the_others(run):
    page = run.page()
    assert "**Real detectors · rendered people (9 scenes)**" in page
    assert "**With the head cut off, all 2 detectors get worse, MediaPipe Pose + Hands most.**" in page
    assert "goes from 0.80 to 0.30 for MediaPipe Pose + Hands when the same 40 people" in page
    assert "from 0.90 to 0.80 for a, which loses least" in page
    assert "Without heads, a finds 98 % of people, MediaPipe Pose + Hands 50 %." in page
    assert "5 of the paper's 9 claims could be tested" in page
    assert "Not reproduced: - Down is up. Tested here: Up is down. Result: up 3." in page
    assert "**Not run:** OpenPose, MMPose; no number of theirs" in page
    for of_others in ("In space", "iCub", "invent", "hands,", "photographs of public", "near"):
        assert of_others not in page.split("## The paper's claims")[0].replace("(joints", ""), of_others


def test_the_best_for_a_task_and_who_is_not_told_apart(run):
    page = run.page()
    assert "| body, head in view | a; not told apart: MediaPipe Pose + Hands | AP 0.90 [0.85, 0.95] |" in page
    assert "| body, head cut off | a | AP 0.80 [0.75, 0.85] |" in page
    assert "| speed | MediaPipe Pose + Hands | 50 ms per image |" in page
    run.table(
        MAIN, "pairs", [{"detector": "mediapipe", "other": "a", "subset": "basic", **PLAIN} | between(-0.3)]
    )
    page = run.page()
    assert "| body, head in view | a | AP" in page, "the difference may stand the other way about"
    assert "| body, head cut off | a; not told apart: MediaPipe" in page, "without a difference it is open"


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ([loss("a", 0.9, 0.8), loss("b", 0.9, 0.89)], "1 of 2 detectors get worse, a most.**"),
        ([loss("a", 0.9, 0.8, None), loss("b", 0.9, 0.5, None)], "no detector was shown to get worse.**"),
        ([loss("a", 0.8, 0.9)], "no detector was shown to get worse.**"),
        ([loss("a", 0.9, 0.2)], "a gets worse.**"),
    ],
)
def test_a_loss_is_claimed_where_its_interval_says_so(run, rows, expected):
    run.table(MAIN, "head_loss_table", rows)
    assert f"**With the head cut off, {expected}" in run.page()


def test_three_people_without_hands_or_heads_to_cut_give_a_page(run):
    run.values(MAIN, data_note="COCO images with Halpe annotations (a.json)", median_time_ms={})
    run.table(MAIN, "head_loss_table", [loss("a", 0.9, float("nan"), None)])
    run.table(MAIN, "found_and_placed", [FOUND | {"subset": "headless", "detector": "a", "value": None}])
    run.table(MAIN, "by_definition", [PLAIN | {"subset": "basic", "detector": "a"} | between(0.5, None)])
    run.table(MAIN, "pairs", [PLAIN | {"subset": "basic", "detector": "a", "other": "b"} | between(None)])
    run.table(MAIN, "not_run", [{"system": "RTMO, YOLO-pose", "here": "not run"}])
    run.values(TOGETHER, combination="combined:a+mediapipe-hands")
    hands = {"subset": "headless", "body": "a", "AP": None, "AP_low": None, "AP_high": None}
    run.table(TOGETHER, "ingredients", [hands])
    run.table(TOGETHER, "ingredients_table", [hands | {"ratio": None, "time_ms": 9.0}])
    run.table(
        TOGETHER, "gains", [{"subset": "headless", "detector": "x", "other": "mediapipe"} | between(None)]
    )
    run.values(FAILURES, heads_cut_off=0)
    run.table(FAILURES, "false_presence", [HEAD | {"detector": "a", "n": 0} | between(None)])
    run.values(PHOTOGRAPHS, n_photographs=27)
    run.table(PHOTOGRAPHS, "agreement", [{"subset": "basic", "n_detectors": 1, "tau": None}])
    page = run.page()
    assert "**Real detectors · COCO images" in page
    assert "| body, head in view | a | AP 0.50 |" in page
    for absent in (
        "None",
        "nan",
        "With the head cut off",
        "Without heads",
        "invent",
        "For hands",
        "Not run:**",
    ):
        assert absent not in page.split("## Figures behind the findings")[0], absent


def test_hands_are_worth_two_detectors_where_the_difference_says_so(run):
    name = "combined:a+mediapipe-hands"
    run.values(TOGETHER, combination=name)
    steps = [{"subset": "headless", "body": "a", "AP": ap, "AP_low": ap, "AP_high": ap} for ap in (0.1, 0.3)]
    run.table(TOGETHER, "ingredients", steps)
    told = [{"ratio": 1.0, "time_ms": 50.0}, {"ratio": 1.25, "time_ms": 300.0}]
    run.table(TOGETHER, "ingredients_table", [step | more for step, more in zip(steps, told, strict=True)])
    gain = {"subset": "headless", "detector": name, "other": "mediapipe"}
    run.table(TOGETHER, "gains", [gain | between(0.1)])
    page = run.page()
    assert "another for the hands is better than one alone.**" in page
    assert "a + MediaPipe Hands finds 1.25 times as many hands as MediaPipe Pose + Hands alone" in page
    assert (
        "AP of hands is 0.30, a change of +0.10 [+0.05, +0.15]. It costs 300 ms per image instead of 50."
        in page
    )
    assert "| hands, head cut off | a + MediaPipe Hands | AP 0.30 [0.30, 0.30] |" in page
    for gained in (between(0.02), between(0.2, None)):
        run.table(TOGETHER, "gains", [gain | gained])
        assert "was not shown to be better than one alone.**" in run.page()


def test_invented_heads_are_told_with_the_people_they_were_counted_on(run):
    run.values(FAILURES, heads_cut_off=40)
    rows = [
        HEAD | {"detector": "a", "n": 40} | between(0.3),
        HEAD | {"detector": "b", "n": 40} | between(0.1),
    ]
    run.table(FAILURES, "false_presence", [*rows, rows[0] | {"decision": "calibrated", "value": 0.9}])
    page = run.page()
    assert "**Some detectors invent heads.** Of 40 people" in page
    assert "at least .3: a 30 % [25, 35] (120 % of the 10 it finds), b 10 % [5, 15] (40 % of" in page
    assert "where a calibrated one decides (.5), it is a 90 % [25, 35]. (" in page
    run.table(FAILURES, "false_presence", [HEAD | {"detector": "a", "n": 40} | between(0.0, 0.1)])
    assert "**No detector invented a head.**" in run.page()


def test_a_combination_has_the_head_of_its_body_detector(run):
    shares = {"a": 0.37, "mediapipe": 0.15, "combined:a+b": 0.37}
    run.values(FAILURES, heads_cut_off=19)
    run.table(
        FAILURES, "false_presence", [HEAD | {"detector": d, "n": 19} | between(v) for d, v in shares.items()]
    )
    assert run.page().count("37 %") == 1


@pytest.mark.parametrize("floor", ["3.3 to 5.0", None])
def test_in_space_stand_our_medians_the_papers_and_the_floor_where_it_is_known(run, floor):
    run.values(SPACE, data_note="2 people", floor_cm=floor)
    of = [(m, j, v) for m, v in (("paper", 0.04), ("robust", 0.02)) for j in ("left_wrist", "right_elbow")]
    rows = [{"detector": "a", "method": m, "keypoint": j, "min_score": 0.1, "median_m": v} for m, j, v in of]
    run.table(SPACE, "medians", rows)
    above = {"detector": "a", "left wrist": "0.2 [0.1, 0.7]", "right wrist": "–", "left elbow": "-0.1"}
    above |= {"right elbow": None}
    papers = above | {"detector": "openpose (paper)", "left wrist": "9.0"}
    run.table(
        SPACE, "above_floor", [above, papers] if floor else [{"needs": "truth", "here": "not available"}]
    )
    page = run.page()
    assert " · in space: 2 people**" in page
    assert "wrists are 4.0 cm off and elbows 4.0 cm**" in page
    assert "The paper reports 2.8 to 2.9 and 3.5 to 4.3 cm" in page
    assert (
        "come out 3.3 to 5.0 cm off (the *floor*). Above it, the detectors add at most 0.2 [0.1, 0.7] cm."
        in page
    ) == bool(floor)
    assert "leaves 2.0 cm at wrists and 2.0 cm at elbows" in page


def test_the_robot_is_late_where_hardly_anybody_is_kept_away(run):
    run.values(ROBOT)
    reach = {"until": "in the first reach", "gains": "ours", "n_people": 12}
    cases = {"no avoidance": (0.01, 0.0), "ground truth": (0.06, 0.4), "a": (0.03, 0.1)}
    rows = [reach | {"detector": d, "value": v, "kept_5cm": kept} for d, (v, kept) in cases.items()]
    run.table(ROBOT, "clearance", rows)
    page = run.page()
    assert " · simulated robot**" in page
    assert "**A simulated iCub gives way, mostly too late.**" in page
    assert "1.0 cm without avoidance, 3.0 cm with a and 6.0 cm with perfect keypoints" in page
    assert "With a at least 5 cm are kept for 10 % of these people, with perfect keypoints for 40 %" in page
    run.table(ROBOT, "clearance", rows[:2])
    assert "iCub" not in run.page(), "no detector looked"


def test_the_near_subset_and_photographs_are_told_where_there_are_some(run):
    run.values(MAIN, data_note="rendered", near_note="9 people, 1.0 m away", median_time_ms={})
    run.table(MAIN, "found_and_placed", [FOUND | {"subset": "near", "detector": "a", "value": 0.7}])
    run.table(MAIN, "by_definition", [PLAIN | {"subset": "near", "detector": "a"} | between(0.6)])
    run.values(PHOTOGRAPHS, n_photographs=27)
    taus = {"basic": 0.8, "headless": 1.0}
    run.table(PHOTOGRAPHS, "agreement", [{"subset": s, "n_detectors": 5, "tau": t} for s, t in taus.items()])
    page = run.page()
    assert "**From near, as a robot sees people within reach,** a finds 70 % of people (9 people," in page
    assert "| body, near | a | AP 0.60 [0.55, 0.65] |" in page
    assert "is 0.80 with heads and 1.00 without heads." in page

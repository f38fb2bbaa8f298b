"""Figures of the failure analysis and of doses: what they carry and say."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.core.images import write_png
from hicp_lib.core.keypoints import INDEX
from hicp_lib.evaluation.failures.error_kinds import KINDS
from hicp_lib.evaluation.space.flicker import flicker
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.study.plots import doses, failures
from tests.evaluation.made_people import make_annotations, make_detections

DETECTORS = ("mediapipe", "openpose-mobilenet")


def test_precision_per_class_says_which_classes_are_too_small():
    rows = [
        (name, group, detector, metric, value, value, value, n)
        for name, value, n in (("whole upper body", 0.8, 50), ("only legs", np.nan, 3))
        for group in ("body", "hand")
        for detector in DETECTORS[: 1 if group == "hand" else None]  # the other one gives no hands
        for metric in ("AP", "AP50", "AR")
    ]
    columns = ["class", "group", "detector", "metric", "value", "low", "high", "n_people"]
    figure = failures.class_precision(pd.DataFrame(rows, columns=columns), "made up")
    for axis in figure.figure.axes:
        assert [text.get_text() for text in axis.texts] == ["too few to judge"]
    labels = [label.get_text() for label in figure.figure.axes[0].get_yticklabels()]
    assert labels == ["whole upper body (50)", "only legs (3)"]
    assert [len(axis.containers) for axis in figure.figure.axes] == [2, 1]  # AP of each detector
    assert "0.80 for whole upper body" in figure.alt and "made up" in figure.caption
    assert figure.alt.endswith("than .05 for: nothing.")


def test_classes_that_no_detector_finds_are_named():
    rows = [("only legs", "body", "mediapipe", "AP", 0.01, 0, 0.02, 40)]
    columns = ["class", "group", "detector", "metric", "value", "low", "high", "n_people"]
    figure = failures.class_precision(pd.DataFrame(rows, columns=columns), "made up")
    assert figure.alt.endswith("bodies: nothing. No detector has more than .05 for: only legs.")


def test_bodies_of_a_combination_are_left_out_where_its_body_detector_is_drawn():
    names = ["posenet", "combined:posenet+mediapipe-hands", "combined:mediapipe-pose+mediapipe-hands"]
    rows = [(d, "left_hip", -0.1, -0.2, 0.0) for d in names]
    table = pd.DataFrame(rows, columns=["detector", "keypoint", "change", "low", "high"])
    figure = failures.head_change(table, "made up")
    labels = [text.get_text() for text in figure.figure.legends[0].get_texts()]
    assert labels == ["posenet", "combined:mediapipe-pose\n+mediapipe-hands"] and figure.table is table


def test_bars_of_kinds_fill_the_whole_length():
    rows = [
        (d, "body", name, kind, share, 70)
        for d in DETECTORS
        for name, share in (("no head", 1 / len(KINDS)), ("only legs", np.nan))
        for kind in KINDS
    ]
    table = pd.DataFrame(rows, columns=["detector", "group", "class", "kind", "share", "n_keypoints"])
    figure = failures.error_kinds(table, "class", "made up")
    for axis in figure.figure.axes:
        assert np.nansum([bar.get_width() for bar in axis.patches]) == pytest.approx(1)
        assert [text.get_text() for text in axis.texts] == ["too few to judge"]
    assert [text.get_text() for text in figure.figure.legends[0].get_texts()] == list(KINDS)
    assert "mediapipe jitter" not in figure.alt and "14% for no head" in figure.alt


def test_change_without_the_head_is_drawn_for_every_keypoint():
    rows = [(d, k, -0.1, -0.2, 0.0) for d in DETECTORS for k in ("left_shoulder", "left_hip")]
    table = pd.DataFrame(rows, columns=["detector", "keypoint", "change", "low", "high"])
    figure = failures.head_change(table, "made up")
    assert [x.get_text() for x in figure.figure.axes[0].get_yticklabels()] == ["left shoulder", "left hip"]
    assert "mediapipe -0.10 and openpose-mobilenet -0.10" in figure.alt


def test_an_invented_head_is_drawn_beyond_the_picture_too(tmp_path):
    points = np.full((1, 136, 2), 60.0)
    points[0, 0] = [60, -20]
    write_png(tmp_path / "images" / "1.png", np.zeros((120, 120, 3), np.uint8))
    truth = make_annotations(points, [1])
    heads = pd.DataFrame({"detector": "mediapipe", "image_id": 1, "score": [0.9, 0.7], "landed": "outside"})
    heads.loc[1, "landed"] = "inside"
    found = {("headless", "mediapipe"): {1: make_detections(points)}}
    figure = failures.invented_heads(heads, tmp_path, truth, found, "made up")
    pixels = figure.figure.axes[0].images[0].get_array()
    assert pixels.shape[:2] == (120 + 20 + 2 * 9, 120 + 2 * 9) and pixels[0, 0].min() > 200
    assert pixels[9, 69, 0] < 100 < pixels[9, 69, 2]  # mediapipe's blue on the margin
    assert "score of the head 0.80" in figure.alt and "mediapipe 50%" in figure.caption


def test_parts_given_although_outside_have_a_panel_per_decision_and_small_ones_are_left_out():
    rows = [
        ("headless", d, part, decision, share, 0.0, 0.5, n)
        for d, share in zip(DETECTORS, (0.25, 0.0), strict=True)
        for part, n in (("head", 40), ("wrist", 3))
        for decision in ("sure", "calibrated")
    ]
    columns = ["subset", "detector", "part", "decision", "value", "low", "high", "n"]
    figure = failures.false_presence(pd.DataFrame(rows, columns=columns), "made up")
    assert [axis.get_title("left") for axis in figure.figure.axes] == ["sure", "calibrated"]
    labels = [label.get_text() for label in figure.figure.axes[0].get_yticklabels()]
    assert labels == ["head, headless (40)"]
    assert [len(axis.containers) for axis in figure.figure.axes] == [2, 2]
    assert "mediapipe 25% (sure)" in figure.alt and "made up" in figure.caption


def test_scores_are_drawn_by_state():
    rows = [
        ("mediapipe", state, 0.9, value, value, value, n)
        for state, value, n in (("visible", 1, 50), ("outside", 0.1, 50), ("outside", 0.8, 3))
    ]
    table = pd.DataFrame(rows, columns=["detector", "state", "score", "value", "low", "high", "n"])
    figure = failures.scores_by_state(table, "made up")
    drawn = [y for c in figure.figure.axes[0].containers for y in c.lines[0].get_ydata()]
    assert drawn == [1, 0.1] and figure.table is table  # few keypoints are not drawn
    assert "mediapipe 0.10 at 0.90" in figure.alt


def test_dose_curves_have_a_panel_for_each_dose_and_say_the_lowest():
    rows = [
        (dose, level, "mediapipe", "body", measure, level / 2, 0, 1)
        for dose in ("light", "hidden")
        for level in (0.5, 1.0)
        for measure in ("AP", "visible keypoints hit", "hidden keypoints hit")
    ]
    columns = ["dose", "level", "detector", "group", "measure", "value", "low", "high"]
    figure = doses.dose_curves(pd.DataFrame(rows, columns=columns), "body")
    light, hidden = figure.figure.axes
    assert light.get_xscale() == "log" and hidden.get_xscale() == "linear"
    assert len(light.lines) == 1 and "mediapipe 0.25 (light 0.5)" in figure.alt
    visible = doses.dose_curves(pd.DataFrame(rows, columns=columns), "body", "visible keypoints hit")
    assert "share of visible keypoints hit" in visible.caption


def test_pictures_of_a_dose_show_what_was_detected_at_each_level(tmp_path):
    points = np.full((1, 136, 2), 30.0)
    for i in range(7):
        write_png(tmp_path / "images" / f"{i}.png", np.zeros((60, 60, 3), np.uint8))
    extras = [{"dose": "light", "level": i / 10, "source_image_id": 0} for i in range(7)]
    people = make_annotations(np.repeat(points, 7, axis=0), range(7), extras=extras)
    found = {"mediapipe": {0: make_detections(points)}, "movenet-thunder": {}}
    figure = doses.dose_pictures(people, tmp_path, found)
    shown = [axis for axis in figure.figure.axes if axis.images]
    assert [axis.get_title() for axis in shown] == ["0%", "20%", "30%", "40%", "60%"]
    assert [axis.images[0].get_array().any() for axis in shown] == [True, False, False, False, False]
    assert "mediapipe 1 and movenet-thunder 0" in figure.alt and "light, 5 pictures" in figure.alt


def test_flicker_says_the_delay_of_the_filter():
    points = np.random.default_rng(0).uniform(50, 400, (1, 136, 2))
    sure = np.full((1, 136), 0.9)
    run = [Detections(points + [20 * i, 0], sure, np.ones(1)) for i in range(30)]
    table = flicker({"mediapipe": run}, np.arange(30) / 10, draws=Draws(10))
    figure = doses.flicker_rates(table, "made up")
    lag = table[(table["measure"] == "latency [s]") & (table["tracks"] == "filtered")]["value"].iloc[0]
    assert f"{1000 * lag:.0f} ms" in figure.caption and lag > 0
    assert "mediapipe 0.0 %" in figure.alt


@pytest.mark.parametrize("named", [True, False])
def test_a_keypoint_that_is_named_is_ringed_in_every_picture(named, tmp_path):
    points = np.stack(np.meshgrid(np.arange(12), np.arange(12)), axis=-1).reshape(-1, 2)[:136] * 25.0 + 30
    subsets, wrist = ("basic", "headless"), INDEX["left_wrist"]
    truth = {subset: make_annotations(points[None], [1]) for subset in subsets}
    for subset in subsets:
        write_png(tmp_path / subset / "images" / "1.png", np.zeros((340, 340, 3), np.uint8))
    found = {(subset, "mediapipe"): {1: make_detections(points[None])} for subset in subsets}
    cases = pd.DataFrame({"detector": "mediapipe", "case": "loses it", "subset": subsets, "image_id": 1})
    if named:
        cases = cases.assign(annotation_id=1, keypoint=wrist)
    folders = {subset: tmp_path / subset for subset in subsets}
    figure = failures.gallery(cases, folders, truth, found, "made up", "subset" if named else "detector")
    u, v = points[wrist].astype(int)
    for axis in figure.figure.axes:
        assert (axis.images[0].get_array()[v, u + 20].min() > 200) == named
    assert figure.alt.endswith(" mediapipe loses it.") and figure.caption.startswith(
        "The same person" if named else "Worst cases"
    )

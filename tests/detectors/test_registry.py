"""What is on offer, and how its options are refused."""

import math
import subprocess

import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.detectors.registry import (
    DETECTORS,
    command_to_run,
    command_to_use,
    default_detector_names,
    make_detector,
)


def test_detectors_that_need_a_model_are_not_run_by_default():
    absent = set(DETECTORS) - set(default_detector_names())
    assert absent == {name for name, entry in DETECTORS.items() if entry.needs_model}
    assert {"mmpose", "alphapose", "detectron2"} <= absent


@pytest.mark.parametrize("name", sorted(set(DETECTORS) - set(default_detector_names())))
def test_without_its_model_a_detector_says_the_commands(name, tmp_path, monkeypatch):
    monkeypatch.setenv("HICP_CACHE", str(tmp_path))
    with pytest.raises(InputError, match=f"hicp detect --detector {name} --model FILE.onnx"):
        make_detector(name)
    with pytest.raises(InputError, match=command_to_use(name)):
        make_detector(name)
    assert "--model" in command_to_run(name)


@pytest.mark.parametrize("name", DETECTORS)
def test_an_unknown_option_is_refused(name):
    with pytest.raises(InputError, match="option 'colour' is not known; expected one of: "):
        make_detector(name, colour="blue", model="m.onnx")


@pytest.mark.parametrize(
    ("option", "value"),
    [("dark", "yes"), ("threads", 1.5), ("threads", True), ("score_scale", "ten"), ("boxes", 3)],
)
def test_an_option_of_another_kind_is_refused(option, value):
    with pytest.raises(InputError, match=f"option '{option}' is .*; expected") as caught:
        make_detector("mmpose", **{"model": "m.onnx", option: value})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("mediapipe-hands", {"min_score": 5}),
        ("mediapipe-hands", {"num_hands": 0}),
        ("mediapipe-hands", {"num_hands": 10**20}),
        ("mediapipe-pose", {"min_score": math.nan}),
        ("mediapipe-pose", {"tracking_hz": math.inf}),
        ("movenet-thunder", {"padding": math.nan}),
        ("movenet-thunder", {"padding": 0}),
        ("movenet-thunder", {"person_max_overlap": -0.1}),
        ("movenet-multipose", {"min_person_score": -math.inf}),
        ("posenet", {"max_people": -1}),
        ("posenet", {"threads": 10**6}),
        ("openpose-mobilenet", {"net_height_px": 16 * 10**6}),
        ("mmpose", {"model": "m.onnx", "input_size_px": [192, math.nan]}),
        ("combined:movenet-thunder+mediapipe-hands", {"min_side_px": 0}),
        ("combined:movenet-thunder+mediapipe-hands", {"hands_min_score": math.nan}),
    ],
)
def test_numbers_that_make_no_sense_are_refused_before_anything_starts(name, options, monkeypatch):
    monkeypatch.setattr(subprocess, "Popen", None)
    with pytest.raises(InputError, match=r"option '\w+' is .*; expected [\d.]+ to \d+") as error:
        make_detector(name, **options)
    assert "\n" not in str(error.value)


def test_an_unknown_detector_is_refused():
    with pytest.raises(InputError, match="expected one of: mediapipe"):
        make_detector("openpoze")


@pytest.mark.parametrize(
    ("options", "num_hands", "hands_score", "body_score"),
    [({}, 4, 0.2, 0.5), ({"hands_num_hands": 3, "hands_min_score": 0.6, "min_score": 0.4}, 3, 0.6, 0.4)],
)
def test_options_of_a_combination_go_where_they_belong(weights, options, num_hands, hands_score, body_score):
    detector = make_detector("combined:mediapipe-pose+mediapipe-hands", looks="image", **options)
    assert (detector.settings["looks"], detector.settings["min_side_px"]) == (["image"], 320)
    body, hands = detector.settings["body"], detector.settings["hands"]
    assert (hands["num_hands"], hands["min_score"], body["min_score"]) == (num_hands, hands_score, body_score)
    assert body["num_poses"] == 1 and detector.settings["arbitrate"]


@pytest.mark.parametrize(
    ("name", "match"),
    [
        ("combined:mediapipe-pose", "expected combined:BODY[+]HANDS of: mediapipe-pose"),
        ("combined:nobody+mediapipe-hands", "expected combined:BODY[+]HANDS"),
        ("combined:mediapipe-hands+mediapipe-hands", "mediapipe-hands finds no body"),
        ("combined:mediapipe-pose+mediapipe-pose", "mediapipe-pose finds no hand"),
    ],
)
def test_what_cannot_be_combined_is_refused(name, match):
    with pytest.raises(InputError, match=match):
        make_detector(name)


def test_what_each_detector_can_be_scored_on():
    both = {name for name, entry in DETECTORS.items() if entry.groups == ("body", "hand")}
    assert both == {"mediapipe", "closerange", "openpose", "mmpose", "alphapose"}
    assert DETECTORS["mediapipe-hands"].groups == ("hand",)
    assert all(entry.name == name for name, entry in DETECTORS.items())
    assert all(DETECTORS[name].groups == ("body",) for name in set(DETECTORS) - both - {"mediapipe-hands"})

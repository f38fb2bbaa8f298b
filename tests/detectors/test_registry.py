"""What is on offer, and how its options are refused."""

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
    with pytest.raises(InputError, match="has no option 'colour'"):
        make_detector(name, colour="blue", model="m.onnx")


@pytest.mark.parametrize(
    ("option", "value"),
    [("dark", "yes"), ("threads", 1.5), ("threads", True), ("score_scale", "ten"), ("boxes", 3)],
)
def test_an_option_of_another_kind_is_refused(option, value):
    with pytest.raises(InputError, match=f"option '{option}' is .*; expected") as caught:
        make_detector("mmpose", **{"model": "m.onnx", option: value})
    assert "\n" not in str(caught.value)


def test_an_unknown_detector_is_refused():
    with pytest.raises(InputError, match="expected one of: mediapipe"):
        make_detector("openpoze")

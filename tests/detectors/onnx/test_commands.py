"""The command on users' models: what is assumed is printed, mistakes are one line, results are written."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from hicp_lib.cli import main as cli
from hicp_lib.core.images import write_png
from hicp_lib.detectors.registry import make_detector
from hicp_lib.detectors.weights.user import keep_user_options, user_options, user_options_path
from hicp_lib.study.provenance import weights_sha256
from tests.detectors.onnx.onnx_models import colour_maps_model, constant_model
from tests.detectors.onnx.test_mmpose import dots


@pytest.fixture
def model(tmp_path, monkeypatch):
    monkeypatch.setenv("HICP_CACHE", str(tmp_path / "cache"))
    return str(colour_maps_model(tmp_path / "m.onnx", (192, 256), 133))


def mistake(capsys, *arguments):
    assert cli.run(list(arguments)) == 2
    error = capsys.readouterr().err
    assert error.startswith("hicp: ") and error.count("\n") == 1
    return error


def cells(table: str) -> list[list[str]]:
    return [re.split("  +", line) for line in table.splitlines()]


@pytest.mark.parametrize("name", ["mmpose", "alphapose"])
def test_what_is_assumed_is_printed(capsys, model, name):
    assert cli.run(["models", "show", "--detector", name, "--model", model, "-o", "flip_test", "true"]) == 0
    rows = cells(capsys.readouterr().out)
    assert rows[0] == ["what", "value", "why"]
    assert ["input", "192 wide, 256 high", "read from the file"] in rows
    assert any(row[:2] == ["flip test", "yes"] for row in rows)
    assert any(row[:2] == ["boxes", "image"] for row in rows)


def test_detect_with_a_model_of_ones_own(capsys, model, tmp_path):
    positions = np.array([[60.0, 70.0], [75.5, 60.25], [66.0, 88.0]])
    write_png(tmp_path / "images" / "7.png", dots(positions))
    person = constant_model(
        tmp_path / "p.onnx", (1, 3, 64, 64), {"dets": np.array([[[5, 5, 50, 48, 0.9]]], np.float32)}
    )
    out = tmp_path / "found.json"
    arguments = ["detect", "--images", str(tmp_path / "images"), "--out", str(out), "--detector", "mmpose"]
    assert cli.run([*arguments, "--model", model, "--person-model", str(person)]) == 0
    (row,) = json.loads(out.read_text())
    assert row["image_id"] == 7
    found = np.array(row["keypoints"]).reshape(136, 3)
    assert np.abs(found[:17, :2] - positions[np.arange(17) % 3]).max() < 0.5
    assert (found[17:20] == 0).all()
    assert capsys.readouterr().err.startswith("transform: classic, not UDP (ASSUMED")
    assert "--model FILE.onnx" in mistake(capsys, *arguments)
    assert "boxes 'gt'" in mistake(capsys, *arguments, "--model", model, "--boxes", "gt")
    assert "boxes 'all'" in mistake(capsys, *arguments, "--model", model, "--boxes", "all")
    assert "cuda" in mistake(capsys, *arguments, "--model", model, "-o", "provider", "cuda")
    assert "expected bool" in mistake(capsys, *arguments, "--model", model, "-o", "dark", "maybe")
    assert "/no.onnx: cannot be read" in mistake(capsys, *arguments, "--model", "/no.onnx")
    assert "option 'boxes' is not known" in mistake(
        capsys, *arguments[:-1], "detectron2", "--model", model, "--boxes", "gt"
    )


@pytest.mark.parametrize("name", ["mmpose", "alphapose", "openpose", "detectron2", "one-stage"])
def test_show_use_and_detect_refuse_the_same_networks_in_the_same_words(capsys, tmp_path, name):
    """What is wrong with a network is known before it sees an image: nothing is kept that would not run."""
    model = constant_model(tmp_path / "m.onnx", (1, 3, 64, 48), {"out": np.zeros((1, 40, 9, 9), np.float32)})
    write_png(tmp_path / "images" / "7.png", np.zeros((9, 9, 3), np.uint8))
    detect = ["detect", "--images", str(tmp_path / "images"), "--out", str(tmp_path / "found.json")]
    chosen = ["--detector", name, "--model", str(model)]
    errors = {
        mistake(capsys, *command, *chosen) for command in (["models", "show"], ["models", "use"], detect)
    }
    (error,) = errors
    assert "takes image (1, 3, 64, 48) tensor(float) and gives out (1, 40, 9, 9)" in error
    assert all(
        f" {known} (" in error for known in ("mmpose", "alphapose", "openpose", "detectron2", "one-stage")
    )


def test_a_person_model_is_looked_at_before_an_image_is_shown(capsys, model, tmp_path):
    person = constant_model(tmp_path / "p.onnx", (1, 3, 64, 64), {"out": np.zeros((1, 9, 7), np.float32)})
    show = ["models", "show", "--detector", "mmpose", "--model", model]
    assert "(1, 84, 5 + classes)" in mistake(capsys, *show, "--person-model", str(person))
    assert "leave them out" in mistake(capsys, *show, "-o", "person_min_score", "0.5")
    rows = constant_model(tmp_path / "q.onnx", (1, 3, 64, 64), {"dets": np.zeros((1, 0, 5), np.float32)})
    chosen = ["--person-model", str(rows), "-o", "person_min_score", "0.5", "-o", "person_family", "yolox"]
    assert cli.run([*show, *chosen]) == 0
    rows = cells(capsys.readouterr().out)
    assert ["person detector", "yolox", "given; option person_family"] in rows
    assert any(row[:2] == ["person score", ">= 0.5"] for row in rows)


def test_the_transform_is_printed_and_may_be_given(capsys, model):
    show = ["models", "show", "--detector", "mmpose", "--model", model]
    for options, expected in (
        ([], r"classic, not UDP +ASSUMED"),
        (["-o", "udp", "true"], "UDP: sizes minus one"),
    ):
        assert cli.run([*show, *options]) == 0
        assert re.search(f"transform +{expected}", capsys.readouterr().out)


def test_a_model_named_once_is_taken_from_then_on(capsys, model, tmp_path):
    use = ["models", "use", "--detector", "mmpose"]
    before = weights_sha256()
    assert "hicp models use --detector mmpose" in mistake(capsys, *use)
    assert "/no.onnx: cannot be read" in mistake(capsys, *use, "--model", "/no.onnx")
    assert weights_sha256() == before
    assert cli.run([*use, "--model", model, "-o", "flip_test", "true"]) == 0
    told = capsys.readouterr()
    assert "hicp report -p detectors mmpose" in told.out
    assert told.err.startswith("transform: classic, not UDP (ASSUMED") and told.err.count("\n") == 1
    assert make_detector("mmpose").settings == make_detector("mmpose", model=model, flip_test=True).settings
    # What is given at a call comes first; a model given there stands for itself.
    assert make_detector("mmpose", flip_test=False).settings["flip_test"] is False
    assert make_detector("mmpose", model=model).settings["flip_test"] is False
    assert "no model is named" in mistake(capsys, *use, "-o", "flip_test", "false")
    named = weights_sha256()
    assert set(named) - set(before) == {"mmpose"}
    assert cli.run([*use, "--model", model]) == 0
    assert weights_sha256()["mmpose"] != named["mmpose"]
    capsys.readouterr()
    assert cli.run(["models", "list"]) == 0
    assert f"yours: mmpose with model {model}" in capsys.readouterr().out


def test_files_are_kept_by_their_whole_path_however_they_were_named(model, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    keep_user_options("openpose", {"model": Path("m.onnx"), "hand_model": "m.onnx", "threads": 1})
    monkeypatch.chdir(tmp_path.parent)
    assert user_options("openpose") == {"model": model, "hand_model": model, "threads": 1}


def test_an_option_that_is_a_name_is_no_path_though_a_file_is_called_so(capsys, model, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("cpu", "gt"):
        (tmp_path / name).write_text("not meant")
    options = ["-o", "provider", "cpu", "--boxes", "gt", "-o", "person_model", "null"]
    assert cli.run(["models", "use", "--detector", "mmpose", "--model", "m.onnx", *options]) == 0
    assert user_options("mmpose") == {"model": model, "provider": "cpu", "boxes": "gt", "person_model": None}
    kept = weights_sha256()
    (tmp_path / "cpu").write_text("still not meant")
    assert weights_sha256() == kept
    (tmp_path / "m.onnx").write_bytes((tmp_path / "m.onnx").read_bytes() + b" ")
    assert weights_sha256() != kept


def test_detectors_with_weights_of_their_own_take_no_others(capsys, model):
    assert "takes none of yours" in mistake(capsys, "models", "use", "--detector", "mediapipe")
    combined = ["--detector", "combined:mmpose+mmpose", "--model", model]
    assert "name the weights of each by itself" in mistake(capsys, "models", "use", *combined)


def test_a_damaged_list_of_own_models_is_told_in_one_line(capsys, model):
    user_options_path().parent.mkdir(parents=True, exist_ok=True)
    user_options_path().write_text('["mmpose"]')
    assert "name your files again" in mistake(capsys, "models", "show", "--detector", "mmpose")

"""Commands for recordings: what they print, and their exit codes."""

from __future__ import annotations

import pytest
from PIL import Image

from hicp_lib.cli import main as cli
from tests.recordings.conftest import write_small


@pytest.fixture
def small(tmp_path):
    return write_small(tmp_path / "small")


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["simulate", "nonsense", "out"], "no scenario 'nonsense'; choose one of relative-upper"),
        (
            ["simulate", "relative-upper", "out", "--n-frames", "101"],
            "n_frames is 101; expected a whole number from 1 to 100",
        ),
        (["simulate", "mocap", "out", "--dask", "x"], "x: no Dask scheduler answers"),
        (["import", "out"], "Give either --bag FILE or --open3d DIR"),
        (["import", "out", "--open3d", "/no"], "/no/intrinsic.json: cannot be read"),
        (["import", "out", "--open3d", "/no", "--poses", "/no.txt"], "/no.txt: cannot be read"),
        (["import", "out", "--open3d", "/no", "--rate", "nan"], "nan is no finite number"),
        (["import", "out", "--open3d", "/no", "--mount", "x"], "'x' is not one of"),
        (["import", "out", "--bag", "x", "--base-frame", "a", "--joint-states"], "Give one of --poses"),
        (["import", "out", "--open3d", "/no", "--joint-states"], "--joint-states goes with --bag only"),
        (["import", "out", "--open3d", "/no", "--base-frame", "b"], "--base-frame goes with --bag only"),
        (["import", "out", "--open3d", "/no", "--color-topic", "/x"], "--color-topic goes with --bag only"),
        (["import", "out", "--open3d", "/no", "--depth-topic", "/x"], "--depth-topic goes with --bag only"),
        (["import", "out", "--bag", "x", "--rate", "5"], "--rate goes with --open3d only; leave it out"),
        (["import", "out", "--bag", "x", "--depth-scale", "7"], "--depth-scale goes with --open3d only"),
        (["camera", "out", "--poses", "x", "--joints", "-"], "Give either --poses FILE or --joints FILE"),
    ],
)
def test_mistakes_are_told_in_one_line(capsys, tmp_path, monkeypatch, arguments, expected):
    monkeypatch.chdir(tmp_path)
    assert cli.run(["record", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1 and expected in captured.err
    assert not (tmp_path / "out").exists()


def test_a_good_recording_is_told_so(capsys, small):
    assert cli.run(["record", "check", str(small)]) == 0
    assert capsys.readouterr().out == f"ok   {small}: 4 frames in 0.3 s\n"


def test_a_simulated_recording_is_one(capsys, tmp_path):
    out = tmp_path / "out"
    simulate = ["record", "simulate", "relative-lower", str(out), "--n-frames", "1", "--workers", "1"]
    assert cli.run(simulate) == 0
    assert capsys.readouterr().out == f"{out}: 1 frames\n"
    assert cli.run(["record", "check", str(out)]) == 0


def test_findings_are_told_one_a_line(capsys, small):
    (small / "depth/000001.png").unlink()
    (small / "camera.json").unlink()
    assert cli.run(["record", "check", str(small)]) == 2
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2 and all(line.startswith("FAIL ") for line in lines)


def test_notes_do_not_fail(capsys, small):
    text = (small / "depth.txt").read_text().replace("100.1", "100.15")
    (small / "depth.txt").write_text(text)
    assert cli.run(["record", "check", str(small)]) == 0
    note, ok = capsys.readouterr().out.splitlines()
    assert note.startswith("note ") and ok.startswith("ok ") and "3 frames" in ok


def test_a_method_of_lifting_is_asked_for_before_anybody_is_looked_for(capsys, small, monkeypatch):
    monkeypatch.setattr("hicp_lib.detectors.runtime.run.detect_images", None)
    arguments = ["lift", "--recording", str(small), "--detector", "mediapipe", "--out", "k.parquet"]
    assert cli.run([*arguments, "--method", "nonsense"]) == 2
    assert "'nonsense' is not one of 'robust', 'paper'" in capsys.readouterr().err


def test_lift_needs_a_recording(capsys, tmp_path):
    arguments = ["lift", "--recording", str(tmp_path), "--detector", "mediapipe", "--out", "k.parquet"]
    assert cli.run(arguments) == 2
    assert "camera.json: cannot be read" in capsys.readouterr().err


def test_lift_refuses_colour_of_another_size_before_anybody_is_looked_for(capsys, small, monkeypatch):
    monkeypatch.setattr("hicp_lib.detectors.runtime.run.detect_images", None)
    Image.new("RGB", (64, 48)).save(small / "rgb/000002.jpg")
    arguments = ["lift", "--recording", str(small), "--detector", "posenet", "--out", "k.parquet"]
    assert cli.run(arguments) == 2
    told = capsys.readouterr().err
    assert "000002.jpg: is 64 x 48 pixels; its camera says 32 x 24" in told and told.count("\n") == 1


def test_lift_tells_of_frames_left_out(capsys, small, tmp_path, monkeypatch):
    monkeypatch.setenv("HICP_CACHE", str(tmp_path / "cache"))
    poses = (small / "groundtruth.txt").read_text().splitlines(keepends=True)
    (small / "groundtruth.txt").write_text("".join(poses[:-1]))
    arguments = ["lift", "--recording", str(small), "--detector", "posenet", "--workers", "1"]
    assert cli.run([*arguments, "--out", str(tmp_path / "k.parquet")]) == 0
    told = capsys.readouterr()
    assert f"{small}/rgb.txt: 1 of 4 colour images have no depth or no pose within 0.02 s" in told.err
    assert "in 3 frames lifted" in told.out


def test_lift_opens_a_network_once(small, tmp_path, monkeypatch):
    from hicp_lib.detectors.onnx import session

    monkeypatch.setenv("HICP_CACHE", str(tmp_path / "cache"))
    opened, start = [], session.start
    monkeypatch.setattr(session, "start", lambda path, *rest: opened.append(path) or start(path, *rest))
    arguments = ["lift", "--recording", str(small), "--detector", "posenet", "--workers", "1"]
    assert cli.run([*arguments, "--out", str(tmp_path / "k.parquet")]) == 0
    assert len(opened) == 1

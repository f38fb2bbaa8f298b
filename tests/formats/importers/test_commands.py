"""`hicp import` and `hicp export`, from a tool's files to an evaluation and out again."""

import json
from pathlib import Path

import pytest

from hicp_lib.cli import main as cli

EXAMPLES = Path(__file__).parents[3] / "data" / "examples" / "native"
ANNOTATIONS = ["--annotations", str(EXAMPLES / "annotations.json")]


def run(capsys, *arguments) -> str:
    assert cli.run([str(argument) for argument in arguments]) == 0
    return capsys.readouterr().out


def mistake(capsys, *arguments) -> str:
    assert cli.run([str(argument) for argument in arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.startswith("hicp: ") and captured.err.count("\n") == 1
    return captured.err


def importing(kind: str, out: Path, *more) -> list:
    return ["import", "--format", kind, "--predictions", EXAMPLES / kind, *ANNOTATIONS, "--out", out, *more]


@pytest.mark.parametrize("kind", ["openpose", "alphapose", "mmpose", "detectron2", "coco"])
def test_import_evaluate_export(capsys, tmp_path, kind):
    detections = tmp_path / "d.json"
    scale = ["--score-scale", 10] if kind == "mmpose" else []
    assert f"{kind}: 3 people in 2 of 3 images" in run(capsys, *importing(kind, detections, *scale))
    evaluated = run(capsys, "evaluate", *ANNOTATIONS, "--detections", detections, "--json")
    assert json.loads(evaluated)["metrics"]["AP50"]["value"] == pytest.approx(1)
    exported = tmp_path / "coco.json"
    export = ["export", "--detections", detections, "--out", exported]
    assert "3 people" in run(capsys, *export, "--format", "coco", "--layout", "coco17")
    assert {len(row["keypoints"]) for row in json.loads(exported.read_text())} == {51}
    run(capsys, *export, "--format", "fiftyone", *ANNOTATIONS)
    assert len(json.loads(exported.read_text())["images"]) == 3


def test_the_summary_as_json(capsys, tmp_path):
    arguments = importing("mmpose", tmp_path / "d.json", "--score-scale", 20, "--json")
    summary = json.loads(run(capsys, *arguments))
    assert summary["score_scale"] == 20 and summary["unmatched"] == ["elsewhere_000004"]


def test_mistakes(capsys, tmp_path):
    out = tmp_path / "d.json"
    wrong = ["import", "--format", "mmpose", "--predictions", EXAMPLES / "coco", *ANNOTATIONS, "--out", out]
    assert "results.json: instances[0]: has no 'keypoint_scores'" in mistake(capsys, *wrong)
    assert "format 'x' is not known" in mistake(capsys, *importing("coco", out)[:2], "x", *wrong[3:])
    assert "'--score-scale': -1.0 is not in the range" in mistake(
        capsys, *importing("mmpose", out, "--score-scale", -1)
    )
    assert not out.exists()
    run(capsys, *importing("coco", out))
    export = ["export", "--detections", out, "--out", tmp_path / "e.json", "--format", "fiftyone"]
    assert "needs the annotations" in mistake(capsys, *export)


def test_an_import_tells_what_is_doubtful_in_the_annotations(capsys, tmp_path):
    annotations = json.loads((EXAMPLES / "annotations.json").read_text())
    annotations["categories"].append({"id": 2, "name": "dog"})
    annotations["annotations"].append({"id": 99, "category_id": 2})
    (tmp_path / "a.json").write_text(json.dumps(annotations))
    arguments = importing("coco", tmp_path / "d.json")
    arguments[arguments.index("--annotations") + 1] = tmp_path / "a.json"
    assert cli.run([str(argument) for argument in arguments]) == 0
    assert "a.json: 1 objects of other categories left out" in capsys.readouterr().err

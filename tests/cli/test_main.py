"""The command: exit codes, one line for every mistake, and no library loaded before it is needed."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from contextlib import nullcontext

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from hicp_lib.cli import main as cli
from hicp_lib.core.keypoints import NAMES


def mistake(capsys, *arguments: str) -> str:
    """The line a mistake is told in."""
    assert cli.run(list(arguments)) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("hicp: ")
    assert captured.err.count("\n") == 1
    return captured.err


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["nonsense"], "No such command 'nonsense'"),
        (["report", "--nonsense"], "No such option"),
        (["report", "-p", "seed"], "requires 2 arguments"),
        (["report", "--profile", "slow"], "profile 'slow' is not known; expected one of:"),
        (["report", "--dask", "somewhere"], "somewhere: no Dask scheduler answers"),
        (["scenes", "render", "out", "--workers", "2", "--dask", ""], "Give either --workers N or --dask"),
        (["scenes", "render", "out", "--dask", ""], ": no Dask scheduler answers (no address)"),
        (["report", "-p", "sed", "1"], "-p: parameter 'sed' is not known; expected one of:"),
        (["detect", "--out", "x.json"], "Missing option '--detector'"),
        (["detect", "--detector", "x", "--out", "x.json"], "Give either --dataset DIR or --images DIR"),
        (
            ["detect", "--detector", "x", "--images", "/nowhere", "--out", "x.json"],
            "/nowhere: is not a folder",
        ),
        (
            ["detect", "--detector", "x", "--images", ".", "--out", "x.xml"],
            "ends in '.xml'; expected .json, .csv",
        ),
        (
            ["detect", "--detector", "x", "--images", ".", "--out", "x"],
            "x: ends in 'no suffix'; expected .json",
        ),
        (["scenes", "render", "out", "--n", "0"], "0 is not in the range x>=1"),
        (["scenes", "render", "out", "--workers", "1000000"], "1000000 is not in the range 1<=x<=1024"),
        (["draw", "--min-score", "nan"], "nan is no finite number"),
        (["import", "--score-scale", "1e999"], "1e999 is no finite number"),
        (["import", "--score-scale", "-1"], "-1.0 is not in the range x>0"),
        (["record", "import", "a", "b", "--rate", "inf"], "inf is no finite number"),
        (["record", "camera", "out", "--seconds", "nan"], "nan is no finite number"),
        (
            ["models", "show", "--detector", "posenet", *["-o", "padding", "1"] * 2],
            "option 'padding' of the detector is given twice; give it once",
        ),
        (
            ["models", "show", "--detector", "x", "--boxes", "detected", "-o", "boxes", "image"],
            "option 'boxes' of the detector is given twice; give it once",
        ),
        (
            ["models", "show", "--detector", "posenet", "-o", "min_root_score", "NaN"],
            "is nan; expected 0 to 1",
        ),
        (["evaluate", "--annotations", "/no.json", "--detections", "x"], "/no.json: cannot be read"),
        (["dataset", "create", "--annotations", "/no.json", "--images", ".", "--out", "x"], "/no.json: "),
        (["models", "fetch", "nonsense"], "'nonsense'"),
    ],
)
def test_mistakes_are_told_in_one_line(capsys, arguments, expected):
    assert expected in mistake(capsys, *arguments)


def test_an_unknown_detector_lists_those_there_are(capsys, tmp_path):
    (tmp_path / "a.png").write_bytes(b"")
    arguments = ["detect", "--detector", "x", "--images", str(tmp_path), "--out", str(tmp_path / "d.json")]
    assert "mediapipe" in mistake(capsys, *arguments)


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (OSError(28, "No space left on device", "/results/x"), "/results/x: No space left on device; check"),
        (OSError(28, "No space left on device"), "No space left on device; check the path"),
        (MemoryError(), "the memory is not enough"),
    ],
)
def test_what_there_is_no_room_for_is_told_in_one_line(capsys, monkeypatch, error, told):
    import hicp_lib.report.build

    def full(*arguments, **keywords):
        raise error

    monkeypatch.setattr(hicp_lib.report.build, "make_report", full)
    assert told in mistake(capsys, "report")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no device that is always full")
def test_a_full_output_is_told_in_one_line():
    command = [sys.executable, "-c", "from hicp_lib.cli.main import main; main()", "--version"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and "No space left" in done.stderr


@pytest.mark.parametrize("name", ["a\x1b[2J", "a\nhicp: well", "a\rb", "a\u202eb", "\x9b31m", "\udcff"])
def test_what_a_terminal_obeys_is_shown(capsys, name):
    told = mistake(capsys, "evaluate", "--annotations", f"/no/{name}", "--detections", "x")
    assert told[:-1].isprintable() and name.encode("unicode_escape").decode() in told


def test_what_a_terminal_obeys_is_shown_in_results_too(capsys, tmp_path):
    (tmp_path / "a\x07b\rc").mkdir()
    assert cli.run(["record", "check", str(tmp_path / "a\x07b\rc")]) == 2
    printed = capsys.readouterr().out
    assert "a\\x07b\\rc" in printed and "\x07" not in printed and "\r" not in printed


def test_what_a_command_reads_is_not_written_over(capsys, tmp_path, two_images):
    _, _, truth, _, found = two_images
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    export = ["export", "--format", "fiftyone", "--annotations", truth, "--detections", found]
    for out in (truth, found, str(tmp_path / "." / "annotations.json")):
        for arguments in ([*export, "--out", out], ["export", "--out", out, *export[1:]]):
            assert "is read by this command; give another name" in mistake(capsys, *arguments)
    detect = ["detect", "--detector", "posenet", "--dataset", str(tmp_path), "--out", truth]
    assert "is read by this command" in mistake(capsys, *detect)
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_failed_notebook_is_another_exit_code(capsys, monkeypatch):
    import hicp_lib.report.build
    from hicp_lib.report.run import RunError

    def fail(*arguments, **keywords):
        raise RunError("05_tiny: In [3] failed")

    monkeypatch.setattr(hicp_lib.report.build, "make_report", fail)
    assert cli.run(["report"]) == 1
    assert capsys.readouterr().err == "hicp: 05_tiny: In [3] failed\n"


def test_a_cluster_is_where_notebooks_look_for_it(monkeypatch):
    import hicp_lib.core.cluster
    import hicp_lib.report.build

    asked: list = []
    monkeypatch.setenv("HICP_DASK", "")  # as it was, afterwards
    monkeypatch.setattr(hicp_lib.core.cluster, "connected", lambda at: nullcontext(asked.append(at)))
    monkeypatch.setattr(
        hicp_lib.report.build, "make_report", lambda *_: asked.append(os.environ["HICP_DASK"])
    )
    assert cli.run(["report", "--dask", "tcp://a:1"]) == 0
    monkeypatch.setenv("HICP_DASK", "tcp://b:2")
    assert cli.run(["report"]) == 0
    assert asked == ["tcp://a:1", "tcp://a:1", "tcp://b:2", "tcp://b:2"]


@pytest.mark.parametrize("arguments", [["--help"], ["report", "--help"], ["models", "--help"]])
def test_help_is_no_mistake(capsys, arguments):
    assert cli.run(arguments) == 0
    assert "Usage: hicp" in capsys.readouterr().out


def test_help_loads_no_library():
    code = (
        "import sys; from hicp_lib.cli import main as cli; cli.run(['--help']); "
        "print(sorted({'numpy', 'pandas', 'cv2', 'matplotlib', 'papermill'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_weights_are_listed(capsys):
    assert cli.run(["models", "list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any("pose_landmark" in line and "Apache-2.0" in line for line in lines)


def test_evaluation_of_perfect_detections(capsys, tmp_path):
    keypoints = [value for i in range(136) for value in (100 + i, 50 + 2 * i, 2)]
    person = {"category_id": 1, "iscrowd": 0, "keypoints": keypoints}
    person |= {"bbox": [90, 40, 160, 300], "area": 30000, "num_keypoints": 136}
    image = {"width": 400, "height": 400}
    truth, found = tmp_path / "annotations.json", tmp_path / "detections.json"

    def write(n: int) -> None:
        images = [image | {"id": i, "file_name": f"{i}.jpg"} for i in range(n)]
        people = [person | {"id": i, "image_id": i} for i in range(n)]
        results = [{"image_id": i, "category_id": 1, "keypoints": keypoints, "score": 0.9} for i in range(n)]
        truth.write_text(json.dumps({"images": images, "annotations": people, "categories": [{"id": 1}]}))
        found.write_text(json.dumps(results))

    write(12)
    arguments = ["evaluate", "--annotations", str(truth), "--detections", str(found), "--group", "hand"]
    assert cli.run([*arguments, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    exact = {"value": 1.0, "low": 0.025 ** (1 / 12), "high": 1.0}  # 12 people
    assert printed["metrics"]["AP"] == pytest.approx(exact)
    assert printed["n_people"] == 12
    assert cli.run(arguments) == 0
    printed = capsys.readouterr().out
    assert "24 in 12 images" in printed and printed.count("AP    1.000  [0.735, 1.000]") == 2
    assert "group" in mistake(capsys, *arguments[:-1], "feet")

    found.write_text("[]")
    assert cli.run(arguments) == 0
    printed = capsys.readouterr().out
    assert f"{found}: an empty list: nobody was found in any image" in printed
    assert "AP    0.000  [0.000, 0.265]" in printed

    write(9)
    assert cli.run(arguments) == 0
    printed = capsys.readouterr().out
    assert "no intervals: they ask for 10 source images" in printed and "AP    1.000\n" in printed
    assert cli.run([*arguments, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["metrics"]["AP"] == {"value": 1.0, "low": None, "high": None}


@pytest.mark.parametrize(("area", "told"), [(0, True), (1, True), (1019, True), (1020, False)])
def test_areas_that_stand_for_none_are_told(capsys, tmp_path, area, told):
    """Nobody would know why every AP is 0: the allowance of OKS is a share of the area."""
    keypoints = [value for i in range(17) for value in (110 + 10 * i, 80 + 25 * i, 2)]
    person = {"id": 1, "image_id": 1, "category_id": 1, "iscrowd": 0, "keypoints": keypoints}
    person |= {"bbox": [100, 50, 200, 510], "area": area, "num_keypoints": 17}
    image = {"id": 1, "file_name": "1.jpg", "width": 400, "height": 600}
    shifted = [value + (k % 3 < 2) for k, value in enumerate(keypoints)]
    results = [{"image_id": 1, "category_id": 1, "keypoints": shifted, "score": 0.9}]
    category = {"id": 1, "name": "person", "keypoints": NAMES[:17]}
    truth, found = tmp_path / "annotations.json", tmp_path / "detections.json"
    truth.write_text(json.dumps({"images": [image], "annotations": [person], "categories": [category]}))
    found.write_text(json.dumps(results))
    arguments = ["evaluate", "--annotations", str(truth), "--detections", str(found)]
    for options in ([], ["--json"]):
        assert cli.run([*arguments, *options]) == 0
        assert ("the area of 1 of 1 people is below" in capsys.readouterr().err) == told
    assert cli.run([*arguments, "--area", "box"]) == 0
    of_box = capsys.readouterr()
    assert "AP    1.000" in of_box.out and not of_box.err


@pytest.mark.parametrize(("of", "who"), [("annotations", "annotations"), ("results", "detections")])
def test_a_group_that_nobody_has_is_given_no_figures(capsys, tmp_path, of, who):
    points = [value for i in range(136) for value in (100 + i, 50 + 2 * i, 2)]
    body = [value if i < 3 * 17 else 0 for i, value in enumerate(points)]
    person = {"id": 1, "image_id": 1, "category_id": 1, "bbox": [90, 40, 160, 300], "area": 30000}
    person["keypoints"] = body if of == "annotations" else points
    result = {"image_id": 1, "category_id": 1, "score": 1, "keypoints": body if of == "results" else points}
    image = {"id": 1, "file_name": "1.jpg", "width": 400, "height": 400}
    truth, found = tmp_path / "a.json", tmp_path / "d.json"
    truth.write_text(json.dumps({"images": [image], "annotations": [person]}))
    found.write_text(json.dumps([result]))
    arguments = ["evaluate", "--annotations", str(truth), "--detections", str(found), "--group"]
    assert cli.run([*arguments, "hand"]) == 0
    printed = capsys.readouterr().out
    assert f"the {who} give no hands" in printed and "AP " not in printed
    assert cli.run([*arguments, "hand", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["metrics"]["AP"]["value"] is None
    assert cli.run([*arguments, "body"]) == 0
    assert "AP    1.000" in capsys.readouterr().out


@pytest.fixture
def two_images(tmp_path) -> list[str]:
    """Somebody found to the pixel, and somebody whose body is missed; their hands are not labelled."""
    points = np.stack([100 + np.arange(136.0), 50 + 2 * np.arange(136.0), np.full(136, 2.0)], axis=1)
    points[94:] = 0
    person = {"category_id": 1, "iscrowd": 0, "bbox": [90, 40, 160, 300], "area": 30000}
    images = [{"id": i, "file_name": f"{i}.jpg", "width": 400, "height": 400} for i in (1, 2)]
    people = [person | {"id": i, "image_id": i, "keypoints": points.ravel().tolist()} for i in (1, 2)]
    found = [points, points + [200, 0, 0]]
    results = [
        {"image_id": i, "category_id": 1, "score": 0.9, "keypoints": of.ravel().tolist()}
        for i, of in enumerate(found, 1)
    ]
    truth, detections = tmp_path / "annotations.json", tmp_path / "detections.json"
    truth.write_text(json.dumps({"images": images, "annotations": people, "categories": [{"id": 1}]}))
    detections.write_text(json.dumps(results))
    return ["evaluate", "--annotations", str(truth), "--detections", str(detections)]


def test_body_and_hands_are_evaluated_at_once(capsys, two_images):
    assert cli.run([*two_images, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    groups = [row["group"] for row in (printed, *printed["other_definitions"])]
    assert groups == ["body", "hand", "each hand"]
    assert printed["metrics"]["AR"]["value"] == 0.5
    assert all(row["AP"] is None for row in printed["other_definitions"])
    assert cli.run(two_images) == 0
    printed = capsys.readouterr().out
    assert "AR    0.500" in printed and printed.count("AP ") == 1
    assert printed.count("the annotations give no hands") == 1
    assert cli.run([*two_images, "--group", "hand", "--by-image", "--json"]) == 0
    assert "by_image" not in json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("suffix", [".json", ".csv", ".parquet"])
def test_evaluation_is_written_as_its_suffix_says(capsys, tmp_path, two_images, suffix):
    out = tmp_path / f"ap{suffix}"
    assert cli.run([*two_images, "--out", str(out), "--by-image", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    least = [(row["image_id"], row["file_name"], round(row["oks_least"], 2)) for row in printed["by_image"]]
    assert least[1] == (1, "1.jpg", 1.0) and least[0][:2] == (2, "2.jpg") and least[0][2] < 0.1
    if suffix == ".json":
        assert json.loads(out.read_text()) == printed
        return
    read = pd.read_csv if suffix == ".csv" else pd.read_parquet
    table, by_image = read(out), read(tmp_path / f"ap.by_image{suffix}")
    body = table[table["group"] == "body"].set_index("metric")
    assert body["value"].to_dict() == {name: of["value"] for name, of in printed["metrics"].items()}
    assert (body["n_people"] == 2).all() and (body["area"] == "segment").all()
    assert table.loc[table["group"] == "hand", "value"].isna().all()
    assert by_image["oks"].tolist() == [row["oks"] for row in printed["by_image"]]
    assert cli.run([*two_images, "--by-image"]) == 0
    assert "2.jpg" in capsys.readouterr().out.splitlines()[-2]


def test_an_evaluation_in_no_known_format_is_refused_first(capsys):
    asked = ("evaluate", "--annotations", "/no.json", "--detections", "x", "--out", "ap.xlsx")
    assert "ap.xlsx: ends in '.xlsx'; expected .json, .csv, .parquet" in mistake(capsys, *asked)


def test_evaluation_tells_visible_keypoints_and_each_hand(capsys, tmp_path):
    """The left hand is occluded and not found: half of the hands, and all of what can be seen."""
    flags = np.full(136, 2)
    flags[94:115] = 1
    points = np.stack([100 + np.arange(136.0), 50 + 2 * np.arange(136.0), flags], axis=1)
    given = np.where((flags == 2)[:, None], points, 0)
    person = {"category_id": 1, "iscrowd": 0, "bbox": [90, 40, 160, 300], "area": 30000, "num_keypoints": 136}
    people = [person | {"id": i, "image_id": i, "keypoints": points.ravel().tolist()} for i in range(12)]
    images = [{"id": i, "file_name": f"{i}.jpg", "width": 400, "height": 400} for i in range(12)]
    results = [
        {"image_id": i, "category_id": 1, "score": 0.9, "keypoints": given.ravel().tolist()}
        for i in range(12)
    ]
    truth, found = tmp_path / "annotations.json", tmp_path / "detections.json"
    truth.write_text(json.dumps({"images": images, "annotations": people, "categories": [{"id": 1}]}))
    found.write_text(json.dumps(results))
    arguments = ["evaluate", "--annotations", str(truth), "--detections", str(found), "--group", "hand"]
    assert cli.run([*arguments, "--json"]) == 0
    usual = json.loads(capsys.readouterr().out)
    tables = [usual, *usual["other_definitions"]]
    recall = {
        (t["group"], t["labelled"], t["sigmas"], t["n_people"]): t["metrics"]["AR"]["value"] for t in tables
    }
    assert recall == {
        ("hand", "all", "halpe", 12): 0.1, ("hand", "visible", "halpe", 12): 1.0,
        ("each hand", "all", "wholebody", 24): 0.5, ("each hand", "visible", "wholebody", 12): 1.0,
    }  # fmt: skip
    assert cli.run(arguments) == 0
    said = capsys.readouterr().out
    assert "each hand, visible keypoints: 12 in 12 images; wholebody sigmas, segment area" in said


def test_what_c_libraries_say_of_damaged_pictures_is_not_shown(tmp_path):
    """libpng and libjpeg write to standard error themselves."""
    for name, at in (("a.png", 300), ("b.jpg", 700)):
        content = io.BytesIO()
        noise = np.random.default_rng(1).integers(0, 255, (40, 60, 3)).astype(np.uint8)
        Image.fromarray(noise).save(content, {"a": "PNG", "b": "JPEG"}[name[0]])
        damaged = bytearray(content.getvalue())
        damaged[at : at + 40] = bytes(40)
        (tmp_path / name).write_bytes(damaged)
    options = ["--detector", "movenet-lightning", "--images", ".", "--out", "found.json", "--workers", "1"]
    program = [sys.executable, "-c", "from hicp_lib.cli.main import main; main()"]
    done = subprocess.run([*program, "detect", *options], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout.startswith("found.json: ")
    assert done.stderr == "./a.png: is not an image (PNG, JPEG, ...) or is cut off; replace the file\n"

"""Every kind of file is named for what it is, with what is in it and missing; what is none is refused."""

import json

import pytest

from hicp_lib.cli.main import run
from tests.inspection import made_annotations, made_detections, made_pictures, made_recordings
from tests.inspection.cases import CASES, EXAMPLES
from tests.inspection.made_detections import FOUND, write_coco
from tests.inspection.made_pictures import png

MADE = (made_annotations, made_detections, made_recordings, made_pictures)  # which register their cases
REFUSED = {
    "empty": (b"", "is empty"),
    "blank": (b" \n\n", "is empty"),
    "noise": (bytes(range(128, 256)) + b"\0" * 20, "is of no kind that is known"),
    "prose": (b"Dear reader,\nthis is no data.\n", "of no kind that is known"),
    "cut JSON": (b'{"images": [], "annotations": [', "not JSON"),
    "other JSON": (b'{"a": 1}', "of no kind that is known"),
    "a list of numbers": (b"[1, 2]", "of no kind that is known"),
    "a list of objects": (b'[{"a": 1}]', "of no kind that is known"),
    "other table": (b"a,b\n1,2\n", "of no kind that is known"),
}


def test_there_are_enough_of_them():
    assert len(CASES) >= 60 and len({case.kind for case in CASES.values()}) >= 20


@pytest.mark.parametrize("name", CASES)
def test_it_is_told_what_a_file_is(name, tmp_path, capsys):
    case = CASES[name]
    path = case.make(tmp_path)
    assert run(["inspect", str(path), "--json"]) == (2 if case.problem else 0)
    facts = json.loads(capsys.readouterr().out)
    assert facts["kind"] == case.kind
    for what, part in case.says.items():
        assert part in facts["says"][what]
    assert len(facts["notes"]) == len(case.notes), facts["notes"]
    for part, note in zip(case.notes, facts["notes"], strict=True):
        assert part in note
    assert facts["needs"].keys() == case.needs.keys()
    for command, part in case.needs.items():
        assert part in facts["needs"][command]
    assert case.problem in facts["problem"] and bool(facts["problem"]) == bool(case.problem)
    assert str(tmp_path) in facts["path"] and "\n" not in facts["problem"]


@pytest.mark.parametrize("name", ["mpii_with_all", "coco_results", "open3d_folder", "ros1_bag"])
def test_lines_are_ten_at_most(name, tmp_path, capsys):
    case = CASES["annotations_mpii16" if name == "mpii_with_all" else name]
    path = case.make(tmp_path)
    if name == "mpii_with_all":
        text = path.read_text().replace('"area": 70000', '"area": 0').replace('"width": 640', '"width": 360')
        path.write_text(text)
    assert run(["inspect", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= 10 and lines[0] == f"{path}: {case.kind}"
    assert ("more notes, which --json shows" in "".join(lines)) == (name == "mpii_with_all")
    assert lines[-1].startswith("for hicp")


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_none_of_them_is_refused_in_one_line(name, tmp_path, capsys):
    content, expected = REFUSED[name]
    (tmp_path / "rgb.txt").write_bytes(content)
    assert run(["inspect", str(tmp_path / "rgb.txt")]) == 2
    told = capsys.readouterr()
    assert not told.out and told.err.count("\n") == 1 and expected in told.err and "rgb.txt" in told.err


def test_nothing_and_folders_of_nothing_known_are_refused(tmp_path, capsys):
    assert run(["inspect", str(tmp_path / "nowhere")]) == 2
    assert "check the path" in capsys.readouterr().err
    assert run(["inspect", str(tmp_path)]) == 2
    write_coco(tmp_path / "a.json", FOUND, {"a_1.jpg": 1, "b_2.jpg": 2})
    write_coco(tmp_path / "b.json", FOUND, {"a_1.jpg": 1, "b_2.jpg": 2})
    assert run(["inspect", str(tmp_path)]) == 2  # which of the two is meant?
    assert "of no kind that is known" in capsys.readouterr().err


def test_what_is_cut_off_is_never_taken_for_whole(tmp_path, capsys):
    content = png(tmp_path).read_bytes()
    for n in range(9, len(content) - 12, 397):
        (tmp_path / "x.png").write_bytes(content[:n])
        assert run(["inspect", str(tmp_path / "x.png")]) == 2
    assert "cannot be used" in capsys.readouterr().out


@pytest.mark.parametrize("tool", ["alphapose", "coco", "detectron2", "mmpose", "openpose"])
def test_examples_of_other_tools_are_told_apart(tool, capsys):
    assert run(["inspect", str(EXAMPLES / tool), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["needs"]["hicp import"].startswith(f"--format {tool}")
    assert facts["says"]["people"].startswith("4 in 3 of")

"""Detections over pictures: worst first, in one file that needs no other, and nothing in it is run."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from hicp_lib.cli.main import run
from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.images import read_image, write_png
from hicp_lib.formats.annotations import ImageInfo, write_annotations
from hicp_lib.formats.detections import write_detections
from hicp_lib.inspection.gallery import MAX_SIDE_PX, image_paths, pictures, write_page, write_pngs
from tests.evaluation.made_people import make_annotations

OFF_PX = {1: 0.0, 2: 40.0, 3: 12.0}  # how far the detections of each image are off
NAMES = {1: "a.png", 2: "b.png", 3: "<script>c.png"}


@pytest.fixture
def folder(tmp_path):
    """Three pictures of one person each, with annotations and detections."""
    rng = np.random.default_rng(0)
    points_px = rng.uniform(20, 180, (136, 2))
    images = {i: ImageInfo(i, name, 200, 200) for i, name in NAMES.items()}
    people = replace(make_annotations([points_px] * 3, list(NAMES)), images=images)
    write_annotations(tmp_path / "annotations.json", people)
    body = np.where(np.arange(136)[:, None] < 17, points_px, np.nan)
    scores = np.where(np.arange(136) < 17, 0.9, 0.0)
    found = {i: Detections((body + off)[None], scores[None], [0.5]) for i, off in OFF_PX.items()}
    write_detections(tmp_path / "detections.json", found)
    for name in NAMES.values():
        write_png(tmp_path / "images" / name, np.full((200, 200, 3), 90, np.uint8))
    return tmp_path


def draw(folder, *more) -> int:
    named = ["--detections", folder / "detections.json", "--images", folder / "images", *more]
    return run(["draw", *map(str, named)])


def content(page) -> dict:
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)[1])


def test_a_page_shows_the_worst_first_and_holds_all_it_needs(folder, capsys):
    out = folder / "page.html"
    assert draw(folder, "--annotations", folder / "annotations.json", "--out", out) == 0
    page = out.read_text()
    shown = content(page)["pictures"]
    assert [picture["name"] for picture in shown] == [NAMES[2], NAMES[3], NAMES[1]]
    assert shown[-1]["line"] == "1 annotated, 1 found; OKS body 1.00"  # hands are not the detector's
    assert shown[0]["found"][0][0][3] == 0.9
    assert not re.search(r"(?:src|href)=[\"']?(?!data:)", page.split("<script>")[0])
    assert "<script>c.png" not in page


def test_without_annotations_names_come_from_beside_the_detections(folder):
    assert draw(folder, "--out", folder / "page.html") == 2  # nothing says which picture image 1 is
    names = [{"id": i, "file_name": name} for i, name in NAMES.items()]
    (folder / "detections.json.images.json").write_text(json.dumps(names))
    assert draw(folder, "--out", folder / "page.html", "--limit", 2) == 0
    page = content((folder / "page.html").read_text())
    assert len(page["pictures"]) == 2 and not page["has_truth"] and page["pictures"][0]["truth"] == []


def test_names_in_the_file_count_and_a_list_of_others_is_refused(folder, capsys):
    rows = json.loads((folder / "detections.json").read_text())
    named = [row | {"file_name": NAMES[row["image_id"]], "id": 3} for row in rows]
    (folder / "detections.json").write_text(json.dumps(named))
    beside = folder / "detections.json.images.json"
    (folder / "detections.images.json").write_text('[{"id": 1, "file_name": "b.png"}]')  # of another file
    assert draw(folder, "--out", folder / "page.html") == 0
    shown = content((folder / "page.html").read_text())["pictures"]
    assert {picture["name"] for picture in shown} == set(NAMES.values())
    for text, problem in {
        '[{"id": 1, "file_name": "b.png"}]': "image 1 may be 'a.png' or 'b.png'; remove it if it is not the",
        "3": "images is 3; expected a list",
    }.items():
        beside.write_text(text)
        assert draw(folder, "--out", folder / "page.html") == 2
        assert f"{beside}: {problem}" in capsys.readouterr().err
    write_detections(folder / "detections.json", {})  # other results: the list goes with the earlier ones
    assert not beside.exists()


def test_an_id_of_two_pictures_is_refused(folder, capsys):
    rows = json.loads((folder / "detections.json").read_text())
    doubled = [row | {"file_name": name, "image_id": 1} for row in rows for name in ("a.png", "b.png")]
    (folder / "doubled.json").write_text(json.dumps(doubled))
    out = ["--images", str(folder / "images"), "--out", str(folder / "page.html")]
    assert run(["draw", "--detections", str(folder / "doubled.json"), *out]) == 2
    assert "doubled.json: image 1 may be 'a.png' or 'b.png'; give --annotations" in capsys.readouterr().err
    for name in ("1.png", "2.png", "3.png", "003.txt"):
        (folder / "images" / name).write_bytes((folder / "images" / "a.png").read_bytes())
    assert draw(folder, "--out", folder / "page.html") == 0  # by numbers; other files are no pictures
    (folder / "images" / "001.png").write_bytes(b"")
    assert draw(folder, "--out", folder / "page.html") == 2
    assert "images: image 1 may be '001.png' or '1.png'" in capsys.readouterr().err


def test_png_files_are_drawn_and_numbered(folder):
    assert draw(folder, "--annotations", folder / "annotations.json", "--out", folder / "out") == 0
    names = sorted(path.name for path in (folder / "out").iterdir())
    assert names == ["0001_b.png", "0002_<script>c.png", "0003_a.png"]
    assert (read_image(folder / "out" / names[0]) != 90).any()


def test_a_picture_that_cannot_be_read_is_told_and_the_rest_shown(folder, capsys):
    (folder / "images" / "a.png").write_bytes(b"no picture")
    assert draw(folder, "--annotations", folder / "annotations.json", "--out", folder / "page.html") == 0
    assert "a.png: is not an image" in capsys.readouterr().err
    assert len(content((folder / "page.html").read_text())["pictures"]) == 2


def test_pictures_of_another_size_than_annotated_are_refused(folder, capsys):
    write_png(folder / "images" / "b.png", np.zeros((200, 100, 3), np.uint8))
    assert draw(folder, "--annotations", folder / "annotations.json", "--out", folder / "page.html") == 2
    assert "b.png: is 100x200 pixels, annotated as 200x200; expected the image" in capsys.readouterr().err


def test_names_that_lead_out_of_the_folder_are_refused(tmp_path):
    (tmp_path / "images").mkdir()
    (tmp_path / "d.json").write_text("[]")
    (tmp_path / "d.json.images.json").write_text('[{"id": 1, "file_name": "../secret.png"}]')
    with pytest.raises(InputError, match="leads out"):
        image_paths(tmp_path / "d.json", tmp_path / "images", {1: Detections.none()}, None)


def test_another_suffix_is_refused(folder, capsys):
    assert draw(folder, "--out", folder / "page.pdf") == 2
    assert "ends in .html" in capsys.readouterr().err


def test_png_files_go_into_a_new_folder(folder, capsys):
    (folder / "out").mkdir()
    (folder / "out" / "mine.txt").write_text("precious")
    assert draw(folder, "--annotations", folder / "annotations.json", "--out", folder / "out") == 2
    assert "is there already; give a new or empty folder" in capsys.readouterr().err
    assert [path.name for path in (folder / "out").iterdir()] == ["mine.txt"]


def test_large_pictures_are_made_smaller_and_keep_their_coordinates(tmp_path):
    write_png(tmp_path / "1.png", np.zeros((20, 3 * MAX_SIDE_PX, 3), np.uint8))
    point = np.full((1, 136, 2), np.nan)
    point[0, 0] = 2 * MAX_SIDE_PX, 10
    found = {1: Detections(point, np.isfinite(point[..., 0]).astype(float), [1.0])}
    chosen = pictures({1: tmp_path / "1.png"}, found, None)
    write_page(chosen, tmp_path / "page.html", "large")
    picture = content((tmp_path / "page.html").read_text())["pictures"][0]
    assert picture["width"] == 3 * MAX_SIDE_PX
    assert picture["found"] == [[[0, 2.0 * MAX_SIDE_PX, 10.0, 1.0]]]
    write_pngs(chosen, tmp_path / "out", 0.1)
    assert read_image(tmp_path / "out" / "0001_1.png").shape == (20, 3 * MAX_SIDE_PX, 3)

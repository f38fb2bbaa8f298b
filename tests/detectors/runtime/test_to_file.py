"""A folder, a data set, a video to a file: in order, in little memory, whatever a picture holds."""

import json
import weakref

import numpy as np
import pandas as pd
import pytest
from PIL import ExifTags, Image

from hicp_lib.cli import main as cli
from hicp_lib.core.errors import InputError
from hicp_lib.core.images import write_png
from hicp_lib.core.video import open_video
from hicp_lib.detectors import registry
from hicp_lib.detectors.runtime import run
from hicp_lib.detectors.runtime.to_file import detect_to_file, open_dataset, open_pictures
from tests.core.test_video import write_video
from tests.detectors.runtime.test_run import Counting


@pytest.fixture(autouse=True)
def counting(monkeypatch, tmp_path):
    monkeypatch.setenv("HICP_CACHE", str(tmp_path / "cache"))
    for module in (registry, run):
        monkeypatch.setattr(module, "make_detector", lambda name, **options: Counting(**options))
    Counting.calls = 0


@pytest.fixture
def folder(tmp_path):
    """Twelve images; `shot_i.png` has all values i."""
    for i in range(12):
        write_png(tmp_path / "shots" / f"shot_{i}.png", np.full((20, 30, 3), i, np.uint8))
    return tmp_path / "shots"


def detect(*arguments) -> int:
    return cli.run(["detect", "--detector", "counting", *map(str, arguments)])


def test_numbers_in_names_are_in_their_order(folder, tmp_path):
    assert detect("--images", folder, "--out", tmp_path / "d.json") == 0
    rows = json.loads((tmp_path / "d.json").read_text())
    assert [row["file_name"] for row in rows] == [f"shot_{i}.png" for i in range(12)]
    assert [row["image_id"] for row in rows] == list(range(1, 13))
    assert [row["keypoints"][0] for row in rows] == list(range(12))


def test_what_is_passed_over_in_a_folder_is_told(folder, tmp_path, capsys):
    (folder / "sub").mkdir()
    for name in ("b.gif", "c.HEIC", "d.heic", ".hidden"):
        (folder / name).touch()
    assert detect("--images", folder, "--out", tmp_path / "d.json") == 0
    told = capsys.readouterr().err
    assert told.startswith(f"{folder}: 4 others (.gif, .heic, folders) passed over; images end in .jpg, ")
    assert detect("--images", folder / "sub", "--out", tmp_path / "d.json") == 2
    (folder / "sub" / "c.gif").touch()
    assert detect("--images", folder / "sub", "--out", tmp_path / "d.json") == 2
    first, second = capsys.readouterr().err.splitlines()
    assert "sub: holds no images; expected" in first
    assert "sub: holds no images, 1 others (.gif) passed over; expected" in second


def test_a_rotation_flag_is_told_kept_results_or_not(folder, tmp_path, capsys):
    exif = Image.Exif()
    exif[ExifTags.Base.Orientation] = 6
    Image.new("RGB", (30, 20)).save(folder / "turned.jpg", exif=exif)
    for _ in range(2):
        assert detect("--images", folder, "--out", tmp_path / "d.json") == 0
        assert "1 images have a rotation flag (EXIF; turned.jpg: 6, ...)" in capsys.readouterr().err


def test_image_numbers_are_those_of_coco_or_the_order_of_names(tmp_path):
    for name in ("000000000139.jpg", "000000000285.JPG", "notes.txt"):
        (tmp_path / name).write_bytes(b"")
    assert [i for i, *_ in open_pictures(tmp_path).images] == [139, 285]
    (tmp_path / "photo.png").write_bytes(b"")
    assert [i for i, *_ in open_pictures(tmp_path).images] == [1, 2, 3]


@pytest.mark.parametrize(("last", "ids"), [(2**53, [7, 2**53]), (2**53 + 1, [1, 2]), (10**22, [1, 2])])
def test_numbers_too_large_for_ids_are_names(tmp_path, last, ids):
    for number in (7, last):
        (tmp_path / f"{number}.png").write_bytes(b"")
    assert [i for i, *_ in open_pictures(tmp_path).images] == ids


@pytest.mark.parametrize("suffix", [".json", ".csv", ".parquet"])
def test_the_same_bytes_for_any_number_of_workers_kept_or_not(folder, tmp_path, suffix):
    files = []
    for workers in (1, 3, 3, 1):
        files.append(tmp_path / f"{len(files)}{suffix}")
        assert detect("--images", folder, "--out", files[-1], "--workers", workers) == 0
    assert Counting.calls == 12
    assert len({file.read_bytes() for file in files}) == 1


def test_a_broken_picture_does_not_lose_the_folder(folder, tmp_path, capsys):
    (folder / "shot_5.png").write_bytes(b"no picture")
    (folder / "shot_7.png").write_bytes(b"")
    assert detect("--images", folder, "--out", tmp_path / "d.json") == 0
    output, errors = capsys.readouterr()
    assert output.startswith(f"{tmp_path / 'd.json'}: 10 people in 10 images; 2 could not be read\n")
    assert errors.count("is not an image") == 2 and "shot_5.png" in errors and "shot_7.png" in errors
    images = json.loads((tmp_path / "d.json.images.json").read_text())
    assert [image["id"] for image in images if "error" in image] == [6, 8]
    assert 6 not in {row["image_id"] for row in json.loads((tmp_path / "d.json").read_text())}


def test_a_broken_picture_ends_a_strict_run(folder, tmp_path, capsys):
    (folder / "shot_5.png").write_bytes(b"no picture")
    assert detect("--images", folder, "--out", tmp_path / "d.json", "--strict") == 2
    assert "shot_5.png: is not an image" in capsys.readouterr().err
    assert not list(tmp_path.glob("d.*")) and not list(tmp_path.glob(".partial*"))


def test_nothing_but_broken_pictures_is_no_result(tmp_path, capsys):
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.png").write_bytes(b"no picture")
    assert detect("--images", tmp_path / "in", "--out", tmp_path / "d.json") == 2
    assert "none of its 1 images can be read" in capsys.readouterr().err
    assert not list(tmp_path.glob("d.*"))


@pytest.mark.parametrize("suffix", [".avi", ".mp4", ".mov"])
def test_a_video_is_its_frames_with_their_times(tmp_path, suffix, capsys):
    clip = tmp_path / f"clip{suffix}"
    write_video(clip)
    for workers in (1, 2):
        assert detect("--images", clip, "--out", tmp_path / "d.csv", "--workers", workers) == 0
        table = pd.read_csv(tmp_path / "d.csv")
        assert table["frame"].tolist() == table["image_id"].tolist() == list(range(6))
        assert np.allclose(table["time_s"], np.arange(6) / 12.5)
        assert (np.diff(table["u_px"]) > 10).all()
    assert Counting.calls == 6
    assert capsys.readouterr().err == ""


def test_a_video_that_was_cut_off_is_told(tmp_path, capsys, monkeypatch):
    write_video(tmp_path / "clip.avi")
    said = lambda path: (9, open_video(path)[1])  # noqa: E731
    monkeypatch.setattr("hicp_lib.detectors.runtime.to_file.open_video", said)
    assert detect("--images", tmp_path / "clip.avi", "--out", tmp_path / "d.json") == 0
    assert "clip.avi: says 9 frames, 6 could be decoded" in capsys.readouterr().err


def test_a_line_for_each_image_where_it_is_asked_for(folder, tmp_path, capsys):
    detect("--images", folder, "--out", tmp_path / "d.json", "--by-image")
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 12 + 2
    assert lines[10].split() == ["11", "shot_10.png", "1", "0.25", "(1)"]
    assert lines[-1] == (
        f"look: hicp draw --detections {tmp_path}/d.json --images {folder} --out {tmp_path}/d.html"
    )


def test_a_data_set_gives_its_ids_and_names(folder, tmp_path):
    folder.rename(tmp_path / "images")
    images = [{"id": 70 + i, "file_name": f"shot_{i}.png", "width": 30, "height": 20} for i in (4, 2)]
    (tmp_path / "annotations.json").write_text(
        json.dumps({"images": images, "annotations": [], "categories": [{"id": 1, "name": "person"}]})
    )
    detect_to_file("counting", open_dataset(tmp_path), tmp_path / "d.json", print)
    rows = json.loads((tmp_path / "d.json").read_text())
    assert [(row["image_id"], row["file_name"], row["keypoints"][0]) for row in rows] == [
        (74, "shot_4.png", 4), (72, "shot_2.png", 2),
    ]  # fmt: skip


def test_a_data_set_with_pictures_of_another_size_is_refused_before_anything_is_done(tmp_path, capsys):
    exif = Image.Exif()
    exif[ExifTags.Base.Orientation] = 6
    (tmp_path / "images").mkdir()
    Image.new("RGB", (30, 20)).save(tmp_path / "images" / "turned.jpg", exif=exif)
    for (width, height), refused in {(30, 20): False, (20, 30): True, (60, 40): True}.items():
        images = [{"id": 1, "file_name": "turned.jpg", "width": width, "height": height}]
        content = {"images": images, "annotations": [], "categories": [{"id": 1, "name": "person"}]}
        (tmp_path / "annotations.json").write_text(json.dumps(content))
        assert detect("--dataset", tmp_path, "--out", tmp_path / f"{width}.json") == 2 * refused
        told = f"turned.jpg: is 30x20 pixels as stored (rotation flag 6), annotated as {width}x{height}; exp"
        assert (told in capsys.readouterr().err) == refused == (not (tmp_path / f"{width}.json").exists())
        if refused:
            with pytest.raises(InputError, match=f"annotated as {width}x{height}"):
                run.detect_dataset("counting", tmp_path)


def test_few_results_wait_in_memory_and_all_come_in_order(folder, monkeypatch):
    """While the first image takes its time, the others, which are kept, pass it."""
    list(run.detect_each("counting", enumerate(sorted(folder.iterdir())[1:])))
    monkeypatch.setattr(run, "_MOST_WAITING", 3)
    read = []
    known = run.results.read_result
    monkeypatch.setattr(run.results, "read_result", lambda path: read.append(path) or known(path))
    found = list(run.detect_each("counting", enumerate(sorted(folder.iterdir())), workers=2))
    assert [key for key, _ in found] == list(range(12))
    assert [int(result.detections.keypoints_px[0, 0, 0]) for _, result in found] == [
        0, 1, 10, 11, *range(2, 10),
    ]  # fmt: skip


def test_a_kept_result_that_goes_while_it_waits_is_told(folder, monkeypatch):
    paths = sorted(folder.iterdir())
    list(run.detect_each("counting", enumerate(paths[1:])))
    monkeypatch.setattr(run, "_MOST_WAITING", 0)
    known, read = run.results.read_result, set()

    def read_once(path):
        if path in read:
            return None
        read.add(path)
        return known(path)

    monkeypatch.setattr(run.results, "read_result", read_once)
    (_, answer), *_ = list(run.detect_each("counting", enumerate(paths), workers=1))[1:]
    assert isinstance(answer, InputError) and ".bin: was removed" in str(answer)


@pytest.mark.parametrize("workers", [1, 2])
def test_what_was_handed_on_is_forgotten(workers):
    images = {i: np.full((8, 9, 3), i, np.uint8) for i in range(200)}
    for _ in ("found", "kept"):
        given, most = [], 0
        for _, result in run.detect_each("counting", images.items(), workers=workers):
            given.append(weakref.ref(result))
            most = max(most, sum(of() is not None for of in given))
        assert len(given) == 200 and most <= 8
    assert Counting.calls == 200

"""Batches: results by key, whatever the order and the number of threads; the cache on disk."""

import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from hicp_lib.core import cache as core_cache
from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.images import write_png
from hicp_lib.detectors.runtime import results as cache
from hicp_lib.detectors.runtime import run


class Counting:
    """A detector that finds one person per image, at its mean colour, and counts its calls."""

    name = "counting"
    calls = 0

    def __init__(self, version: int = 1) -> None:
        self.settings = {"version": version}

    def detect(self, image: np.ndarray) -> Detections:
        type(self).calls += 1
        keypoints_px = np.full((1, 136, 2), np.nan)
        keypoints_px[0, 0] = image.mean(), self.settings["version"]
        scores = np.where(np.isfinite(keypoints_px[..., 0]), 0.5, 0.0)
        return Detections(keypoints_px, scores, np.array([0.25]))


@pytest.fixture
def counting(monkeypatch, tmp_path):
    monkeypatch.setenv("HICP_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(run, "make_detector", lambda name, **options: Counting(**options))
    Counting.calls = 0
    return Counting


@pytest.fixture
def images(tmp_path):
    """Ten images that differ; image i has all values i."""
    paths = {}
    for i in range(10):
        paths[i] = tmp_path / f"{i}.png"
        write_png(paths[i], np.full((20 + i, 30, 3), i, np.uint8))
    return paths


def points(results) -> dict:
    return {key: tuple(result.detections.keypoints_px[0, 0]) for key, result in results.items()}


def test_results_come_in_the_order_of_the_images(counting, images):
    shuffled = {key: images[key] for key in (7, 2, 9, 0)}
    results = run.detect_images("counting", shuffled, workers=3)
    assert list(results) == [7, 2, 9, 0]
    assert points(results) == {key: (key, 1) for key in shuffled}
    assert all(result.time_ms >= 0 and result.workers == 3 for result in results.values())


def test_nothing_is_computed_twice_until_something_changes(counting, images):
    first = run.detect_images("counting", images)
    again = run.detect_images("counting", images, workers=1)
    assert counting.calls == 10
    assert points(again) == points(first)
    assert [r.time_ms for r in again.values()] == [r.time_ms for r in first.values()]
    assert points(run.detect_images("counting", images, version=2))[3] == (3, 2)
    assert counting.calls == 20
    write_png(images[4], np.full((9, 9, 3), 200, np.uint8))
    assert points(run.detect_images("counting", images))[4] == (200, 1)
    assert counting.calls == 21


def test_the_name_of_an_image_does_not_matter(counting, images, tmp_path):
    run.detect_images("counting", images)
    moved = tmp_path / "moved.png"
    images[5].rename(moved)
    assert points(run.detect_images("counting", {"x": moved})) == {"x": (5, 1)}
    assert counting.calls == 10


@pytest.mark.parametrize("position", [0, 31, 32, 40, 90, 200, -1])
def test_a_damaged_result_is_computed_again(counting, images, position):
    run.detect_images("counting", {0: images[0]})
    (kept,) = (path for path in Path(cache.cache_folder(Counting())).iterdir())
    content = bytearray(kept.read_bytes())
    content[position] ^= 64
    kept.write_bytes(content)
    assert points(run.detect_images("counting", {0: images[0]})) == {0: (0, 1)}
    assert counting.calls == 2
    assert cache.read_result(kept) is not None


@pytest.mark.parametrize("length", [0, 10, 32, 200])
def test_a_cut_off_result_is_computed_again(counting, images, length):
    run.detect_images("counting", {0: images[0]})
    (kept,) = Path(cache.cache_folder(Counting())).iterdir()
    kept.write_bytes(kept.read_bytes()[:length])
    assert cache.read_result(kept) is None
    run.detect_images("counting", {0: images[0]})
    assert counting.calls == 2


@pytest.mark.parametrize("n", [0, 1, 3])
def test_what_is_read_is_what_was_written(tmp_path, n):
    rng = np.random.default_rng(n)
    keypoints_px = rng.normal(0, 1e3, (n, 136, 2))
    keypoints_px[:, 20:] = np.nan
    written = cache.Timed(Detections(keypoints_px, rng.random((n, 136)), rng.random(n)), 12.5, 4)
    cache.write_result(tmp_path / "x.bin", written)
    read = cache.read_result(tmp_path / "x.bin")
    assert (read.time_ms, read.workers) == (12.5, 4)
    for name in ("keypoints_px", "scores", "person_scores"):
        assert np.array_equal(
            getattr(read.detections, name), getattr(written.detections, name), equal_nan=True
        )


def test_the_key_knows_code_and_libraries(counting, monkeypatch):
    folders = {cache.cache_folder(Counting())}
    known = core_cache.running_code
    for part in ("modules", "data", "libraries"):
        with monkeypatch.context() as changed:
            other = {part: {"other": "1"}}
            changed.setattr(
                core_cache, "running_code", lambda names, other=other: replace(known(names), **other)
            )
            folders.add(cache.cache_folder(Counting()))
    folders.add(cache.cache_folder(Counting(version=2)))
    assert len(folders) == 5


def test_an_image_that_cannot_be_read_is_named(counting, images, tmp_path):
    for content in (None, b"no image", b""):
        bad = tmp_path / "bad.png"
        if content is not None:
            bad.write_bytes(content)
        with pytest.raises(InputError, match=r"bad\.png") as error:
            run.detect_images("counting", images | {99: bad})
        assert "\n" not in str(error.value)


def test_a_file_is_read_once_so_that_the_key_is_of_what_was_decoded(counting, images, monkeypatch):
    known, read = run.read_bytes, []
    monkeypatch.setattr(run, "read_bytes", lambda path, expected: read.append(path) or known(path, expected))
    run.detect_images("counting", images)
    assert sorted(read) == sorted(images.values())


def test_boxes_go_only_to_detectors_that_take_them(counting, images, monkeypatch):
    shown = []
    monkeypatch.setattr(counting, "takes_boxes", True, raising=False)
    plain = counting.detect
    monkeypatch.setattr(
        counting, "detect", lambda self, image, *boxes: shown.append(boxes) or plain(self, image)
    )
    boxes_px = {key: np.full((1, 4), float(key)) for key in images}
    run.detect_images("counting", {3: images[3]}, boxes_px=boxes_px)
    monkeypatch.setattr(counting, "takes_boxes", False)
    run.detect_images("counting", {4: images[4]}, boxes_px=boxes_px)
    monkeypatch.setattr(counting, "takes_boxes", True)
    run.detect_images("counting", {5: images[5]})
    assert [[box.tolist() for box in boxes] for boxes in shown] == [[[[3.0] * 4]], [], []]


def test_no_more_workers_than_images(counting, images):
    (result,) = run.detect_images("counting", {0: images[0]}, workers=8).values()
    assert result.workers == 1


def test_no_images_no_results(counting):
    assert run.detect_images("counting", {}) == {}


def test_opencv_gets_its_threads_back(counting, images):
    before = cv2.getNumThreads()
    cv2.setNumThreads(2)
    run.detect_images("counting", images)
    assert cv2.getNumThreads() == 2
    cv2.setNumThreads(before)


def test_a_dataset_is_read_by_image_id(counting, images, tmp_path):
    (tmp_path / "images").mkdir()
    for key in (3, 8):
        images[key].rename(tmp_path / "images" / images[key].name)
    (tmp_path / "annotations.json").write_text(
        '{"images": [{"id": 80, "file_name": "8.png", "width": 30, "height": 28},'
        '{"id": 30, "file_name": "3.png", "width": 30, "height": 23}], "annotations": [],'
        '"categories": [{"id": 1, "name": "person"}]}'
    )
    found = run.detect_dataset("counting", tmp_path)
    assert {key: people.keypoints_px[0, 0, 0] for key, people in found.items()} == {80: 8, 30: 3}


def test_an_unknown_detector_is_refused(images):
    with pytest.raises(InputError, match="'nobody' is not known; expected one of: mediapipe-pose"):
        run.detect_images("nobody", images)


@pytest.fixture
def photographs(photograph, tmp_path):
    paths = {}
    for i in range(6):
        paths[i] = tmp_path / f"photograph_{i}.png"
        write_png(paths[i], photograph[10 * i : 500 + 7 * i, 5 * i :])
    return paths


@pytest.mark.parametrize("name", ["mediapipe", "openpose-mobilenet"])
def test_real_detectors_do_not_depend_on_threads_or_order(
    own_cache, photographs, name, monkeypatch, tmp_path
):
    alone = run.detect_images(name, photographs, workers=1)
    backwards = dict(reversed(photographs.items()))
    monkeypatch.setattr(cache, "cache_folder", lambda _: tmp_path / "other")
    together = run.detect_images(name, backwards, workers=3)
    for key, result in alone.items():
        for field in ("keypoints_px", "scores", "person_scores"):
            pair = [getattr(r.detections, field) for r in (result, together[key])]
            assert np.array_equal(*pair, equal_nan=True)


def test_two_processes_at_once_agree(own_cache, photographs):
    program = (
        "import sys; from hicp_lib.detectors.runtime.run import detect_images; "
        "results = detect_images('mediapipe-pose', dict(enumerate(sys.argv[1:]))); "
        "print([r.detections.keypoints_px.tolist() for r in results.values()])"
    )
    command = [sys.executable, "-c", program, *map(str, photographs.values())]
    processes = [subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) for _ in range(2)]
    (first, errors), (second, _) = (process.communicate() for process in processes)
    assert errors == b"" and len(first) > 1000
    assert first == second


def test_a_run_that_was_killed_goes_on_where_it_was(slow):
    killed = slow.detect("out.json", "--workers", "2", SLOW_GATE="20")
    while slow.n_kept() < 20:
        assert killed.poll() is None, killed.communicate()
        time.sleep(0.02)
    killed.kill()
    killed.communicate()
    kept = slow.n_kept()
    assert kept == 20 and not (slow.folder / "out.json").exists()

    resumed = slow.detect("out.json", "--workers", "2")
    output, errors = resumed.communicate()
    assert output.startswith(f"out.json: 40 people in {slow.n_images} images\n") and errors == ""
    assert len(slow.computed(resumed)) == slow.n_images - kept
    assert set(slow.computed()) == set(range(slow.n_images))

    whole = slow.detect("whole.json", "--workers", "1", HICP_CACHE=str(slow.folder / "other"))
    whole.communicate()
    assert len(slow.computed(whole)) == slow.n_images
    assert (slow.folder / "out.json").read_bytes() == (slow.folder / "whole.json").read_bytes()

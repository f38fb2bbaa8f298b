"""Detectors made of others: a part looks at the same pixels once, whoever asks; time and results as ever."""

import numpy as np
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.core.files import cache_dir
from hicp_lib.core.images import read_image, write_png
from hicp_lib.core.keypoints import N_KEYPOINTS
from hicp_lib.detectors.combined.detector import Combined
from hicp_lib.detectors.registry import make_detector
from hicp_lib.detectors.runtime import results, run
from hicp_lib.detectors.runtime.results import _modules, cache_folder

PART_S, OWN_S, START_S = 0.03, 0.005, 1.0


class Clock:
    """Time that goes on only when a detector says so."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def perf_counter(self) -> float:
        self.now_s += 1e-9
        return self.now_s


class Part:
    """Finds a person by the brightest pixel, and notes what it sees; must start first, as MediaPipe must."""

    def __init__(self, name: str, seen: list, clock: Clock) -> None:
        self.name, self.settings, self._seen, self._clock = name, {"kind": name}, seen, clock
        self._to_start_s = START_S

    def start(self):
        self._clock.now_s += self._to_start_s
        self._to_start_s = 0.0

    def detect(self, image, boxes_px=None):
        self.start()
        self._seen.append((self.name, image.tobytes()))
        self._clock.now_s += PART_S
        found = np.full((1, N_KEYPOINTS, 2), np.nan)
        brightest = np.unravel_index(image[..., 0].argmax(), image.shape[:2])[::-1]
        found[0, [0, 7, 9, 94]] = np.add(brightest, [[0, 0], [0, -30], [0, 0], [1, 1]])
        if boxes_px is not None:
            found[0, 0] = boxes_px[0, :2]
        return Detections(found, np.where(np.isfinite(found[..., 0]), 0.5, 0.0), np.ones(1))


class Both:
    """Two parts that look at the whole image, as MediaPipe is made."""

    name = "both"

    def __init__(self, clock: Clock, **parts) -> None:
        self.parts, self._clock = parts, clock
        self.settings = {name: part.settings for name, part in parts.items()}

    def detect(self, image):
        self._clock.now_s += OWN_S
        body, hands = (part.detect(image) for part in self.parts.values())
        return body.concatenate(hands)


class Detectors:
    """What `make_detector` makes in these tests, what its parts have seen, and how often."""

    def __init__(self) -> None:
        self.seen, self.clock = [], Clock()

    def make(self, name: str, **options):
        part = {kind: Part(kind, self.seen, self.clock) for kind in ("body", "hands")}
        part["body"].takes_boxes = options.pop("takes_boxes", False)
        if name == "both":
            return Both(self.clock, **part)
        if name == "combined:both+hands":
            return Combined(Both(self.clock, **part), part["hands"])
        return Combined(part["body"], part["hands"], **options) if name == "combined" else part[name]

    def n_seen(self, kind: str) -> int:
        return sum(name == kind for name, _ in self.seen)


@pytest.fixture
def detectors(tmp_path, monkeypatch):
    monkeypatch.setenv("HICP_CACHE", str(tmp_path / "cache"))
    made = Detectors()
    monkeypatch.setattr(run, "make_detector", made.make)
    monkeypatch.setattr(results, "time", made.clock)
    return made


@pytest.fixture
def images(tmp_path):
    """Five images, longer than wide; a bright pixel in each."""
    paths = {i: tmp_path / f"{i}.png" for i in range(5)}
    for i, path in paths.items():
        image = np.full((200, 300, 3), i, np.uint8)
        image[100 + i, 50 + 40 * i] = 255
        write_png(path, image)
    return paths


def positions(results) -> np.ndarray:
    return np.concatenate([result.detections.keypoints_px for result in results.values()])


def test_no_part_looks_at_anything_twice(detectors, images):
    runs = [
        ("body", {}), ("both", {}), ("combined", {}), ("combined", {"arbitrate": False}),
        ("combined", {"looks": "image"}), ("hands", {}), ("combined:both+hands", {}),
    ]  # fmt: skip
    for name, options in runs:
        run.detect_images(name, images, workers=3, **options)
    assert detectors.n_seen("body") == len(images)
    assert detectors.n_seen("hands") > 2 * len(images)  # squares, too
    assert len(set(detectors.seen)) == len(detectors.seen)


@pytest.mark.parametrize("name", ["both", "combined", "combined:both+hands"])
def test_what_is_found_is_what_is_found_without_keeping(detectors, images, name):
    expected = [detectors.make(name).detect(read_image(path)).keypoints_px for path in images.values()]
    run.detect_images("hands", {0: images[0], 3: images[3]})
    np.testing.assert_array_equal(positions(run.detect_images(name, images)), np.concatenate(expected))


def test_the_time_is_that_of_all_parts_wherever_they_come_from(detectors, images):
    whole_ms = 1e3 * (2 * PART_S + OWN_S)
    run.detect_images("body", {0: images[0]}, workers=1)
    run.detect_images("hands", {0: images[0], 1: images[1]}, workers=1)
    times_ms = [result.time_ms for result in run.detect_images("both", images, workers=1).values()]
    assert times_ms == pytest.approx([whole_ms] * len(images), abs=1e-3)
    alone_ms = [result.time_ms for result in run.detect_images("hands", images, workers=1).values()]
    assert alone_ms == pytest.approx([1e3 * PART_S] * len(images), abs=1e-3)
    assert detectors.n_seen("hands") == len(images)


def test_a_variant_of_a_combination_takes_what_it_would_take_alone(detectors, images):
    # A plain square is its own mirror image, which would be looked at once and count twice.
    looks = "wrists+image+along"
    first = run.detect_images("combined", images, workers=1, looks=looks)
    again = run.detect_images("combined", images, workers=1, looks=looks, arbitrate=False)
    n_looks = detectors.n_seen("hands") + detectors.n_seen("body")
    for found in (first, again):
        total_ms = sum(result.time_ms for result in found.values())
        assert total_ms == pytest.approx(1e3 * PART_S * n_looks, abs=1e-2)


def test_boxes_are_part_of_what_is_kept(detectors, images):
    def noses(left_px):
        boxes_px = {0: np.array([[left_px, 2.0, 3, 4]])}
        found = run.detect_images(
            "combined", {0: images[0]}, boxes_px=boxes_px, takes_boxes=True, looks="image"
        )
        return positions(found)[0, 0].tolist()

    assert noses(1.0) == [1, 2]
    assert noses(5.0) == [5, 2]
    assert detectors.n_seen("body") == 2 and detectors.n_seen("hands") == 1


def test_without_a_file_nothing_is_kept(detectors, images):
    image = read_image(images[0])
    for name in ("both", "combined"):
        detectors.make(name).detect(image)
        begin_s = detectors.clock.now_s
        took_ms = results.Runner(detectors.make(name), workers=1).detect(image, None, None).time_ms
        assert took_ms == pytest.approx(1e3 * (detectors.clock.now_s - begin_s - 2 * START_S), abs=1e-3)
    assert detectors.n_seen("body") == 4
    assert not (cache_dir() / "detections").exists()


def test_a_damaged_result_of_a_part_is_found_again(detectors, images):
    run.detect_images("body", images)
    for path in cache_folder(detectors.make("body")).iterdir():
        path.write_bytes(path.read_bytes()[:-1])
    run.detect_images("both", images)
    assert detectors.n_seen("body") == 2 * len(images)


def test_mediapipe_shares_with_its_parts(own_cache, photograph, tmp_path):
    write_png(tmp_path / "p.png", photograph)
    paths = {0: tmp_path / "p.png"}
    alone = {name: run.detect_images(name, paths)[0] for name in ("mediapipe-pose", "mediapipe-hands")}
    found = run.detect_images("mediapipe", paths)[0]
    assert found.time_ms > sum(result.time_ms for result in alone.values())
    live = make_detector("mediapipe").detect(photograph)
    np.testing.assert_array_equal(found.detections.keypoints_px, live.keypoints_px)


def test_the_detector_that_a_runner_is_given_stays_as_it_is(detectors):
    given = detectors.make("combined:both+hands")
    body, hands = given.parts["body"], given.parts["hands"]
    inner = dict(body.parts)
    runner = results.Runner(given, workers=1)
    assert runner.detector is given
    assert given.parts == {"body": body, "hands": hands} and body.parts == inner


def test_the_key_of_a_combination_names_the_code_of_its_parts(weights):
    combined = make_detector("combined:openpose-mobilenet+mediapipe-hands")
    assert set(_modules(combined)) == {
        "hicp_lib.detectors.combined.detector",
        "hicp_lib.detectors.mediapipe.tasks",
        "hicp_lib.detectors.openpose.networks",
    }

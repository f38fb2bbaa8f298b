"""Detections timed, and cached on disk, one small file per image, valid only while nothing has changed.

The key is the SHA-256 of everything a result depends on: the image file's bytes, the detector's name and
settings (with its weights' hashes), and the import closure of the code of the detector and its parts
(`hicp_lib.core.cache`). A stale or damaged file is ignored and computed again.

`mediapipe` consists of `mediapipe-pose` and `mediapipe-hands`, a combination of a body and a hand detector;
variants of a combination run on mostly the same squares of the same images. A part runs on the same image or
square only once: its results for whole images are shared with those of the part run alone over the same
files.
"""

import time
from collections.abc import Hashable, Iterator, Mapping
from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from hicp_lib.core.cache import code_identity, digest
from hicp_lib.core.detections import Detections, Detector
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import cache_dir, read_checked, sha256_bytes, write_checked
from hicp_lib.core.keypoints import N_KEYPOINTS

Key = TypeVar("Key", bound=Hashable)
_N_COLUMNS = 3 * N_KEYPOINTS + 1


@dataclass(frozen=True)
class Timed:
    """Detections in one image, and the time it took.

    Attributes
    ----------
    detections : Detections
        The people found.
    time_ms : float
        Time of the detector's original call (cached results, also of parts, keep their time).
    workers : int
        How many such calls ran in parallel then; more of them make each slower.
    """

    detections: Detections
    time_ms: float
    workers: int


def detections_of(results: Mapping[Key, Timed]) -> dict[Key, Detections]:
    """Results without their times, by the same keys in the same order."""
    return {key: result.detections for key, result in results.items()}


def identity(detector: Detector) -> dict:
    """Everything that this detector's results depend on, besides the image."""
    return {"settings": detector.settings} | code_identity(__name__, *_modules(detector))


def _modules(detector: Detector) -> Iterator[str]:
    yield type(detector).__module__
    for part in getattr(detector, "parts", {}).values():
        yield from _modules(part)


def cache_folder(detector: Detector) -> Path:
    """Folder of this detector's results with its current settings."""
    return cache_dir() / "detections" / detector.name / digest(identity(detector))[:32]


def pixels_sha256(image: np.ndarray) -> str:
    """SHA-256 of an image that is not a file."""
    return sha256_bytes(f"{image.dtype} {image.shape}".encode() + image.tobytes())


def result_path(folder: Path, image_sha256: str, boxes_px: np.ndarray | None) -> Path:
    """Where the result of an image is cached.

    Parameters
    ----------
    folder : Path
    image_sha256 : str
    boxes_px : array or None, shape (n, 4)
        Part of the key if given.

    Examples
    --------
    >>> result_path(Path("kept"), "ab12", None).as_posix()
    'kept/ab12.bin'
    """
    boxes_key = "" if boxes_px is None else "-" + sha256_bytes(np.asarray(boxes_px, float).tobytes())[:16]
    return folder / f"{image_sha256}{boxes_key}.bin"


def read_result(path: Path) -> Timed | None:
    """The result cached at `path`; None if there is none or it is damaged."""
    payload = read_checked(path)
    if payload is None:
        return None
    values = np.frombuffer(payload).copy()
    rows = values[2:].reshape(-1, _N_COLUMNS)
    keypoints_px = rows[:, : 2 * N_KEYPOINTS].reshape(-1, N_KEYPOINTS, 2)
    found = Detections(keypoints_px, rows[:, 2 * N_KEYPOINTS : -1], rows[:, -1])
    return Timed(found, float(values[0]), int(values[1]))


def write_result(path: Path, result: Timed) -> None:
    """Cache a result at `path`; another process may do the same at the same time.

    The file is checked (`hicp_lib.core.files.write_checked`) and holds 64-bit floats: time and workers, then
    per person positions, scores and person score. One person fits in one block of a disk.
    """
    found = result.detections
    positions = found.keypoints_px.reshape(len(found), 2 * N_KEYPOINTS)
    people = np.column_stack([positions, found.scores, found.person_scores])
    write_checked(path, np.concatenate([[result.time_ms, result.workers], people.ravel()]).tobytes())


class Runner:
    """A detector that is run on one image after another.

    Parameters
    ----------
    detector : Detector
        The detector. It is not changed: the runner uses a copy of it, whose `parts`, if any, are cached.
    workers : int
        Number of such runners in parallel.

    Attributes
    ----------
    image : array, shape (height, width, 3)
        The one that the detector is processing.
    image_sha256 : str or None
        Hash of the file that `image` is from; None if nothing is to be cached.
    owed_ms : list of float
        For each result of a part, its original time minus the time to get it now.

    Raises
    ------
    InputError
        For a detector whose results depend on earlier images: here they come in any order.
    """

    def __init__(self, detector: Detector, workers: int) -> None:
        if _tracks(detector):
            raise InputError(f"{detector.name}: tracking_hz is for a video, and these images are independent")
        self.detector, self.workers = detector, workers
        self.image: np.ndarray | None = None
        self.image_sha256: str | None = None
        self.owed_ms: list[float] = []
        self._asked = self._with_cached_parts(detector)

    def detect(self, image: np.ndarray, boxes_px: np.ndarray | None, image_sha256: str | None) -> Timed:
        """People in an image, and the time it took; for cached results, the original time.

        Parameters
        ----------
        image : array, shape (height, width, 3), dtype uint8
            RGB.
        boxes_px : array or None, shape (n, 4: x, y, width, height)
            For detectors that take them.
        image_sha256 : str or None
            Of the image's file; without it the cache is not used.
        """
        self.image, self.image_sha256, self.owed_ms = image, image_sha256, []
        result = _timed(self._asked, self.workers, image, *(() if boxes_px is None else (boxes_px,)))
        return replace(result, time_ms=result.time_ms + sum(self.owed_ms))

    def _with_cached_parts(self, detector: Detector) -> Detector:
        """A copy of a detector with cached parts; the detector itself if it has none."""
        if not hasattr(detector, "parts"):
            return detector
        result = copy(detector)
        result.parts = {
            name: self._with_cached_parts(part) if hasattr(part, "parts") else CachedPart(part, self)
            for name, part in detector.parts.items()
        }
        return result


class CachedPart:
    """A part of a runner's detector: results for an input seen before come from the cache."""

    def __init__(self, detector: Detector, runner: Runner) -> None:
        self._detector, self._runner, self._folder = detector, runner, cache_folder(detector)
        self.name, self.settings = detector.name, detector.settings
        self.takes_boxes = getattr(detector, "takes_boxes", False)

    def start(self) -> None:
        """As the detector's own, if it has one."""
        start(self._detector)

    def detect(self, image: np.ndarray, *boxes_px: np.ndarray) -> Detections:
        """As the detector's own."""
        begin = time.perf_counter()
        path = self._path(image, *boxes_px)
        result = read_result(path) if path else None
        if result is None:
            result = _timed(self._detector, self._runner.workers, image, *boxes_px)
            if path:
                write_result(path, result)
        self._runner.owed_ms.append(result.time_ms - 1e3 * (time.perf_counter() - begin))
        return result.detections

    def _path(self, image: np.ndarray, boxes_px: np.ndarray | None = None) -> Path | None:
        if self._runner.image_sha256 is None:
            return None
        if image is self._runner.image:
            return result_path(self._folder, self._runner.image_sha256, boxes_px)
        return result_path(self._folder / "squares", pixels_sha256(image), boxes_px)


def _tracks(detector: Detector) -> bool:
    """Whether its settings, or those of a part, ask for tracking in a video."""
    return "tracking_hz" in detector.settings or any(map(_tracks, getattr(detector, "parts", {}).values()))


def start(detector: Detector) -> None:
    """Call a detector's `start`, if it has one, so that its first call takes no longer than others."""
    getattr(detector, "start", lambda: None)()


def _timed(detector: Detector, workers: int, image: np.ndarray, *boxes_px: np.ndarray) -> Timed:
    start(detector)
    begin = time.perf_counter()
    found = detector.detect(image, *boxes_px)
    return Timed(found, 1e3 * (time.perf_counter() - begin), workers)

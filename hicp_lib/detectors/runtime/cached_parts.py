"""A detector as it runs over image files: timed, its parts' answers read from disk where they are kept.

`mediapipe` is made of `mediapipe-pose` and `mediapipe-hands`, a combination of a body and a hand detector;
variants of a combination look at mostly the same squares of the same images. A part looks at the same image
or square once, whoever asks: its results for whole images lie where the part alone, run over the same files,
keeps its own.
"""

import time
from copy import copy
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from hicp_lib.core.detections import Detections, Detector
from hicp_lib.core.errors import InputError
from hicp_lib.detectors.runtime.results import Timed, cache_folder, cached, pixels_sha256, result_path


@dataclass
class _Shown:
    """What a runner's detector is being shown.

    Attributes
    ----------
    workers : int
        How many runners work side by side.
    image : array, shape (height, width, 3), optional
    image_sha256 : str, optional
        Hash of the file that `image` is from; None if nothing is to be kept.
    owed_ms : list of float
        For each result of a part, what the part took to find it, less what it took to get it now.
    """

    workers: int
    image: np.ndarray | None = None
    image_sha256: str | None = None
    owed_ms: list[float] = field(default_factory=list)


class Runner:
    """A detector that is shown one image after another.

    Parameters
    ----------
    detector : Detector
        What runs. It stays as it is: the runner asks a copy of it, whose `parts`, if it has any, are cached.
    workers : int
        How many such runners work side by side.

    Raises
    ------
    InputError
        For a detector whose answers depend on the images before: they come in any order here.
    """

    def __init__(self, detector: Detector, workers: int) -> None:
        if _tracks(detector):
            raise InputError(f"{detector.name}: tracking_hz is for a video, these images stand by themselves")
        self.detector, self._shown = detector, _Shown(workers)
        self._asked = _with_cached_parts(detector, self._shown)

    def detect(self, image: np.ndarray, boxes_px: np.ndarray | None, image_sha256: str | None) -> Timed:
        """People in an image, and the time it took; of what was kept, the time then.

        Parameters
        ----------
        image : array, shape (height, width, 3), dtype uint8
            RGB.
        boxes_px : array or None, shape (n, 4: x, y, width, height)
            For detectors that take them.
        image_sha256 : str or None
            Of the image's file; without it nothing is read from disk or kept there.
        """
        shown = self._shown
        shown.image, shown.image_sha256 = image, image_sha256
        shown.owed_ms.clear()
        result = _timed(self._asked, shown.workers, image, *(() if boxes_px is None else (boxes_px,)))
        return replace(result, time_ms=result.time_ms + sum(shown.owed_ms))


class CachedPart:
    """A part of a runner's detector: its results come from disk where it saw the same before."""

    def __init__(self, detector: Detector, shown: _Shown) -> None:
        self._detector, self._shown, self._folder = detector, shown, cache_folder(detector)
        self.name, self.settings = detector.name, detector.settings
        self.takes_boxes = getattr(detector, "takes_boxes", False)

    def start(self) -> None:
        """As the detector's own, if it has one."""
        start(self._detector)

    def detect(self, image: np.ndarray, *boxes_px: np.ndarray) -> Detections:
        """As the detector's own."""
        begin = time.perf_counter()
        result = cached(
            self._path(image, *boxes_px),
            lambda: _timed(self._detector, self._shown.workers, image, *boxes_px),
        )
        self._shown.owed_ms.append(result.time_ms - 1e3 * (time.perf_counter() - begin))
        return result.detections

    def _path(self, image: np.ndarray, boxes_px: np.ndarray | None = None) -> Path | None:
        if self._shown.image_sha256 is None:
            return None
        if image is self._shown.image:
            return result_path(self._folder, self._shown.image_sha256, boxes_px)
        return result_path(self._folder / "squares", pixels_sha256(image), boxes_px)


def _tracks(detector: Detector) -> bool:
    """Whether its settings, or those of a part, say that images are those of a video."""
    return "tracking_hz" in detector.settings or any(map(_tracks, getattr(detector, "parts", {}).values()))


def start(detector: Detector) -> None:
    """Let a detector that has a `start` start, so that the time of its first call is that of any other."""
    getattr(detector, "start", lambda: None)()


def _timed(detector: Detector, workers: int, image: np.ndarray, *boxes_px: np.ndarray) -> Timed:
    start(detector)
    begin = time.perf_counter()
    found = detector.detect(image, *boxes_px)
    return Timed(found, 1e3 * (time.perf_counter() - begin), workers)


def _with_cached_parts(detector: Detector, shown: _Shown) -> Detector:
    """A copy of a detector that asks cached parts; the detector itself if it has none."""
    if not hasattr(detector, "parts"):
        return detector
    result = copy(detector)
    result.parts = {
        name: _with_cached_parts(part, shown) if hasattr(part, "parts") else CachedPart(part, shown)
        for name, part in detector.parts.items()
    }
    return result

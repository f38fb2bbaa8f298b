"""Run a detector over images: timed, with cached results of its parts.

`mediapipe` consists of `mediapipe-pose` and `mediapipe-hands`, a combination of a body and a hand detector;
variants of a combination run on mostly the same squares of the same images. A part runs on the same image or
square only once: its results for whole images are shared with those of the part run alone over the same
files.
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
    """The image that a runner's detector is processing.

    Attributes
    ----------
    workers : int
        Number of runners in parallel.
    image : array, shape (height, width, 3), optional
    image_sha256 : str, optional
        Hash of the file that `image` is from; None if nothing is to be cached.
    owed_ms : list of float
        For each result of a part, its original time minus the time to get it now.
    """

    workers: int
    image: np.ndarray | None = None
    image_sha256: str | None = None
    owed_ms: list[float] = field(default_factory=list)


class Runner:
    """A detector that is run on one image after another.

    Parameters
    ----------
    detector : Detector
        The detector. It is not changed: the runner uses a copy of it, whose `parts`, if any, are cached.
    workers : int
        Number of such runners in parallel.

    Raises
    ------
    InputError
        For a detector whose results depend on earlier images: here they come in any order.
    """

    def __init__(self, detector: Detector, workers: int) -> None:
        if _tracks(detector):
            raise InputError(f"{detector.name}: tracking_hz is for a video, and these images are independent")
        self.detector, self._shown = detector, _Shown(workers)
        self._asked = _with_cached_parts(detector, self._shown)

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
        shown = self._shown
        shown.image, shown.image_sha256 = image, image_sha256
        shown.owed_ms.clear()
        result = _timed(self._asked, shown.workers, image, *(() if boxes_px is None else (boxes_px,)))
        return replace(result, time_ms=result.time_ms + sum(shown.owed_ms))


class CachedPart:
    """A part of a runner's detector: results for an input seen before come from the cache."""

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


def _with_cached_parts(detector: Detector, shown: _Shown) -> Detector:
    """A copy of a detector with cached parts; the detector itself if it has none."""
    if not hasattr(detector, "parts"):
        return detector
    result = copy(detector)
    result.parts = {
        name: _with_cached_parts(part, shown) if hasattr(part, "parts") else CachedPart(part, shown)
        for name, part in detector.parts.items()
    }
    return result

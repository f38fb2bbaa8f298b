"""A detector as it runs over image files: timed, and what its parts find kept on disk.

`mediapipe` is made of `mediapipe-pose` and `mediapipe-hands`, a combination of a body and a hand detector;
variants of a combination look at mostly the same squares of the same images. A part looks at the same image
or square once, whoever asks: its results for whole images lie where the part alone, run over the same files,
keeps its own.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hicp_lib.core.detections import Detections, Detector
from hicp_lib.detectors.runtime.results import (
    Timed,
    cache_folder,
    pixels_sha256,
    read_result,
    result_path,
    write_result,
)


@dataclass
class _Shown:
    """What a runner's detector is being shown.

    Attributes
    ----------
    workers : how many runners work side by side
    image, image_sha256 : the image, and the hash of the file it is from; None if nothing is to be kept
    owed_ms : for each result of a part, what the part took to find it, less what it took to get it now
    """

    workers: int
    image: np.ndarray | None = None
    image_sha256: str | None = None
    owed_ms: list[float] = field(default_factory=list)


class Runner:
    """A detector that is shown one image after another.

    Parameters
    ----------
    detector : what runs; its `parts`, if it has any, are replaced by `Kept` ones
    workers : how many such runners work side by side
    """

    def __init__(self, detector: Detector, workers: int) -> None:
        self.detector, self._shown = detector, _Shown(workers)
        _keep_parts(detector, self._shown)

    def detect(self, image: np.ndarray, boxes_px: np.ndarray | None, image_sha256: str | None) -> Timed:
        """People in an RGB image (height, width, 3), and the time it took; of what was kept, the time then.

        Parameters
        ----------
        boxes_px : (n, 4: x, y, width, height) for detectors that take them, None for the others
        image_sha256 : of the image's file; without it nothing is read from disk or kept there
        """
        shown = self._shown
        shown.image, shown.image_sha256 = image, image_sha256
        shown.owed_ms.clear()
        boxes = () if boxes_px is None else (boxes_px,)
        start(self.detector)
        begin = time.perf_counter()
        found = self.detector.detect(image, *boxes)
        elapsed_ms = 1e3 * (time.perf_counter() - begin)
        return Timed(found, elapsed_ms + sum(shown.owed_ms), shown.workers)


class Kept:
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
        path = None if self._shown.image_sha256 is None else self._path(image, *boxes_px)
        result = path and read_result(path)
        if result is None:
            start(self._detector)
            call = time.perf_counter()
            found = self._detector.detect(image, *boxes_px)
            result = Timed(found, 1e3 * (time.perf_counter() - call), self._shown.workers)
            if path:
                write_result(path, result)
        self._shown.owed_ms.append(result.time_ms - 1e3 * (time.perf_counter() - begin))
        return result.detections

    def _path(self, image: np.ndarray, boxes_px: np.ndarray | None = None) -> Path:
        if image is self._shown.image:
            return result_path(self._folder, self._shown.image_sha256, boxes_px)
        return result_path(self._folder / "squares", pixels_sha256(image), boxes_px)


def start(detector: Detector) -> None:
    """Let a detector that has a `start` start, so that the time of its first call is that of any other."""
    getattr(detector, "start", lambda: None)()


def _keep_parts(detector: Detector, shown: _Shown) -> None:
    parts = getattr(detector, "parts", {})
    for name, part in parts.items():
        if hasattr(part, "parts"):
            _keep_parts(part, shown)
        else:
            parts[name] = Kept(part, shown)

"""Detectors of one kind for the threads of a process."""

from __future__ import annotations

import queue
import time
from collections.abc import Iterator
from contextlib import contextmanager

import cv2
import numpy as np

from hicp_lib.detectors.base import Detector
from hicp_lib.detectors.cache import Timed
from hicp_lib.detectors.registry import make_detector


class DetectorPool:
    """Detectors of one kind, made when a thread needs one and none is idle.

    Attributes
    ----------
    first : one of them, made at once; it tells the settings of all
    """

    def __init__(self, name: str, options: dict) -> None:
        self._name, self._options = name, options
        self.first = make_detector(name, **options)
        self._idle: queue.SimpleQueue[Detector] = queue.SimpleQueue()
        self._idle.put(self.first)

    def detect(self, image: np.ndarray, boxes_px: np.ndarray | None, workers: int) -> Timed:
        """People in an RGB image (height, width, 3), and the time it took beside `workers` - 1 others.

        Boxes (n, 4: x, y, width, height) are for detectors that take them, None for the others.
        """
        with self._borrow() as detector:
            start = time.perf_counter()
            found = detector.detect(image) if boxes_px is None else detector.detect(image, boxes_px)
            return Timed(found, 1e3 * (time.perf_counter() - start), workers)

    @contextmanager
    def _borrow(self) -> Iterator[Detector]:
        try:
            detector = self._idle.get_nowait()
        except queue.Empty:
            detector = make_detector(self._name, **self._options)
        yield detector
        self._idle.put(detector)


@contextmanager
def single_threaded_opencv() -> Iterator[None]:
    """Hold OpenCV to one thread: the images are what is spread."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)

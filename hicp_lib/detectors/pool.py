"""Detectors of one kind for the threads of a process."""

from __future__ import annotations

import queue
from collections.abc import Iterator
from contextlib import contextmanager

import cv2
import numpy as np

from hicp_lib.detectors.cache import Timed
from hicp_lib.detectors.kept import Runner
from hicp_lib.detectors.registry import make_detector


class DetectorPool:
    """Detectors of one kind, made when a thread needs one and none is idle.

    Parameters
    ----------
    name, options : as `make_detector` takes them
    workers : how many threads use them at a time

    Attributes
    ----------
    first : one of them, made at once; it tells the settings of all
    """

    def __init__(self, name: str, options: dict, workers: int) -> None:
        self._name, self._options, self._workers = name, options, workers
        self._idle: queue.SimpleQueue[Runner] = queue.SimpleQueue()
        runner = self._make()
        self.first = runner.detector
        self._idle.put(runner)

    def detect(
        self, image: np.ndarray, boxes_px: np.ndarray | None, image_sha256: str | None = None
    ) -> Timed:
        """As `Runner.detect`, by one that is idle."""
        with self._borrow() as runner:
            return runner.detect(image, boxes_px, image_sha256)

    def _make(self) -> Runner:
        return Runner(make_detector(self._name, **self._options), self._workers)

    @contextmanager
    def _borrow(self) -> Iterator[Runner]:
        try:
            runner = self._idle.get_nowait()
        except queue.Empty:
            runner = self._make()
        yield runner
        self._idle.put(runner)


@contextmanager
def single_threaded_opencv() -> Iterator[None]:
    """Hold OpenCV to one thread: the images are what is spread."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)

"""Detectors of one kind for the threads of a process."""

import queue
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from hicp_lib.detectors.registry import make_detector
from hicp_lib.detectors.runtime.cached_parts import Runner
from hicp_lib.detectors.runtime.isolation import IsolationError
from hicp_lib.detectors.runtime.results import Timed


class DetectorPool:
    """Detectors of one kind, made when a thread needs one and none is idle.

    Parameters
    ----------
    name : str
    options : dict of str to object
        As `make_detector` takes them.
    workers : int
        How many threads use them at a time.

    Attributes
    ----------
    first : hicp_lib.core.detections.Detector
        One of them, made at once; it tells the settings of all.
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
        """As `Runner.detect`, by one that is idle.

        Parameters
        ----------
        image : array, shape (height, width, 3), dtype uint8
        boxes_px : array or None, shape (n, 4: x, y, width, height)
        image_sha256 : str, optional
        """
        try:
            runner = self._idle.get_nowait()
        except queue.Empty:
            runner = self._make()
        result = runner.detect(image, boxes_px, image_sha256)
        self._idle.put(runner)
        return result

    def _make(self) -> Runner:
        return Runner(make_detector(self._name, **self._options), self._workers)


@contextmanager
def naming_image(path: str | Path) -> Iterator[None]:
    """Name the image in what is told of a library that failed on it."""
    try:
        yield
    except IsolationError as error:
        raise IsolationError(f"{path}: {error}") from None

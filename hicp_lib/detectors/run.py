"""Run a detector over many images: all cores, a progress bar, results kept on disk.

The work is spread over threads, not processes: the networks run outside Python's global lock,
and threads need no start-up. Every thread has its own detector, and OpenCV is held to one
thread in each, so the results do not depend on how many there are.
"""

from __future__ import annotations

import os
import queue
import time
from collections.abc import Hashable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
from tqdm import tqdm

from hicp_lib.annotations import read_annotations
from hicp_lib.detectors.base import Detections, Detector
from hicp_lib.detectors.cache import Timed, cache_folder, read_result, write_result
from hicp_lib.detectors.registry import make_detector
from hicp_lib.errors import InputError
from hicp_lib.files import sha256_bytes, sha256_file
from hicp_lib.images import read_image

Key = TypeVar("Key", bound=Hashable)


def detect_dataset(
    name: str, dataset_dir: str | Path, workers: int | None = None, progress: bool = True, **options
) -> dict[int, Detections]:
    """People in every image of a dataset folder (`images/`, `annotations.json`), by image id.

    Parameters as in `detect_images`; the annotated boxes go to detectors that take them.
    """
    results = time_dataset(name, dataset_dir, workers, progress, **options)
    return {image_id: result.detections for image_id, result in results.items()}


def time_dataset(
    name: str, dataset_dir: str | Path, workers: int | None = None, progress: bool = True, **options
) -> dict[int, Timed]:
    """As `detect_dataset`, each with the time it took."""
    annotations = read_annotations(Path(dataset_dir) / "annotations.json")
    paths = {
        image_id: Path(dataset_dir) / "images" / image.file_name
        for image_id, image in annotations.images.items()
    }
    people = annotations.take(~annotations.is_crowd)
    boxes_px = {image_id: people.boxes_px[people.image_ids == image_id] for image_id in paths}
    return detect_images(name, paths, workers, progress, boxes_px, **options)


def detect_images(
    name: str,
    paths: Mapping[Key, str | Path],
    workers: int | None = None,
    progress: bool = True,
    boxes_px: Mapping[Key, np.ndarray] | None = None,
    **options,
) -> dict[Key, Timed]:
    """People in every image file.

    Parameters
    ----------
    name : detector, see `hicp_lib.detectors.registry`
    paths : image files by any key
    workers : threads (the cores this process may use, if None)
    progress : show a bar; only ever on a terminal
    boxes_px : annotated boxes (n, 4: x, y, width, height) of each image, for detectors that take them
    options : options of the detector

    Returns
    -------
    The result of each image, in the order of `paths`.

    Raises
    ------
    InputError
        If an image cannot be read, or the detector cannot be made.
    """
    workers = max(1, min(workers or n_cores(), len(paths) or 1))
    pool = _DetectorPool(name, options)
    folder = cache_folder(pool.first)
    takes_boxes = boxes_px is not None and getattr(pool.first, "takes_boxes", False)

    def process(key: Key) -> Timed:
        return _detect_one(pool, Path(paths[key]), boxes_px[key] if takes_boxes else None, folder, workers)

    with _single_threaded_opencv(), ThreadPoolExecutor(workers) as executor:
        # disable=None: no bar unless standard error is a terminal.
        results = tqdm(
            executor.map(process, paths),
            desc=name,
            total=len(paths),
            disable=None if progress else True,
        )
        return dict(zip(paths, results, strict=True))


class _DetectorPool:
    """Detectors of one kind, made when a thread needs one and none is idle."""

    def __init__(self, name: str, options: dict) -> None:
        self._name, self._options = name, options
        self.first = make_detector(name, **options)
        self._idle: queue.SimpleQueue[Detector] = queue.SimpleQueue()
        self._idle.put(self.first)

    @contextmanager
    def borrow(self) -> Iterator[Detector]:
        try:
            detector = self._idle.get_nowait()
        except queue.Empty:
            detector = make_detector(self._name, **self._options)
        yield detector
        self._idle.put(detector)


def _detect_one(
    pool: _DetectorPool, path: Path, boxes_px: np.ndarray | None, folder: Path, workers: int
) -> Timed:
    boxes_key = "" if boxes_px is None else "-" + sha256_bytes(np.asarray(boxes_px, float).tobytes())[:16]
    try:
        kept = folder / f"{sha256_file(path)}{boxes_key}.bin"
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); expected an image file") from None
    result = read_result(kept)
    if result is None:
        image = read_image(path)
        with pool.borrow() as detector:
            start = time.perf_counter()
            found = detector.detect(image) if boxes_px is None else detector.detect(image, boxes_px)
            result = Timed(found, 1e3 * (time.perf_counter() - start), workers)
        write_result(kept, result)
    return result


@contextmanager
def _single_threaded_opencv() -> Iterator[None]:
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


def n_cores() -> int:
    """Cores this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1

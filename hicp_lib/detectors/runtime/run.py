"""Run a detector over many images: all cores or a cluster, a progress bar, results kept on disk.

Each result is kept as soon as it is there, so a run that was cut off goes on where it was. On a cluster, the
images' bytes travel, and the workers need the weights.

The work is spread over threads, not processes: the networks run outside Python's global lock,
and threads need no start-up. Every thread has its own detector, and OpenCV is held to one
thread in each, so the results do not depend on how many there are.
"""

import threading
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path

import numpy as np
from tqdm import tqdm

from hicp_lib.core.detections import Detections
from hicp_lib.core.executor import Workers, resolved, run_jobs, threads_beside
from hicp_lib.core.files import sha256_bytes
from hicp_lib.core.images import decode_image, image_bytes
from hicp_lib.detectors.registry import make_detector
from hicp_lib.detectors.runtime.cached_parts import Runner
from hicp_lib.detectors.runtime.isolation import IsolationError
from hicp_lib.detectors.runtime.results import (
    Key,
    Timed,
    cache_folder,
    detections_of,
    identity,
    read_result,
    result_path,
    write_result,
)
from hicp_lib.formats.annotations import Annotations, read_annotations


def detect_dataset(name: str, dataset_dir: str | Path, **options) -> dict[int, Detections]:
    """As `time_dataset`, without the times.

    Parameters
    ----------
    name : str
    dataset_dir : path
    **options : object
        As of `time_dataset`.

    Returns
    -------
    dict of int to Detections
    """
    return detections_of(time_dataset(name, dataset_dir, **options))


def time_dataset(name: str, dataset_dir: str | Path, **options) -> dict[int, Timed]:
    """People in every image of a dataset folder (`images/`, `annotations.json`), by image id.

    Parameters
    ----------
    name : str
    dataset_dir : path
    **options : object
        As of `detect_annotated`.

    Returns
    -------
    dict of int to Timed
    """
    folder = Path(dataset_dir)
    return detect_annotated(name, read_annotations(folder / "annotations.json"), folder / "images", **options)


def detect_annotated(
    name: str, annotations: Annotations, images_dir: str | Path, **options
) -> dict[int, Timed]:
    """People in every annotated image, by image id.

    The annotated boxes go to detectors that take them.

    Parameters
    ----------
    name : str
    annotations : Annotations
    images_dir : path
        Folder of the images.
    **options : object
        As of `detect_images`.

    Returns
    -------
    dict of int to Timed
    """
    paths = {i: Path(images_dir) / image.file_name for i, image in annotations.images.items()}
    people = annotations.take(~annotations.is_crowd)
    boxes_px = {image_id: people.boxes_px[people.image_ids == image_id] for image_id in paths}
    return detect_images(name, paths, boxes_px=boxes_px, **options)


def detect_images(
    name: str,
    paths: Mapping[Key, str | Path],
    workers: Workers = None,
    progress: bool = True,
    boxes_px: Mapping[Key, np.ndarray] | None = None,
    **options,
) -> dict[Key, Timed]:
    """People in every image file.

    Parameters
    ----------
    name : str
        Detector, see `hicp_lib.detectors.registry`.
    paths : dict of object to path
        Image files by any key.
    workers : int or str, optional
        Threads, or the address of a Dask scheduler (`hicp_lib.core.executor.resolved`).
    progress : bool, default True
        Show a bar; only ever on a terminal.
    boxes_px : dict of object to array, optional
        Annotated boxes (n, 4: x, y, width, height) of each image, for detectors that take them.
    **options : object
        Of the detector.

    Returns
    -------
    dict of object to Timed
        By the keys of `paths`, in their order.

    Raises
    ------
    InputError
        If an image cannot be read, or the detector cannot be made.
    """
    workers = resolved(workers)
    n_here = None if isinstance(workers, str) else max(1, min(workers, len(paths)))
    asked = name, options, n_here
    detector = _runner(*asked).detector  # it looks, too, where the caller does the work
    boxes_px = boxes_px if getattr(detector, "takes_boxes", False) else None
    folder, kept, done = cache_folder(detector), {}, {}

    def missing() -> Iterator[tuple[Key, Callable[[], Timed]]]:
        for key, path in paths.items():
            content, boxes = image_bytes(path), None if boxes_px is None else boxes_px[key]
            sha256 = sha256_bytes(content)
            kept[key] = result_path(folder, sha256, boxes)
            result = read_result(kept[key])
            if result is None:
                # Of a combination's parts, only what is found here is kept.
                yield key, partial(_detect, asked, content, str(path), boxes, sha256 if n_here else None)
            else:
                done[key] = result

    alike = partial(_identity, asked)
    found = run_jobs(missing(), n_here or workers, "threads", alike=alike, named=paths.__getitem__)
    # disable=None: no bar unless standard error is a terminal.
    try:
        with tqdm(desc=name, total=len(paths), disable=None if progress else True) as bar:
            for key, result in found:
                write_result(kept[key], result)
                done[key] = result
                bar.update(len(done) - bar.n)
    finally:
        _made.__dict__.clear()
    return {key: done[key] for key in paths}


_made = threading.local()  # each thread's own detector, the one that was asked for last


def _runner(name: str, options: dict, workers: int | None) -> Runner:
    asked = name, options, workers
    if getattr(_made, "asked", None) != asked:
        _made.runner = Runner(make_detector(name, **options), workers or threads_beside())
        _made.asked = asked
    return _made.runner


def _identity(asked: tuple) -> dict:
    return identity(_runner(*asked).detector)


def _detect(
    asked: tuple, content: bytes, path: str, boxes_px: np.ndarray | None, sha256: str | None
) -> Timed:
    try:
        return _runner(*asked).detect(decode_image(content, path), boxes_px, sha256)
    except IsolationError as error:
        raise IsolationError(f"{path}: {error}") from None

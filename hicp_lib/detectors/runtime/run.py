"""Run a detector over many images: all cores or a cluster, a progress bar, results kept on disk.

Each result is kept as soon as it is there, so a run that was cut off goes on where it was.

The work is spread over threads, not processes: the networks run outside Python's global lock,
and threads need no start-up. Every thread has its own detector, and OpenCV is held to one
thread in each, so the results do not depend on how many there are.
"""

from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from tqdm import tqdm

from hicp_lib.core.detections import Detections
from hicp_lib.core.environment import usable_cores
from hicp_lib.core.files import sha256_bytes
from hicp_lib.core.images import decode_image, image_bytes
from hicp_lib.detectors.runtime.pool import DetectorPool, naming_image, single_threaded_opencv
from hicp_lib.detectors.runtime.results import Key, Timed, cache_folder, cached, detections_of, result_path
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
    workers: int | None = None,
    progress: bool = True,
    boxes_px: Mapping[Key, np.ndarray] | None = None,
    dask: str | None = None,
    **options,
) -> dict[Key, Timed]:
    """People in every image file.

    Parameters
    ----------
    name : str
        Detector, see `hicp_lib.detectors.registry`.
    paths : dict of object to path
        Image files by any key.
    workers : int, optional
        Threads (the cores this process may use, if None).
    progress : bool, default True
        Show a bar; only ever on a terminal.
    boxes_px : dict of object to array, optional
        Annotated boxes (n, 4: x, y, width, height) of each image, for detectors that take them.
    dask : str, optional
        Address of a Dask scheduler, whose workers do what threads do otherwise.
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
    workers = max(1, min(workers or usable_cores(), len(paths) or 1))
    pool = DetectorPool(name, options, workers)
    boxes_px = boxes_px if getattr(pool.first, "takes_boxes", False) else None
    jobs = {key: (Path(path), None if boxes_px is None else boxes_px[key]) for key, path in paths.items()}
    if dask is None:
        results = _in_threads(pool, jobs, workers)
    else:
        from hicp_lib.detectors.runtime.cluster import detect_on_cluster  # the library is an extra

        results = detect_on_cluster(dask, name, options, pool.first, jobs)
    # disable=None: no bar unless standard error is a terminal.
    done = dict(tqdm(results, desc=name, total=len(jobs), disable=None if progress else True))
    return {key: done[key] for key in paths}


def _in_threads(
    pool: DetectorPool, jobs: dict[Key, tuple[Path, np.ndarray | None]], workers: int
) -> Iterator[tuple[Key, Timed]]:
    folder = cache_folder(pool.first)
    with single_threaded_opencv, ThreadPoolExecutor(workers) as executor:
        calls = executor.map(lambda job: _detect_one(pool, folder, *job), jobs.values())
        yield from zip(jobs, calls, strict=True)


def _detect_one(pool: DetectorPool, folder: Path, path: Path, boxes_px: np.ndarray | None) -> Timed:
    content = image_bytes(path)
    sha256 = sha256_bytes(content)
    with naming_image(path):
        return cached(
            result_path(folder, sha256, boxes_px),
            lambda: pool.detect(decode_image(content, path), boxes_px, sha256),
        )

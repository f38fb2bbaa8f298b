"""Run a detector over many images: on all cores or a cluster, with a progress bar and a cache of results.

Each result is cached as soon as it is found, so that an interrupted run continues where it stopped. On a
cluster, images are sent as bytes, and the workers need the weights. Results are yielded in the order of the
images as soon as all earlier ones are done, and then released: a million images take no more memory than a
thousand.

Work is distributed over threads, not processes: the networks run outside Python's global lock, and threads
start at once. Every thread has its own detector, and OpenCV is limited to one thread in each, so results do
not depend on their number.
"""

import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.executor import Workers, resolved, run_jobs, threads_beside
from hicp_lib.core.files import read_bytes, sha256_bytes
from hicp_lib.core.images import decode_image, note_rotation
from hicp_lib.detectors.registry import make_detector
from hicp_lib.detectors.runtime import results
from hicp_lib.detectors.runtime.isolation import IsolationError
from hicp_lib.detectors.runtime.results import Key, Runner, Timed
from hicp_lib.formats.annotations import Annotations, read_annotations, refuse_other_sizes, rows_by_image

Image = str | Path | np.ndarray  # a file, or RGB, shape (height, width, 3), uint8
_MOST_WAITING = 4096  # results in memory that wait for an earlier image's


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
    return results.detections_of(time_dataset(name, dataset_dir, **options))


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

    Detectors that take boxes get the annotated ones.

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

    Raises
    ------
    InputError
        If an image is of another size than annotated; and as of `detect_images`.
    """
    refuse_other_sizes(annotations, Path(images_dir))
    paths = {i: Path(images_dir) / image.file_name for i, image in annotations.images.items()}
    return detect_images(name, paths, boxes_px=boxes_by_image(annotations), **options)


def boxes_by_image(annotations: Annotations) -> dict[int, np.ndarray]:
    """The annotated people's boxes, arrays (n, 4: x, y, width, height), by image id."""
    people = annotations.take(~annotations.is_crowd)
    rows, nobody = rows_by_image(people.image_ids), np.zeros(0, int)
    return {image_id: people.boxes_px[rows.get(image_id, nobody)] for image_id in annotations.images}


def detect_images(
    name: str, paths: Mapping[Key, str | Path], workers: Workers = None, progress: bool = True, boxes_px:
    Mapping[Key, np.ndarray] | None = None, **options,
) -> dict[Key, Timed]:  # fmt: skip
    """People in every image file.

    Parameters
    ----------
    name : str
        Detector, see `hicp_lib.detectors.registry`.
    paths : dict of object to path
        Image files by arbitrary keys.
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
    by_key = {}
    each = detect_each(name, paths.items(), workers, progress, boxes_px, len(paths), **options)
    with closing(each):
        for key, found in each:
            if isinstance(found, InputError):
                raise found
            by_key[key] = found
    return by_key


@dataclass(eq=False)
class _Waiting:
    """An image whose result has not been yielded yet."""

    key: Any
    name: str
    kept: Path = Path()  # where its result is cached
    found: Timed | InputError | Path | None = None


def detect_each(
    name: str, images: Iterable[tuple[Key, Image]], workers: Workers = None, progress: bool = True,
    boxes_px: Mapping[Key, np.ndarray] | None = None, n_images: int | None = None,
    flagged: dict[str, int] | None = None, **options,
) -> Generator[tuple[Key, Timed | InputError], None, None]:  # fmt: skip
    """People image by image; results are not held after they are yielded.

    Parameters
    ----------
    name : str
    images : iterable of (object, path or array)
        Unique keys with image files or RGB arrays; taken as workers become free.
    workers : int or str, optional
    progress : bool, default True
    boxes_px : dict of object to array, optional
        As for `detect_images`.
    n_images : int, optional
        How many there are, if that is known.
    flagged : dict of str to int, optional
        Filled with the rotation flags of files that have one, by the files' names.
    **options : object
        Of the detector.

    Yields
    ------
    (object, Timed or InputError)
        In the order of `images`; for an image that cannot be read, the error.

    Raises
    ------
    InputError
        If the detector cannot be made, or fails.
    """
    workers = resolved(workers)
    n_here = None if isinstance(workers, str) else max(1, min(workers, n_images or workers))
    asked = name, options, n_here
    detector = _runner(*asked).detector  # also used if the caller does the work
    boxes_px = boxes_px if getattr(detector, "takes_boxes", False) else None
    folder, waiting = results.cache_folder(detector), deque[_Waiting]()

    def jobs() -> Iterator[tuple[_Waiting, Callable[[], Timed | str] | None]]:
        for key, image in images:
            one = _Waiting(key, f"image {key}" if isinstance(image, np.ndarray) else str(image))
            waiting.append(one)
            try:
                content, sha256 = _content(image)
            except InputError as error:
                one.found = error
                yield one, None
                continue
            if flagged is not None and isinstance(content, bytes):
                note_rotation(content, one.name, flagged)
            boxes = None if boxes_px is None else boxes_px[key]
            one.kept = results.result_path(folder, sha256, boxes)
            result = results.read_result(one.kept)
            one.found = one.kept if result and len(waiting) > _MOST_WAITING else result
            # A combination's parts are cached only for images processed on this machine.
            part_key = sha256 if n_here else None
            yield one, None if result else partial(_detect, asked, content, one.name, boxes, part_key)

    alike, named = partial(_identity, asked), attrgetter("name")
    # disable=None: no bar unless standard error is a terminal.
    try:
        with tqdm(desc=name, total=n_images, disable=None if progress else True) as bar:
            for one, found in run_jobs(jobs(), n_here or workers, "threads", alike=alike, named=named):
                if isinstance(found, Timed):
                    results.write_result(one.kept, found)
                    one.found = one.kept if len(waiting) > _MOST_WAITING else found
                elif found is not None:
                    one.found = InputError(found)
                while waiting and (first := waiting[0].found) is not None:
                    bar.update()
                    yield waiting.popleft().key, _read_again(first) if isinstance(first, Path) else first
    finally:
        _made.__dict__.clear()


def _read_again(kept: Path) -> Timed | InputError:
    gone = InputError(f"{kept}: was removed while it was needed; run the same command again")
    return results.read_result(kept) or gone


def _content(image: Image) -> tuple[bytes | np.ndarray, str]:
    """The content of an image for a job, and its hash."""
    if isinstance(image, np.ndarray):
        return image, results.pixels_sha256(image)
    content = read_bytes(image, "expected an image file")
    return content, sha256_bytes(content)


_made = threading.local()  # each thread's own detector, the last one used


def _runner(name: str, options: dict, workers: int | None) -> Runner:
    asked = name, options, workers
    if getattr(_made, "asked", None) != asked:
        _made.runner = Runner(make_detector(name, **options), workers or threads_beside())
        _made.asked = asked
    return _made.runner


def _identity(asked: tuple) -> dict:
    return results.identity(_runner(*asked).detector)


def _detect(
    asked: tuple, image: bytes | np.ndarray, named: str, boxes_px: np.ndarray | None, sha256: str | None
) -> Timed | str:
    """The result for an image, or the error if it cannot be read: raising it would stop the others."""
    runner = _runner(*asked)
    try:
        pixels = decode_image(image, named) if isinstance(image, bytes) else image
    except InputError as error:
        return str(error)
    try:
        return runner.detect(pixels, boxes_px, sha256)
    except IsolationError as error:
        raise IsolationError(f"{named}: {error}") from None

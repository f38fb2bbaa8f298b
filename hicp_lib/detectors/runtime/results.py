"""Detections cached on disk, one small file per image, valid only while nothing has changed.

The key is the SHA-256 of everything a result depends on: the image file's bytes, the detector's name and
settings (with its weights' hashes), and the import closure of the code of the detector and its parts
(`hicp_lib.core.cache`). A stale or damaged file is ignored and computed again.
"""

from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from hicp_lib.core.cache import code_identity, digest
from hicp_lib.core.detections import Detections, Detector
from hicp_lib.core.files import cache_dir, read_checked, sha256_bytes, write_checked
from hicp_lib.core.keypoints import N_KEYPOINTS

Key = TypeVar("Key", bound=Hashable)
_N_COLUMNS = 3 * N_KEYPOINTS + 1


@dataclass(frozen=True)
class Timed:
    """Detections in one image, and the time it took.

    Attributes
    ----------
    detections : Detections
        The people found.
    time_ms : float
        Time of the detector's original call (cached results, also of parts, keep their time).
    workers : int
        How many such calls ran in parallel then; more of them make each slower.
    """

    detections: Detections
    time_ms: float
    workers: int


def detections_of(results: Mapping[Key, Timed]) -> dict[Key, Detections]:
    """Results without their times, by the same keys in the same order."""
    return {key: result.detections for key, result in results.items()}


def identity(detector: Detector) -> dict:
    """Everything that this detector's results depend on, besides the image."""
    return {"settings": detector.settings} | code_identity(__name__, *_modules(detector))


def _modules(detector: Detector) -> Iterator[str]:
    yield type(detector).__module__
    for part in getattr(detector, "parts", {}).values():
        yield from _modules(part)


def cache_folder(detector: Detector) -> Path:
    """Folder of this detector's results with its current settings."""
    return cache_dir() / "detections" / detector.name / digest(identity(detector))[:32]


def pixels_sha256(image: np.ndarray) -> str:
    """SHA-256 of an image that is not a file."""
    return sha256_bytes(f"{image.dtype} {image.shape}".encode() + image.tobytes())


def result_path(folder: Path, image_sha256: str, boxes_px: np.ndarray | None) -> Path:
    """Where the result of an image is cached.

    Parameters
    ----------
    folder : Path
    image_sha256 : str
    boxes_px : array or None, shape (n, 4)
        Part of the key if given.

    Examples
    --------
    >>> result_path(Path("kept"), "ab12", None).as_posix()
    'kept/ab12.bin'
    """
    boxes_key = "" if boxes_px is None else "-" + sha256_bytes(np.asarray(boxes_px, float).tobytes())[:16]
    return folder / f"{image_sha256}{boxes_key}.bin"


def cached(path: Path | None, make: Callable[[], Timed]) -> Timed:
    """The result cached at `path`, or else that of `make`, which is then cached there.

    Parameters
    ----------
    path : Path or None
        None: no cache.
    make : callable

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "a.bin"
    ...     first = cached(path, lambda: Timed(Detections.none(), 12.5, 1))
    ...     again = cached(path, lambda: None)
    >>> again.time_ms, again.workers, len(again.detections)
    (12.5, 1, 0)
    """
    result = read_result(path) if path else None
    if result is None:
        result = make()
        if path:
            write_result(path, result)
    return result


def read_result(path: Path) -> Timed | None:
    """The result cached at `path`; None if there is none or it is damaged."""
    payload = read_checked(path)
    if payload is None:
        return None
    values = np.frombuffer(payload).copy()
    rows = values[2:].reshape(-1, _N_COLUMNS)
    keypoints_px = rows[:, : 2 * N_KEYPOINTS].reshape(-1, N_KEYPOINTS, 2)
    found = Detections(keypoints_px, rows[:, 2 * N_KEYPOINTS : -1], rows[:, -1])
    return Timed(found, float(values[0]), int(values[1]))


def write_result(path: Path, result: Timed) -> None:
    """Cache a result at `path`; another process may do the same at the same time.

    The file is checked (`hicp_lib.core.files.write_checked`) and holds 64-bit floats: time and workers, then
    per person positions, scores and person score. One person fits in one block of a disk.
    """
    found = result.detections
    positions = found.keypoints_px.reshape(len(found), 2 * N_KEYPOINTS)
    people = np.column_stack([positions, found.scores, found.person_scores])
    write_checked(path, np.concatenate([[result.time_ms, result.workers], people.ravel()]).tobytes())

"""Detections kept on disk, one small file per image, found again only if nothing changed.

The key is the SHA-256 of everything a result depends on: the image file's bytes, the
detector's name and settings (with its weights' hashes), the versions of the libraries that
decode and compute, and the source of this package's detectors. A stale or damaged file is
never an answer: it is computed again.
"""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from hicp_lib import keypoints
from hicp_lib.detectors.base import Detections, Detector
from hicp_lib.files import cache_dir, sha256_bytes, sha256_file, write_bytes


@dataclass(frozen=True)
class Timed:
    """Detections in one image, and what finding them took.

    Attributes
    ----------
    detections : the people found
    time_ms : time of the detector's call when it was made (a cached result keeps its time)
    workers : how many such calls ran side by side then; more of them make each slower
    """

    detections: Detections
    time_ms: float
    workers: int


@cache
def code_sha256() -> str:
    """SHA-256 over the sources that turn network output into keypoints."""
    sources = sorted(Path(__file__).parent.glob("*.py")) + [Path(keypoints.__file__)]
    return sha256_bytes("".join(sha256_file(source) for source in sources).encode())


def cache_folder(detector: Detector) -> Path:
    """Folder of this detector's results under its present settings."""
    identity = {
        "settings": detector.settings,
        "code": code_sha256(),
        "libraries": {"numpy": np.__version__, "opencv": cv2.__version__},
    }
    key = sha256_bytes(json.dumps(identity, sort_keys=True).encode())
    return cache_dir() / "detections" / detector.name / key[:32]


def read_result(path: Path) -> Timed | None:
    """The result kept at `path`; None if there is none or it is damaged."""
    try:
        with np.load(path, allow_pickle=False) as arrays:
            found = Detections(arrays["keypoints_px"], arrays["scores"], arrays["person_scores"])
            time_ms, workers = arrays["timing"]
    except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile):
        return None
    n = len(found.person_scores)
    if found.keypoints_px.shape != (n, keypoints.N_KEYPOINTS, 2) or found.scores.shape != (
        n,
        keypoints.N_KEYPOINTS,
    ):
        return None
    return Timed(found, float(time_ms), int(workers))


def write_result(path: Path, result: Timed) -> None:
    """Keep a result at `path`; another process may do the same at the same time."""
    content = io.BytesIO()
    np.savez(
        content,
        keypoints_px=result.detections.keypoints_px,
        scores=result.detections.scores,
        person_scores=result.detections.person_scores,
        timing=np.array([result.time_ms, result.workers], dtype=float),
    )
    write_bytes(path, content.getvalue())

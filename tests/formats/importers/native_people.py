"""Images and people for the importers' tests; the native files are written by `tools/native_files.py`."""

import sys
from pathlib import Path

import numpy as np

from hicp_lib.formats.annotations import Annotations, ImageInfo

sys.path.insert(0, str(Path(__file__).parents[3] / "tools"))

from native_files import Person, standing_person  # noqa: E402

NAMES = {785: "000000000785.jpg", 1296: "000000001296.jpg", 2006: "000000002006.jpg"}


def annotated(names: dict[int, str], size=(640, 480)) -> Annotations:
    """Images without annotated people."""
    images = {i: ImageInfo(i, name, *size) for i, name in names.items()}
    none = np.zeros(0, dtype=int)
    return Annotations(
        images, none, none, np.zeros((0, 4)), np.zeros(0), np.zeros(0, dtype=bool), np.zeros((0, 136, 2)),
        np.zeros((0, 136)), [],
    )  # fmt: skip


def make_person(seed: int = 0, **changes) -> Person:
    rng = np.random.default_rng(seed)
    points = standing_person((320, 240), 400, rng)
    return Person(**{"points_px": points, "scores": rng.uniform(0.05, 1, 136), "score": 0.9} | changes)

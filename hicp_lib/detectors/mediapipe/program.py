"""MediaPipe's program: the installed package, or the one fetched into the cache like weights.

Its wheel requires opencv-contrib-python, whose files would overwrite those of opencv-python-headless, which
everything here uses, and which does not load without a display. The parts of MediaPipe used here need no
OpenCV. So no extra names the wheel: pip installs it alone, checked against the hashes in
`data/mediapipe.txt`, into a folder that only MediaPipe's own process searches.
"""

import os
import tempfile
from collections.abc import Sequence
from importlib.metadata import distributions
from importlib.util import find_spec
from pathlib import Path

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.core.extras import require
from hicp_lib.core.files import cache_dir, sha256_file
from hicp_lib.detectors.weights.downloads import run_pip

REQUIREMENT_FILE = DATA_DIR / "mediapipe.txt"


def program_folder() -> Path:
    """The folder of the package `mediapipe`.

    Raises
    ------
    InputError
        If it is neither installed nor fetched, or the extra with its dependencies is missing.
    """
    package = find_spec("mediapipe")
    if package is not None and package.submodule_search_locations:
        return Path(package.submodule_search_locations[0])
    require("mediapipe", "absl")
    if not _fetched().is_dir():
        raise InputError(f"{_fetched()}: MediaPipe is absent; get it with: hicp models fetch mediapipe")
    return _fetched() / "mediapipe"


def program_version() -> str:
    """The version of that package."""
    beside = str(program_folder().parent)
    return next(iter(distributions(name="mediapipe", path=[beside]))).version


def is_wanted(detectors: Sequence[str]) -> bool:
    """Whether to fetch it too: one of its own weights is named, or none is and the extra is installed."""
    named = any(name.startswith("mediapipe") for name in detectors)
    return named or (not detectors and find_spec("absl") is not None)


def fetch_program() -> bool:
    """Fetch MediaPipe if it is absent; returns whether it was fetched.

    Raises
    ------
    InputError
        If pip cannot get it, or the package index gives another file.
    """
    if find_spec("mediapipe") is not None or _fetched().is_dir():
        return False
    _fetched().parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=_fetched().parent, prefix=".partial-") as folder:
        target = Path(folder) / "site"
        problem = run_pip("install", "--requirement", str(REQUIREMENT_FILE), "--target", str(target))
        if problem:
            raise InputError(
                f"MediaPipe: pip could not put it into the cache ({problem}); check the network, "
                "and that there is a wheel for this system"
            )
        os.replace(target, _fetched())
    return True


def _fetched() -> Path:
    return cache_dir() / "programs" / f"mediapipe-{sha256_file(REQUIREMENT_FILE)[:12]}"

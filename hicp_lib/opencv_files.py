"""Which distribution's OpenCV is installed: four of them lay the same files, and the last one wins."""

from __future__ import annotations

import base64
import hashlib
from importlib.metadata import Distribution, PackageNotFoundError, distribution

WANTED = "opencv-python-headless"
_OTHERS = ("opencv-contrib-python", "opencv-contrib-python-headless", "opencv-python")


def overwritten() -> tuple[str, str] | None:
    """What is wrong with the files of `cv2`, and the command that mends it; None if they are as installed."""
    wanted = _installed(WANTED)
    others = [name for name in _OTHERS if _installed(name)]
    if wanted is None:
        names = " ".join(others)
        return f"{names or 'OpenCV'} in the place of {WANTED}", _remedy(names, WANTED)
    changed = [str(file) for file in _files(wanted) if not _is_as_recorded(file)]
    if not changed:
        return None
    names = " ".join(others)
    cause = f"overwritten by {names}" if others else "damaged"
    return f"{WANTED} is {cause} ({changed[0]})", _remedy(names, f"{WANTED}=={wanted.version}")


def _remedy(others: str, requirement: str) -> str:
    uninstall = f"pip uninstall -y {others}; " if others else ""
    return f"{uninstall}pip install --force-reinstall --no-deps {requirement}"


def _installed(name: str) -> Distribution | None:
    try:
        return distribution(name)
    except PackageNotFoundError:
        return None


def _files(installed: Distribution) -> list:
    return [file for file in installed.files or () if file.parts[0] == "cv2" and file.hash is not None]


def _is_as_recorded(file) -> bool:
    try:
        found = hashlib.new(file.hash.mode, file.locate().read_bytes()).digest()
    except OSError:
        return False
    return base64.urlsafe_b64encode(found).decode().rstrip("=") == file.hash.value

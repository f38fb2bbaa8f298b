"""Which distribution's OpenCV is installed: four of them lay the same files, and the last one wins."""

import base64
import csv
import hashlib
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

WANTED = "opencv-python-headless"
_OTHERS = ("opencv-contrib-python", "opencv-contrib-python-headless", "opencv-python")


def overwritten() -> tuple[str, str] | None:
    """What is wrong with the files of `cv2`, and the command that mends it; None if they are as installed."""
    wanted = _installed(WANTED)
    others = " ".join(name for name in _OTHERS if _installed(name))
    if wanted is None:
        return f"{others or 'OpenCV'} in the place of {WANTED}", _remedy(others, WANTED)
    folder = Path(str(wanted.locate_file("")))
    changed = [name for name, sha256 in _recorded(wanted) if _sha256(folder / name) != sha256]
    if not changed:
        return None
    cause = f"overwritten by {others}" if others else "damaged"
    return f"{WANTED} is {cause} ({changed[0]})", _remedy(others, f"{WANTED}=={wanted.version}")


def _remedy(others: str, requirement: str) -> str:
    uninstall = f"pip uninstall -y {others}; " if others else ""
    return f"{uninstall}pip install --force-reinstall --no-deps {requirement}"


def _installed(name: str) -> Distribution | None:
    try:
        return distribution(name)
    except PackageNotFoundError:
        return None


def _recorded(installed: Distribution) -> list[tuple[str, str]]:
    """Files of `cv2` and their hashes, those that are gone too: `Distribution.files` may leave these out."""
    rows = csv.reader((installed.read_text("RECORD") or "").splitlines())
    listed = [(name, stated.removeprefix("sha256=")) for name, stated, _ in rows if stated]
    return [(name, sha256) for name, sha256 in listed if name.startswith("cv2/")]


def _sha256(path: Path) -> str | None:
    """As a distribution's record writes it; None of a file that is not there."""
    try:
        digest = hashlib.sha256(path.read_bytes()).digest()
    except OSError:
        return None
    return base64.urlsafe_b64encode(digest).decode().rstrip("=")

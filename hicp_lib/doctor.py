"""`hicp doctor`: what the study needs from this machine, found or missing, and how to mend it."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from hicp_lib import provenance
from hicp_lib.checkout import working_folder
from hicp_lib.errors import InputError
from hicp_lib.files import cache_dir
from hicp_lib.opencv_files import WANTED, overwritten
from hicp_lib.system_libraries import DEBIAN_PACKAGES, missing_packages

PYTHONS = ((3, 11), (3, 14))
MIN_FREE_GB = 3.0
_IMPORTS = ("cv2", "mediapipe", "onnxruntime", "open3d", "pandas", "papermill", "pycocotools", "sphinx")


@dataclass(frozen=True)
class Check:
    """One line of the doctor: what was looked at, what was found, and what to do if it is not well."""

    name: str
    is_ok: bool
    finding: str
    remedy: str = ""


def run_checks() -> list[Check]:
    """Every check; none of them raises, and none contacts a network."""
    return [
        check_python(),
        check_system_libraries(),
        check_locked_versions(provenance.LOCK_PATH),
        check_opencv(),
        check_imports(_IMPORTS),
        check_weights(),
        *check_folder("cache", cache_dir(), "set HICP_CACHE to a folder you may write to"),
        *check_folder("results", working_folder() / "results", "give yourself the right to write there"),
    ]


def check_python() -> Check:
    """The version, and that it runs in an environment of its own."""
    oldest, newest = PYTHONS
    is_ok = oldest <= sys.version_info[:2] <= newest
    remedy = "make it anew with a Python from 3.11 to 3.14: rm -r .venv; make report PYTHON=python3.12"
    return Check("Python", is_ok, platform.python_version(), remedy)


def check_system_libraries() -> Check:
    """What Open3D loads and a bare Debian lacks."""
    missing = missing_packages()
    finding = f"missing: {' '.join(missing)}" if missing else f"{len(DEBIAN_PACKAGES)} found"
    return Check("system libraries", not missing, finding, f"sudo apt-get install {' '.join(missing)}")


def check_locked_versions(lock_path: Path) -> Check:
    """That what is installed is what the lock says."""
    remedy = "rm .venv/.installed; make report"
    if provenance.CHECKOUT is None:
        return Check("locked environment", True, "none: hicp was installed without a checkout")
    try:
        locked = dict(locked_versions(lock_path.read_text()))
    except OSError as error:
        return Check(
            "locked environment", False, f"{lock_path}: {error.strerror}", "git restore environment.lock"
        )
    wrong = [f"{name} {_installed(name)} instead of {version}" for name, version in locked.items()
             if _installed(name) != version]  # fmt: skip
    finding = f"{len(wrong)} differ: {', '.join(wrong[:3])}" if wrong else f"{len(locked)} packages as locked"
    return Check("locked environment", not wrong, finding, remedy)


def locked_versions(lock: str) -> Iterator[tuple[str, str]]:
    """(name, version) of each locked package that is meant for this Python and system."""
    from packaging.requirements import Requirement

    for line in re.findall(r"^[A-Za-z0-9][^\\\n]*==[^\\\n]+", lock, re.MULTILINE):
        requirement = Requirement(line.strip())
        if requirement.marker is None or requirement.marker.evaluate():
            yield requirement.name, next(iter(requirement.specifier)).version


def _installed(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "none"


def check_imports(names: tuple[str, ...]) -> Check:
    """That the libraries load: a version alone does not show a missing system library."""
    failed = [f"{name} ({reason})" for name in names if (reason := _import_error(name))]
    remedy = "install what is named; if it is a Python package: rm .venv/.installed; make report"
    return Check("libraries", not failed, "; ".join(failed) or f"{len(names)} load", remedy)


def _import_error(name: str) -> str:
    try:
        __import__(name)
    except Exception as error:  # a broken library may raise anything
        return " ".join(str(error).split()) or type(error).__name__
    return ""


def check_opencv() -> Check:
    """That OpenCV's files are those of the build without a display, and no other distribution's."""
    fault = overwritten()
    return Check("OpenCV", fault is None, *(fault or (f"{WANTED} {_installed(WANTED)}",)))


def check_weights() -> Check:
    """That every weight file is here and is the one the registry names."""
    from hicp_lib.detectors.zoo import list_weights

    try:
        weights = list_weights()
    except InputError as error:
        return Check("weights", False, str(error), "git restore data/detectors.json")
    wrong = [f"{row['name']} {row['status']}" for row in weights if row["status"] != "present"]
    return Check(
        "weights", not wrong, ", ".join(wrong) or f"{len(weights)} present and sound", "hicp models fetch"
    )


def check_folder(name: str, folder: Path, remedy: str) -> list[Check]:
    """That files can be written there, and that the disk has room."""
    there = _nearest_existing(folder)
    is_writable = _attempt(lambda: _write_there(there))
    free_gb = shutil.disk_usage(there).free / 1e9
    room = f"{free_gb:.1f} GB free (at least {MIN_FREE_GB:.0f} wanted)"
    return [
        Check(
            f"{name} folder", is_writable, f"{folder} {'is' if is_writable else 'is not'} writable", remedy
        ),
        Check(f"{name} disk", free_gb >= MIN_FREE_GB, room, f"free space on the disk of {there}"),
    ]


def _nearest_existing(folder: Path) -> Path:
    return next(path for path in (folder, *folder.parents) if path.exists())


def _write_there(folder: Path) -> None:
    with tempfile.NamedTemporaryFile(dir=folder) as file:
        file.write(os.urandom(16))


def _attempt(action: Callable[[], None]) -> bool:
    try:
        action()
    except OSError:
        return False
    return True

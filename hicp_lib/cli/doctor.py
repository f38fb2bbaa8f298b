"""`hicp doctor`: check what the study needs from this machine, with a remedy for each failure."""

from __future__ import annotations

import contextlib
import importlib.metadata
import json
import os
import platform
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from hicp_lib.cli.probes import probes
from hicp_lib.cli.system_libraries import LIBRARIES, missing_packages
from hicp_lib.core.checkout import working_folder
from hicp_lib.core.children import child_environment, lifeline
from hicp_lib.core.environment import usable_cores
from hicp_lib.core.errors import InputError, one_line
from hicp_lib.core.executor import run_jobs
from hicp_lib.core.files import cache_dir
from hicp_lib.study import provenance

PYTHONS = ((3, 11), (3, 14))
MIN_FREE_GB = 3.0
PROBE_LIMIT_S = 120.0
PROBE = (sys.executable, "-m", "hicp_lib.cli.probes")
_LOCKED = "locked environment"
_OPENCV = "opencv-python-headless"
_OTHER_OPENCVS = ("opencv-contrib-python", "opencv-contrib-python-headless", "opencv-python")
_REINSTALL = "rm .venv/.installed; make report"


@dataclass(frozen=True)
class Check:
    """One line of the doctor.

    Attributes
    ----------
    name : str
        What was checked.
    is_ok : bool or None
        None for a part that was not installed, which is not a failure.
    finding : str
        What was found.
    remedy : str
        What to do about it; shown if it failed.

    Examples
    --------
    >>> print(Check("results disk", False, "0.1 GB free", "free space"))
    FAIL results disk: 0.1 GB free; remedy: free space
    """

    name: str
    is_ok: bool | None
    finding: str
    remedy: str = ""

    def __str__(self) -> str:
        status = {True: "ok", None: "--", False: "FAIL"}[self.is_ok]
        remedy = f"; remedy: {self.remedy}" if self.is_ok is False else ""
        return f"{status:<4} {self.name}: {self.finding}{remedy}"


def run_checks() -> list[Check]:
    """All checks; none raises, and none uses the network."""
    checks: list[Callable[[], Check | list[Check]]] = [check_python, check_system_libraries]
    checks += [check_locked_versions, check_opencv, check_weights, check_probes, check_folders]
    return [line for check in checks for line in _lines(check)]


def _lines(check: Callable[[], Check | list[Check]]) -> list[Check]:
    """The findings of a check; an exception is a finding, too."""
    try:
        found = check()
    except Exception as error:  # a broken installation may raise anything
        name = check.__name__.removeprefix("check_").replace("_", " ")
        return [Check(name, False, one_line(error), _remedy(one_line(error)))]
    return found if isinstance(found, list) else [found]


def check_python() -> Check:
    """The version, and that it runs in an environment of its own."""
    oldest, newest = PYTHONS
    is_ok = oldest <= sys.version_info[:2] <= newest
    remedy = "make it again with a Python from 3.11 to 3.14: rm -r .venv; make report PYTHON=python3.12"
    return Check("Python", is_ok, platform.python_version(), remedy)


def check_system_libraries() -> Check:
    """System libraries that the wheels load but do not contain."""
    missing = missing_packages()
    finding = f"missing: {' '.join(missing)}" if missing else "all that is needed"
    return Check("system libraries", not missing, finding, f"sudo apt-get install {' '.join(missing)}")


def check_locked_versions(lock_path: Path = provenance.LOCK_PATH) -> Check:
    """Whether the installed versions are those of the lock file."""
    if provenance.CHECKOUT is None:
        return Check(_LOCKED, True, "none: hicp was installed without a checkout")
    try:
        locked = dict(locked_versions(lock_path.read_text()))
    except OSError as error:
        return Check(_LOCKED, False, f"{lock_path}: {error.strerror}", "git restore environment.lock")
    found = {name: _installed(name) for name in locked}
    wrong = [f"{name} {found[name]} instead of {v}" for name, v in locked.items() if found[name] != v]
    finding = f"{len(wrong)} differ: {', '.join(wrong[:3])}" if wrong else f"{len(locked)} packages as locked"
    return Check(_LOCKED, not wrong, finding, _REINSTALL)


def locked_versions(lock: str) -> Iterator[tuple[str, str]]:
    """(name, version) of each locked package that is meant for this Python and system.

    Examples
    --------
    >>> lock = ["numpy==2.3.5", "winpty==1 ; sys_platform == 'nowhere'"]
    >>> list(locked_versions("\\n".join(lock)))
    [('numpy', '2.3.5')]
    """
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


def check_probes() -> list[Check]:
    """Whether detectors, renderer and controller run: one trial per processor at a time."""
    jobs = [(name, partial(check_probe, name)) for name in probes()]
    done = dict(run_jobs(jobs, usable_cores(), "threads"))
    return [done[name] for name, _ in jobs]


def check_probe(name: str, command: tuple[str, ...] = PROBE, limit_s: float = PROBE_LIMIT_S) -> Check:
    """Run one trial (see `hicp_lib.cli.probes`) in a separate process, which may crash or hang.

    Parameters
    ----------
    name : str
        Of the trial.
    command : tuple of str
        The command of the trial; its name is appended.
    limit_s : float
        After this the trial and all its processes are ended.
    """
    pipe = subprocess.PIPE
    streams: dict[str, Any] = {"stdout": pipe, "stderr": pipe, "text": True, "errors": "replace"}
    streams |= {"env": child_environment(), "start_new_session": True}
    with lifeline() as stdin:
        process = subprocess.Popen([*command, name], stdin=stdin, **streams)
        try:
            output, errors = process.communicate(timeout=limit_s)
        except subprocess.TimeoutExpired:
            return Check(name, False, f"no answer within {limit_s:g} s, ended", _remedy(""))
        finally:
            with contextlib.suppress(ProcessLookupError):  # itself and its children
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    if process.returncode == 0:
        is_ok, finding = json.loads(_last_line(output))
        return Check(name, is_ok, finding, _remedy(finding))
    code, words = process.returncode, _last_line(errors)
    ending = signal.Signals(-code).name if code < 0 else f"exit code {code}"
    return Check(name, False, f"its process died of {ending}{words and f' ({words})'}", _remedy(words))


def _remedy(words: str) -> str:
    """Remedy of a failure, by its message: the package of a shared library, or a new installation."""
    library = re.search(r"lib[\w+.-]+\.so[.\d]*(?=: cannot open shared object)", words)
    if library is None:
        return f"in a container or chroot, give it /proc, /sys and /dev; else: {_REINSTALL}"
    if library[0] in LIBRARIES:
        return f"sudo apt-get install {LIBRARIES[library[0]][0]}"
    return f"install the system's package with {library[0]}"


def _last_line(text: str) -> str:
    return next((" ".join(line.split()) for line in reversed(text.splitlines()) if line.strip()), "")


def check_opencv() -> Check:
    """Whether another distribution has overwritten the headless OpenCV."""
    others = " ".join(name for name in _OTHER_OPENCVS if _installed(name) != "none")
    version = _installed(_OPENCV)
    uninstall = f"pip uninstall -y {others}; " if others else ""
    remedy = f"{uninstall}pip install --force-reinstall --no-deps {_OPENCV}"
    finding = f"{others} instead of {_OPENCV}" if others else f"{_OPENCV} {version}"
    return Check("OpenCV", not others and version != "none", finding, remedy)


def check_weights() -> Check:
    """Whether every weight file is present and matches the registry's hash."""
    from hicp_lib.detectors.weights.default import registry, status

    try:
        found = {weight.name: status(weight) for weight in registry().values()}
    except InputError as error:
        return Check("weights", False, str(error), "git restore data/detectors.json")
    wrong = ", ".join(f"{name} {state}" for name, state in found.items() if state != "present")
    return Check("weights", not wrong, wrong or f"{len(found)} present and intact", "hicp models fetch")


def check_folders() -> list[Check]:
    """The output folders."""
    cache = check_folder("cache", cache_dir(), "set HICP_CACHE to a folder you may write to")
    return cache + check_folder("results", working_folder() / "results", "give yourself the right to do so")


def check_folder(name: str, folder: Path, remedy: str) -> list[Check]:
    """Whether files can be written in a folder, and its disk has space.

    Parameters
    ----------
    name : str
        What the folder is for.
    folder : Path
        If it does not exist, the nearest existing parent is checked.
    remedy : str
        What to do if it is not writable.
    """
    there = next(path for path in (folder, *folder.parents) if path.exists())
    is_writable = there.is_dir() and os.access(there, os.W_OK)
    finding = f"{folder} {'is' if is_writable else 'is not'} writable"
    free_gb = shutil.disk_usage(there).free / 1e9
    room = f"{free_gb:.1f} GB free (at least {MIN_FREE_GB:.0f} wanted)"
    return [
        Check(f"{name} folder", is_writable, finding, remedy),
        Check(f"{name} disk", free_gb >= MIN_FREE_GB, room, f"free space on the disk of {there}"),
    ]

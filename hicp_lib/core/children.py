"""Processes that this one starts: none imports from the working folder, none outlives this one.

A data folder may hold a `numpy.py`. Python puts the working folder on the path of `-m` and `-c` programs, before
its own library; Jupyter puts it on that of notebooks, and multiprocessing hands it on from there.
"""

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing.context import SpawnContext, SpawnProcess
from pathlib import Path
from typing import Any

from hicp_lib.core.environment import with_variables

_ONE_THREAD = dict.fromkeys(
    ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)
_SAFE_PATH = {"PYTHONSAFEPATH": "1"}
_LIBRARY_ROOT = Path(__file__).resolve().parents[2]


def child_environment(**variables: str) -> dict[str, str]:
    """This process's variables for a program that it starts, and some more.

    Examples
    --------
    >>> child_environment(A="1")["A"]
    '1'
    """
    return os.environ | _SAFE_PATH | variables


class _Process(SpawnProcess):
    @staticmethod
    def _Popen(process_obj: Any) -> Any:  # noqa: N802, multiprocessing's name
        here = Path.cwd()
        is_told = here == _LIBRARY_ROOT  # a checkout that is not installed
        told = [entry for entry in sys.path if is_told or Path(entry).resolve() != here]
        with safe_start():
            before, sys.path = sys.path, told
            try:
                return SpawnProcess._Popen(process_obj)  # type: ignore[attr-defined]
            finally:
                sys.path = before


class SafeSpawn(SpawnContext):
    """Starts processes of multiprocessing as fresh interpreters, with one thread each in linear algebra."""

    Process = _Process  # type: ignore[assignment]


@contextmanager
def safe_start() -> Iterator[None]:
    """A block in which multiprocessing may start processes of its own, as it does with the first lock."""
    with with_variables(**_ONE_THREAD, **_SAFE_PATH):
        yield


@contextmanager
def lifeline() -> Iterator[int]:
    """A standard input for a program that calls `end_with(0)`: it ends with the block, at the latest."""
    theirs, ours = os.pipe()
    try:
        yield theirs
    finally:
        os.close(ours)
        os.close(theirs)


def end_with(descriptor: int) -> None:
    """End this process when the other end of a pipe closes, to which nothing is ever written.

    So it ends however the process at the other end dies. Linux tells by a signal, at once; elsewhere a thread
    waits, which may have to wait for a library's call to end.

    Parameters
    ----------
    descriptor : int
        Of the pipe's end that is read.
    """
    with suppress(ImportError, OSError, AttributeError):
        import fcntl

        # Opened anew: flags and owner are of what was opened, which all who inherited it share.
        own = os.open(f"/proc/self/fd/{descriptor}", os.O_RDONLY | os.O_NONBLOCK)
        fcntl.fcntl(own, fcntl.F_SETOWN, os.getpid())
        fcntl.fcntl(own, fcntl.F_SETFL, os.O_NONBLOCK | os.O_ASYNC)
    threading.Thread(target=_wait_and_end, args=(os.dup(descriptor),), daemon=True).start()


def _wait_and_end(descriptor: int) -> None:
    with suppress(OSError):
        os.read(descriptor, 1)
    os._exit(1)

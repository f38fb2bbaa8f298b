"""Child processes: none imports from the working folder, none outlives this process.

A data folder may contain a file `numpy.py`. With `-m` and `-c` Python puts the working folder first on its
path, Jupyter does so for notebooks, and multiprocessing passes that path on.
"""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from pathlib import Path

from hicp_lib.core.environment import with_variables

_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
ONE_THREAD = dict.fromkeys(_THREADS, "1")
"""Variables that limit a process's linear algebra to one thread; read when its library is loaded."""
_SAFE_PATH = {"PYTHONSAFEPATH": "1"}


def child_environment(**variables: str) -> dict[str, str]:
    """Environment variables for a child process: this process's own, made safe, and further ones.

    Examples
    --------
    >>> child_environment(A="1")["A"]
    '1'
    """
    return os.environ | _SAFE_PATH | variables


@contextmanager
def safe_start() -> Iterator[None]:
    """A block in which multiprocessing starts processes, with one thread each in linear algebra."""
    untrusted = {Path.cwd()} - {Path(__file__).resolve().parents[2]}  # except an uninstalled checkout
    with with_variables(**_SAFE_PATH, **ONE_THREAD):  # one thread at a time
        before = sys.path
        sys.path = [entry for entry in before if Path(entry).resolve() not in untrusted]
        try:
            yield
        finally:
            sys.path = before


def begin(pipe: Connection) -> None:
    """First call in a pool's process, before slow imports: makes it end together with the pool.

    Parameters
    ----------
    pipe : Connection
        Its other end is open as long as the pool is.
    """
    end_with(pipe.fileno())
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # handled by the caller, which ends this process
    import cv2

    cv2.setNumThreads(1)


@contextmanager
def lifeline() -> Iterator[int]:
    """A standard input for a program that calls `end_with(0)`, which ends with the block at the latest."""
    theirs, ours = os.pipe()
    with open(theirs, "rb"), open(ours, "wb"):
        yield theirs


def end_with(descriptor: int) -> None:
    """End this process when the other end of a pipe closes; nothing is ever written to the pipe.

    So it ends no matter how the process at the other end dies. Linux signals this at once; elsewhere a thread
    waits for it, which may have to wait for a library's call to return.

    Parameters
    ----------
    descriptor : int
        Of the pipe's reading end.
    """
    own = os.dup(descriptor)
    threading.Thread(target=lambda: os._exit(1 + len(os.read(own, 1))), daemon=True).start()
    with suppress(ImportError, OSError, AttributeError):
        import fcntl

        # Reopened: flags and owner belong to the open file description, which all heirs of the pipe share.
        anew = os.open(f"/proc/self/fd/{own}", os.O_RDONLY | os.O_NONBLOCK)
        fcntl.fcntl(anew, fcntl.F_SETOWN, os.getpid())
        fcntl.fcntl(anew, fcntl.F_SETFL, os.O_NONBLOCK | os.O_ASYNC)

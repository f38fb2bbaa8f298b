"""Processes that this one starts: none imports from the working folder, none outlives this one.

A data folder may hold a `numpy.py`. Python puts the working folder on the path of `-m` and `-c`, before its
own library; Jupyter puts it on that of notebooks, and multiprocessing hands it on from there.
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
"""Variables that hold a process's linear algebra to one thread, read when its library is loaded."""
_SAFE_PATH = {"PYTHONSAFEPATH": "1"}


def child_environment(**variables: str) -> dict[str, str]:
    """This process's variables for a program that it starts, and some more.

    Examples
    --------
    >>> child_environment(A="1")["A"]
    '1'
    """
    return os.environ | _SAFE_PATH | variables


@contextmanager
def safe_start() -> Iterator[None]:
    """A block in which multiprocessing starts processes, with one thread each in linear algebra."""
    untrusted = {Path.cwd()} - {Path(__file__).resolve().parents[2]}  # a checkout that is not installed
    with with_variables(**_SAFE_PATH, **ONE_THREAD):  # one thread at a time
        before = sys.path
        sys.path = [entry for entry in before if Path(entry).resolve() not in untrusted]
        try:
            yield
        finally:
            sys.path = before


def begin(pipe: Connection) -> None:
    """What a process of a pool does first, before it imports what takes long: see that it ends.

    Parameters
    ----------
    pipe : Connection
        Its other end is open as long as the pool is.
    """
    end_with(pipe.fileno())
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the caller's, who ends this one
    import cv2

    cv2.setNumThreads(1)


@contextmanager
def lifeline() -> Iterator[int]:
    """A standard input for a program that calls `end_with(0)`: it ends with the block, at the latest."""
    theirs, ours = os.pipe()
    with open(theirs, "rb"), open(ours, "wb"):
        yield theirs


def end_with(descriptor: int) -> None:
    """End this process when the other end of a pipe closes, to which nothing is ever written.

    So it ends however the process at the other end dies. Linux tells by a signal, at once; elsewhere a thread
    waits, which may have to wait for a library's call to end.

    Parameters
    ----------
    descriptor : int
        Of the pipe's end that is read.
    """
    own = os.dup(descriptor)
    threading.Thread(target=lambda: os._exit(1 + len(os.read(own, 1))), daemon=True).start()
    with suppress(ImportError, OSError, AttributeError):
        import fcntl

        # Opened anew: flags and owner are of what was opened, which all who inherited it share.
        anew = os.open(f"/proc/self/fd/{own}", os.O_RDONLY | os.O_NONBLOCK)
        fcntl.fcntl(anew, fcntl.F_SETOWN, os.getpid())
        fcntl.fcntl(anew, fcntl.F_SETFL, os.O_NONBLOCK | os.O_ASYNC)

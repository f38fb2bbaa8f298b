"""Run a native library in a separate process, so that it cannot affect the caller's.

MediaPipe 1.x writes to descriptor 2, reports usage metrics (no images) to its vendor every minute and
whenever a task is closed, has no switch for either, and may abort. Its HTTP client obeys the usual proxy
variables: in its process these point to a closed port. The study contacts no server, and tests check this.
"""

from __future__ import annotations

import mmap
import multiprocessing
import os
import signal
import subprocess
import sys
import tempfile
import threading
import weakref
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import IO

import numpy as np

from hicp_lib.core.children import child_environment
from hicp_lib.core.errors import InputError
from hicp_lib.core.limited import raised
from hicp_lib.detectors.mediapipe.child import receive, send

# Port 9 ("discard") of this machine: a connection is refused at once.
_NOWHERE = dict.fromkeys(("http_proxy", "https_proxy", "all_proxy"), "http://127.0.0.1:9")
_NOWHERE |= {"no_proxy": "localhost"}
_FEW_THREADS = {"OPENBLAS_NUM_THREADS": "1"}  # NumPy's threads are not needed there
# A call takes milliseconds, and a start seconds on a busy machine.
LIMIT_S = 120.0
# Memory for its data, including stacks of a thread per core; and per byte of an image, which it copies.
_MOST_BYTES, _MOST_BYTES_PER_BYTE = 700 * 2**20 + 2**24 * (os.cpu_count() or 1), 3


class IsolationError(InputError):
    """A library in a separate process failed, or its process ended."""


class IsolatedProcess:
    """A program of this package that loads a native library; started on first use, and again after it ended.

    Parameters
    ----------
    program : list of str
        Script that follows the protocol of `hicp_lib.detectors.mediapipe.child`, and its first arguments.
    head : dict
    body : bytes
        The first message to it.
    name : str
        Start of messages to the user.
    remedy : str
        End of messages if the program cannot start.
    """

    def __init__(self, program: list[str], head: dict, body: bytes, name: str, remedy: str) -> None:
        self._program, self._first = program, (head | {"limit_s": LIMIT_S}, body)
        self._name, self._remedy = name, remedy
        self._lock = threading.Lock()
        self._child: _Child | None = None

    def start(self) -> None:
        """Start it if it is not running.

        Raises
        ------
        IsolationError
            If it does not start.
        """
        with self._lock:
            self._started()

    def ask(self, image: np.ndarray) -> np.ndarray:
        """The program's result for an RGB image, shape (height, width, 3), uint8.

        Raises
        ------
        IsolationError
            If it fails, or its process ends; the next call starts another.
        InputError
            If it is not such an image.
        """
        if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or not image.size:
            raise InputError(
                f"{self._name}: an image of {image.dtype} {image.shape}; expected uint8 (height, width, 3)"
            )
        with self._lock:
            child = self._started()
            child.show(image)
            remedy = "run it again, and without this image if it fails there again"
            head, body = self._answer(child, ({"shape": image.shape},), remedy)
        return np.frombuffer(body).reshape(head["shape"])

    def _started(self) -> _Child:
        # After a fork the pipes belong to the parent process.
        if self._child is None or self._child.owner != os.getpid():
            try:
                child = _Child(self._program)
            except OSError as error:
                raise IsolationError(
                    f"{self._name}: no process can be started ({error.strerror}); use fewer workers"
                ) from None
            self._answer(child, self._first, self._remedy)
            self._child = child
        return self._child

    def _answer(self, child: _Child, question: tuple, remedy: str) -> tuple[dict, bytes]:
        try:
            head, body = child.ask(*question)
        except (EOFError, OSError):
            self._child = None
            raise IsolationError(f"{self._name}: {child.end()}; {remedy}") from None
        except BaseException:  # after an interrupt, this answer would be read as that to the next image
            self._child = None
            child.close()
            raise
        if "error" in head:
            raise IsolationError(f"{self._name}: {head['error']}; {remedy}")
        return head, body


class _Child:
    """A running program; ended when nothing refers to it any more, or when this process ends in any way."""

    def __init__(self, program: list[str]) -> None:
        self.owner = os.getpid()
        self._stderr = tempfile.TemporaryFile()
        self._shared = _unnamed_file()
        self._pixels: bytes | mmap.mmap = b""
        self._pipe, theirs = multiprocessing.Pipe()
        inherited = self._shared.fileno(), theirs.fileno()
        self._process = subprocess.Popen(
            [sys.executable, *program, *map(str, inherited)],
            stdin=subprocess.DEVNULL,
            stdout=self._stderr,  # keeps the library's output out of the answers
            stderr=self._stderr,
            env=offline_environment(),
            pass_fds=inherited,
            start_new_session=True,  # an interrupt from the keyboard is for the caller
        )
        theirs.close()
        files = self._pipe, self._stderr, self._shared
        self.close = weakref.finalize(self, _close, self._process, files, self.owner)
        self._limit(0)

    def _limit(self, image_bytes: int) -> None:
        """Limit the program's memory, where the system can: its models' needs are not known beforehand."""
        most = int(raised(_MOST_BYTES + _MOST_BYTES_PER_BYTE * image_bytes))
        with suppress(ImportError, AttributeError, OSError):
            import resource

            resource.prlimit(self._process.pid, resource.RLIMIT_DATA, (most, resource.RLIM_INFINITY))

    def show(self, image: np.ndarray) -> None:
        """Put an image into shared memory."""
        if image.size > len(self._pixels):
            self._limit(image.size)
            self._shared.truncate(image.size)
            self._pixels = mmap.mmap(self._shared.fileno(), image.size)
        np.ndarray(image.shape, np.uint8, self._pixels)[...] = image

    def ask(self, head: dict, body: bytes = b"") -> tuple[dict, bytes]:
        """Send a message and wait for the answer; EOFError or OSError if the program has ended."""
        send(self._pipe, head, body)
        return receive(self._pipe)

    def end(self) -> str:
        """Wait for its end, and describe it in words."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(10.0)
        status = self._process.poll()
        last = _last_line(self._stderr)
        self.close()
        return _in_words(status) + (f" ({last})" if last else "")


def offline_environment() -> dict[str, str]:
    """This process's environment for a child, with all proxies set to a closed port."""
    nowhere = _NOWHERE | {name.upper(): value for name, value in _NOWHERE.items()}
    return child_environment() | _FEW_THREADS | nowhere


def _unnamed_file() -> IO[bytes]:
    """A file in memory, where the system has such."""
    if hasattr(os, "memfd_create"):
        return open(os.memfd_create("pixels"), "r+b", buffering=0)
    return tempfile.TemporaryFile(buffering=0)


def _close(process: subprocess.Popen, files: tuple[Connection | IO[bytes], ...], owner: int) -> None:
    for file in files:
        with suppress(OSError):  # unsent data
            file.close()
    if owner == os.getpid():
        process.kill()
        process.wait()
    else:
        process.returncode = 0  # a fork of its parent cannot wait for it, and need not


def _in_words(status: int | None) -> str:
    if status is None:
        return "its process does not answer"
    if status >= 0:
        return f"its process ended with code {status}"
    if -status == signal.SIGALRM:
        return f"its process gave no answer within {LIMIT_S:g} s"
    cause = ", which often means that memory ran out" if -status == signal.SIGKILL else ""
    return f"its process was ended by {signal.Signals(-status).name}{cause}"


def _last_line(stderr: IO[bytes]) -> str:
    """The last line a library wrote that is not part of a stack trace."""
    stderr.seek(max(0, stderr.seek(0, os.SEEK_END) - 8192))
    lines = stderr.read().decode(errors="replace").splitlines()
    said = [line for line in lines if line.strip() and not line.startswith((" ", "@", "***", "\t"))]
    fatal = [line for line in said if line.startswith("F0")]
    return " ".join((fatal or said or [""])[-1].split())[:300]

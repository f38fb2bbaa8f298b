"""Readers of others' files in a process of their own, whose time and memory are limited.

A damaged or hostile file can make a parser end its process, never end, or take all memory there is.
"""

import json
import os
import signal
import stat
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from hicp_lib.core.errors import InputError

LIMITS_VARIABLE = "HICP_LIMITS"
_LEAST_S, _S_PER_BYTE, _MOST_S_PER_BYTE = 4.0, 1e-6, 1e-4  # of computing; the last one for readers that go on
_LEAST_BYTES, _BYTES_PER_BYTE = 800 * 2**20, 40  # of memory
_FEW_THREADS = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OPENCV_FOR_THREADS_NUM", "OMP_NUM_THREADS"), "1")
_PROGRAM = "import sys; sys.path.append(sys.argv[1]); from hicp_lib.core import limited; limited.serve()"
_RAISE = f"if the file is sound, {LIMITS_VARIABLE}=4 in the environment allows four times as much"


def raised(limit: float) -> float:
    """A limit, times the number in the environment's `HICP_LIMITS`.

    Raises
    ------
    InputError
        If that is no number above 0.

    Examples
    --------
    >>> raised(2.0)
    2.0
    """
    text = os.environ.get(LIMITS_VARIABLE) or "1"
    with suppress(ValueError):
        if 0 < float(text) < 1e6:
            return limit * float(text)
    raise InputError(f"{LIMITS_VARIABLE} is {text!r}; expected what limits are multiplied by, such as 4")


def limited_child(path: Path, function: Callable, *arguments: Any) -> Any:
    """What a function answers in a process of its own, which ends with it.

    Parameters
    ----------
    path : Path
        What it reads, a file or a folder of them; its size says how much time and memory it may take.
    function : callable
        Of a module; takes the path as text, and `arguments`.
    *arguments : object
        JSON-able, as what it returns.

    Returns
    -------
    Any

    Raises
    ------
    InputError
        Its own, or if it takes too long or too much memory, or its process ends.
    """
    n_bytes = _size(path)
    limits = [raised(of) for of in (_LEAST_S + _S_PER_BYTE * n_bytes, _LEAST_S + _MOST_S_PER_BYTE * n_bytes)]
    limits.append(raised(_LEAST_BYTES + _BYTES_PER_BYTE * n_bytes))
    question = json.dumps([function.__module__, function.__qualname__, [str(path), *arguments], limits])
    command = [sys.executable, "-P", "-c", _PROGRAM, str(Path(__file__).resolve().parents[2])]
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile() as stderr:
        ended = subprocess.run(
            command, input=question.encode(), stdout=subprocess.PIPE, stderr=stderr,
            env=os.environ | _FEW_THREADS | {"TMPDIR": folder},
        )  # fmt: skip
        stderr.seek(max(0, stderr.seek(0, os.SEEK_END) - 4096))
        last = stderr.read().decode(errors="replace").strip().rpartition("\n")[2][:160]
    if ended.returncode == 0:
        answer = json.loads(ended.stdout)
        if "error" in answer:
            raise InputError(answer["error"])
        if "errno" in answer:
            raise OSError(*answer["errno"])
        return answer["value"]
    if -ended.returncode == signal.SIGXCPU:
        raise InputError(f"{path}: reading it takes more than {limits[0]:.0f} s; {_RAISE}")
    if "MemoryError" in last or "bad_alloc" in last:
        raise InputError(f"{path}: reading it takes more than {limits[2] / 2**30:.2g} GB of memory; {_RAISE}")
    how = signal.Signals(-ended.returncode).name if ended.returncode < 0 else last
    raise InputError(f"{path}: cannot be read: its reader ended ({how}); is it damaged or cut off?")


def _size(path: Path) -> int:
    """Bytes of a file, or of those in a folder."""
    n_bytes = 0
    try:
        for file in path.iterdir() if path.is_dir() else [path]:
            status = file.stat()
            if not stat.S_ISREG(status.st_mode) and not (stat.S_ISDIR(status.st_mode) and file != path):
                raise InputError(f"{path}: is no file and no folder of files; check the path")
            n_bytes += status.st_size
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from None
    return n_bytes


def serve() -> None:
    """Answer the question on standard input, on standard output: the program of the process."""
    answers = os.dup(1)
    os.dup2(2, 1)  # what a library prints is no answer
    module, name, arguments, (limit_s, most_s, most_bytes) = json.loads(sys.stdin.buffer.read())
    function = getattr(import_module(module), name)
    with suppress(ImportError, ValueError, OSError):  # no such limits on this system
        import resource

        # Beside what is there already: libraries set memory aside that they do not use.
        most_bytes += int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
        for limit in (resource.RLIMIT_DATA, resource.RLIMIT_FSIZE):
            resource.setrlimit(limit, (int(most_bytes), int(most_bytes)))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (int(limit_s), int(most_s) + 1))
    try:
        answer = {"value": function(*arguments)}
    except InputError as error:
        answer = {"error": str(error)}
    except OSError as error:
        answer = {"errno": [error.errno, error.strerror, error.filename]}
    with open(answers, "wb") as file:
        file.write(json.dumps(answer).encode())


def went_on() -> None:
    """Say from within a limited process that a part of the work is done: the rest gets time anew."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        soft_s, most_s = resource.getrlimit(resource.RLIMIT_CPU)
        if soft_s != resource.RLIM_INFINITY:
            used = resource.getrusage(resource.RUSAGE_SELF)
            soon_s = int(used.ru_utime + used.ru_stime + raised(_LEAST_S)) + 1
            resource.setrlimit(resource.RLIMIT_CPU, (min(max(soft_s, soon_s), most_s), most_s))

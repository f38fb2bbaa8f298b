"""Run readers of external files in a separate process with limited time and memory.

A damaged or hostile file can make a parser crash its process, run forever, or use up all memory.
"""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Any, cast

from hicp_lib.core.children import ONE_THREAD, child_environment, end_with, lifeline
from hicp_lib.core.errors import InputError

LIMITS_VARIABLE = "HICP_LIMITS"
_LEAST_S, _S_PER_BYTE, _MOST_S_PER_BYTE = 4.0, 1e-6, 1e-4  # of computing; the last one with `went_on`
_LEAST_BYTES, _BYTES_PER_BYTE = 800 * 2**20, 40  # of memory
_PROGRAM = """import sys; at = [*("-packages" in folder for folder in sys.path), True].index(True)
sys.path.insert(at, sys.argv[1]); from hicp_lib.core import limited; limited.serve()"""
_patience_s: list[float] = []  # of a limited process: how long one step may compute
RAISE = f"{LIMITS_VARIABLE}=4 in the environment allows four times as much"
"""The end of a message about a limit."""


def raised(limit: float) -> float:
    """A limit, times the number in the environment's `HICP_LIMITS`.

    Raises
    ------
    InputError
        If that is not a number above 0.

    Examples
    --------
    >>> raised(2.0)
    2.0
    """
    text = os.environ.get(LIMITS_VARIABLE) or "1"
    with suppress(ValueError):
        if 0 < float(text) < 1e6:
            return limit * float(text)
    raise InputError(f"{LIMITS_VARIABLE} is {text!r}; expected the factor for all limits, such as 4")


def limited_child(path: Path, function: Callable, *arguments: Any, least_s: float = _LEAST_S) -> Any:
    """The result of a function that runs in a separate, limited process.

    Parameters
    ----------
    path : Path
        The file or folder of files that it reads; its size determines the time and memory allowed.
    function : callable
        A module's function; takes the path as text, and `arguments`.
    *arguments : object
        JSON-able, like its result.
    least_s : float, optional
        How long it may compute at the smallest file.

    Returns
    -------
    Any

    Raises
    ------
    InputError
        Raised by the function, or if it takes too long or too much memory, or its process ends.
    """
    *_, answer = limited_parts(path, function, *arguments, least_s=least_s)
    return json.loads(answer)


def limited_parts(
    path: Path, function: Callable, *arguments: Any, least_s: float = _LEAST_S
) -> Iterator[bytes]:
    """As `limited_child`, what a generator gives, part by part; each part gets time anew.

    Parameters
    ----------
    path : Path
    function : callable
        A generator of bytes, else as of `limited_child`, like all else.
    *arguments : object
    least_s : float, optional

    Yields
    ------
    bytes
        The parts, and what the function returns, as JSON.

    Raises
    ------
    InputError
        As of `limited_child`, after the parts until then.
    """
    files = [path] if path.is_file() else [file for file in path.glob("*") if not file.is_dir()]
    if not files or not all(map(Path.is_file, files)):
        raise InputError(f"{path}: is neither a file nor a folder of files; check the path")
    n_bytes = sum(file.stat().st_size for file in files)
    limits = [raised(least_s + per_byte * n_bytes) for per_byte in (_S_PER_BYTE, _MOST_S_PER_BYTE)]
    limits.append(raised(_LEAST_BYTES + _BYTES_PER_BYTE * n_bytes))
    question = json.dumps([function.__module__, function.__qualname__, [str(path), *arguments], limits])
    command = [sys.executable, "-c", _PROGRAM, str(Path(__file__).resolve().parents[2])]
    with TemporaryDirectory() as folder, lifeline() as stdin, open(Path(folder, "errors"), "w+b") as errors:
        Path(folder, "question").write_text(question)
        environment = child_environment(**ONE_THREAD, OPENCV_FOR_THREADS_NUM="1", TMPDIR=folder)
        pipes: dict[str, Any] = {"stdin": stdin, "stdout": subprocess.PIPE, "stderr": errors}
        with subprocess.Popen(command, env=environment, **pipes) as process:
            answers = cast(IO[bytes], process.stdout)
            try:
                while len(size := answers.read(8)) == 8:
                    part = answers.read(int.from_bytes(size, "little"))
                    if len(part) == int.from_bytes(size, "little"):  # else it ended within
                        yield part
                code = process.wait()
            finally:
                process.kill()
        errors.seek(max(0, errors.seek(0, os.SEEK_END) - 4096))
        last = errors.read().decode(errors="replace").strip().rpartition("\n")[2]
        if not code and (end := Path(folder, "end")).exists():
            if refusal := json.loads(end.read_text()):
                raise InputError(refusal)
            return
    took_long = code in (-signal.SIGXCPU, -signal.SIGPROF)
    if took_long or "MemoryError" in last:
        most = f"{limits[0]:.1f} s" if took_long else f"{limits[2] / 1e9:.2g} GB of memory"
        raise InputError(f"{path}: reading takes more than {most}; if the file is sound, {RAISE}")
    how = signal.Signals(-code).name if code < 0 else last[:160]
    raise InputError(f"{path}: its reader gave up ({how}); is it damaged or cut off?")


def serve() -> None:
    """Main program of the process: run the function, write what it gives, each part after its size."""
    end_with(0)
    answers, folder = os.dup(1), Path(os.environ["TMPDIR"])
    os.dup2(2, 1)  # output printed by libraries must not mix with the parts
    module, name, arguments, limits = json.loads((folder / "question").read_text())
    function = getattr(import_module(module), name)
    with suppress(ImportError, ValueError, OSError):  # no such limits on this system
        import resource

        # In addition to what imports took: libraries reserve memory that they do not use.
        limits[2] += int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
        for name, most in {"CPU": limits[1] + 4, "DATA": limits[2], "FSIZE": limits[2], "CORE": 0}.items():
            resource.setrlimit(getattr(resource, f"RLIMIT_{name}"), (int(most), int(most) + 1))
    _patience_s.append(limits[0])
    went_on()
    refusal = None
    with open(answers, "wb") as file:
        try:
            answer = function(*arguments)
            for part in answer if isinstance(answer, Iterator) else [json.dumps(answer).encode()]:
                file.writelines((len(part).to_bytes(8, "little"), part))
                went_on()
        except InputError as error:
            refusal = str(error)
    (folder / "end").write_text(json.dumps(refusal))


def went_on() -> None:
    """Called in a limited process after a part of the work: restarts the time limit."""
    for limit_s in _patience_s:
        signal.setitimer(signal.ITIMER_PROF, limit_s)

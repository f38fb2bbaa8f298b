"""An interpreter that has imported the library and runs commands in forks, without waiting for imports.

It reads one request per line, JSON, and answers with one: how the command ended and what it used.
"""

from __future__ import annotations

import ctypes
import importlib
import json
import os
import pkgutil
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

IDLE_S = 10.0  # a command that computes no more for so long, nor waits for a processor, is ended
WALL_S = 120.0  # and any after so long
GUARD_BYTES = 3 * 2**29  # of one process, likewise
_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36
# Open3D's threads do not survive a fork, and what imports it is left out.
_PACKAGES = ("core", "formats", "detectors", "datasets", "recordings", "lifting", "inspection", "cli")


def _import_library() -> None:
    for package in _PACKAGES:
        path = [str(Path(importlib.import_module(f"hicp_lib.{package}").__file__ or "").parent)]
        for module in pkgutil.walk_packages(path, f"hicp_lib.{package}."):
            if not module.name.endswith((".child", ".realsense")):
                importlib.import_module(module.name)
    for name in ("onnxruntime", "pyarrow.parquet", "hicp_lib.evaluation.ap.judgement"):
        importlib.import_module(name)


def _become(request: dict[str, Any]) -> None:
    """What a fork does before it runs the command."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    os.setsid()
    os.chdir(request["folder"])
    os.environ.update(request["environment"])
    sys.argv = ["hicp", *request["arguments"]]
    for descriptor, name in ((1, "stdout"), (2, "stderr")):
        os.dup2(os.open(request[name], os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), descriptor)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    sys.stdin = open(0)
    sys.path[:] = [entry for entry in sys.path if entry not in ("", ".")]


def _children(of: int) -> dict[int, int]:
    """Processes below one, and their memory in bytes."""
    parents = {}
    for entry in filter(str.isdigit, os.listdir("/proc")):
        with suppress(OSError, ValueError):
            fields = Path(f"/proc/{entry}/stat").read_text().rpartition(")")[2].split()
            if fields[0] != "Z":
                parents[int(entry)] = (int(fields[1]), int(fields[21]) * 4096)
    below, found = {of}, {}
    while more := {pid for pid, (parent, _) in parents.items() if parent in below and pid not in below}:
        below |= more
        found |= {pid: parents[pid][1] for pid in more}
    return found


def _scheduled(pid: int) -> tuple[float, float]:
    """Seconds that a process computed and that it waited for a processor."""
    with suppress(OSError, ValueError):
        computed, waited, _ = Path(f"/proc/{pid}/schedstat").read_text().split()
        return int(computed) / 1e9, int(waited) / 1e9
    return 0.0, 0.0


def _watch(pid: int, wall_s: float, kill_s: float | None) -> dict[str, Any]:
    """Wait for a fork; end what takes too long or too much, or at the moment that was asked for."""
    start_s, stopped, most_bytes, pause_s, spent = time.monotonic(), "", 0, 0.01, {pid: (0.0, 0.0)}
    if kill_s is not None:
        time.sleep(kill_s)
        os.kill(pid, signal.SIGKILL)  # alone: what it started is to end by itself
    while os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
        family = _children(os.getpid())
        spent |= {one: _scheduled(one) for one in family}
        most_bytes = max(most_bytes, *family.values(), 0)
        took_s = time.monotonic() - start_s
        if took_s > wall_s or (kill_s is None and took_s - sum(map(sum, spent.values())) > IDLE_S):
            stopped = f"still runs after {took_s:.0f} s"
        elif most_bytes > GUARD_BYTES:
            stopped = f"took {most_bytes / 2**30:.1f} GB"
        if stopped:
            for one in family:
                with suppress(ProcessLookupError):
                    os.kill(one, signal.SIGKILL)
        time.sleep(pause_s)
        pause_s = min(2 * pause_s, 0.1)
    took_s = time.monotonic() - start_s
    spent[pid] = _scheduled(pid)
    _, status, used = os.wait4(pid, 0)
    cpu_s = used.ru_utime + used.ru_stime
    computed_s, waited_s = map(sum, zip(*spent.values(), strict=True))
    return {
        "status": status, "stopped": stopped, "wall_s": took_s, "cpu_s": cpu_s,
        "idle_s": took_s - max(cpu_s, computed_s) - waited_s,
        "most_bytes": max(most_bytes, used.ru_maxrss * 1024), "orphans": _end_orphans(),
    }  # fmt: skip


def _end_orphans() -> int:
    """How many processes a command left behind for longer than a second; they are ended."""
    until_s = time.monotonic() + 1.5
    while (left := _children(os.getpid())) and time.monotonic() < until_s:
        time.sleep(0.02)
    for one in left:
        with suppress(ProcessLookupError):
            os.kill(one, signal.SIGKILL)
    with suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG if not left else 0)[0]:
            pass
    return len(left)


def serve() -> bool:
    """Answer requests; True in a fork, which is to run its command."""
    ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1)
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        request = json.loads(line)
        pid = os.fork()
        if pid == 0:
            _become(request)
            if not request["fresh"]:
                return True
            os.execv(sys.executable, [sys.executable, *request["fresh"], *request["arguments"]])
        answers.write(json.dumps(_watch(pid, request["wall_s"], request["kill_s"])) + "\n")
        answers.flush()
    return False


if __name__ == "__main__":
    _import_library()
    if serve():
        from hicp_lib.cli.main import main

        main()

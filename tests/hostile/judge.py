"""The one judge of all hostile inputs: what a command did with one, and what of it is wrong."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import socket
import stat
import subprocess
import sys
import threading
from contextlib import contextmanager, suppress
from pathlib import Path

from tests.hostile.case import FULL_DISK, OUTPUTS, Case
from tests.hostile.good import make_good
from tests.hostile.ready import WALL_S

CHECKOUT = Path(__file__).parents[2]
CPU_S, MEMORY_BYTES = 5.0, 2**30  # what a refusal may cost
IDLE_S = 5.0  # how long it may take beyond what it waits for a processor of its own
MARKER = "executed-by-hostile-code"
_CONTROLS = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


def state(folder: Path) -> dict[str, tuple]:
    """What lies in a folder: type, rights, and what it holds."""
    found = {}
    for where, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path = Path(where, name)
            facts = path.lstat()
            content: object = facts.st_rdev
            if stat.S_ISREG(facts.st_mode):
                sparse = facts.st_size > 2**28
                content = facts.st_size if sparse else hashlib.sha256(path.read_bytes()).hexdigest()
            elif stat.S_ISLNK(facts.st_mode):
                content = os.readlink(path)
            found[os.fsdecode(path.relative_to(folder))] = (facts.st_mode, content)
    return found


class Ready:
    """The interpreter of `tests.hostile.ready`.

    Parameters
    ----------
    folder : Path
        Where what commands print is kept.
    environment : dict
        Variables beside those of the caller.
    """

    def __init__(self, folder: Path, environment: dict[str, str]) -> None:
        self.folder = folder
        (folder / "bin").mkdir()
        (folder / "bin" / "hicp").write_text("from hicp_lib.cli.main import main; main()")
        paths = os.pathsep.join(filter(None, (str(CHECKOUT), os.environ.get("PYTHONPATH"))))
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.hostile.ready"], cwd=CHECKOUT, text=True, stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=os.environ | {"PYTHONPATH": paths, "OPENCV_LOG_LEVEL": "ERROR"} | environment,
        )  # fmt: skip

    def close(self) -> None:
        """End it."""
        assert self._process.stdin
        self._process.stdin.close()
        self._process.wait(30)

    def run(
        self, work: Path, arguments: list[str], environment: dict | None = None, fresh: bool = False,
        wall_s: float = WALL_S, kill_s: float | None = None,
    ) -> tuple[dict, str, str]:  # fmt: skip
        """How `hicp` with these arguments ended in a folder, what it used, printed and told as errors.

        `fresh` starts it as a user does; after `kill_s` it is killed.
        """
        outputs = {name: str(self.folder / name) for name in ("stdout", "stderr")}
        request = outputs | {
            "folder": str(work), "arguments": arguments, "environment": environment or {}, "wall_s": wall_s,
            "kill_s": kill_s, "fresh": [str(self.folder / "bin" / "hicp")] if fresh else [],
        }  # fmt: skip
        assert self._process.stdin and self._process.stdout
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        if not answer:
            raise RuntimeError("the interpreter that is ready ended")
        texts = [Path(path).read_bytes().decode(errors="surrogateescape") for path in outputs.values()]
        return json.loads(answer), *texts


class Judge:
    """Makes cases, runs them and says what is wrong.

    Parameters
    ----------
    folder : Path
        Where all happens.
    weights : Path, optional
        Folder of fetched weights.
    """

    def __init__(self, folder: Path, weights: Path | None = None) -> None:
        self.folder = folder
        self.good = make_good(folder / "good")
        self.cache, self.weights = folder / "cache", weights
        self.ready = Ready(folder, {"HICP_CACHE": str(self.cache), "HOME": str(folder)})
        self.used: dict = {}

    def close(self) -> None:
        """End the interpreter that is ready."""
        self.ready.close()

    def faults(self, case: Case) -> list[str]:
        """What is wrong with how a case is answered; nothing where all is right."""
        work = self.folder / "work"
        shutil.copytree(self.good, work, symlinks=True)
        self.cache.mkdir()  # what was found in another case is not taken up
        if self.weights is not None and self.weights.is_dir():
            (self.cache / "weights").symlink_to(self.weights)
        try:
            case.make(work)
            before = state(work)
            with _server(case) as port:
                variables = {name: text.replace("PORT", str(port)) for name, text in case.environment}
                self.used, printed, errors = self.ready.run(work, case.arguments(port), variables, case.fresh)
            told = self._of_the_run(case, printed, errors)
            told += _of_the_folder(before, state(work), was_killed=bool(self.used["stopped"]))
            if case.check is not None and not told:
                told += filter(None, [case.check(work, printed + errors)])
            return told
        finally:
            _remove(work)
            shutil.rmtree(self.cache)

    def _of_the_run(self, case: Case, printed: str, errors: str) -> list[str]:
        used, told = self.used, []
        code = os.waitstatus_to_exitcode(used["status"])
        if used["stopped"]:
            told.append(used["stopped"])
        elif code < 0:
            told.append(f"ended by signal {-code}")
        elif code not in case.exits:
            told.append(f"exit code {code}, not {' or '.join(map(str, case.exits))}")
        if "Traceback (most recent call last)" in printed + errors:
            told.append(f"traceback: {errors.strip().splitlines()[-1][:160]}")
        else:
            told += _of_the_lines(case, code, printed, errors)
        if code and (used["cpu_s"] > CPU_S or used["idle_s"] > IDLE_S):
            told.append(f"takes {used['cpu_s']:.1f} s of a processor, {used['wall_s']:.1f} s in all")
        if used["most_bytes"] > MEMORY_BYTES:
            told.append(f"takes {used['most_bytes'] / 2**30:.2f} GB")
        if used["orphans"]:
            told.append(f"{used['orphans']} processes outlive it")
        with suppress(FileNotFoundError):
            (self.folder / MARKER).unlink()
            told.append("code out of the data was executed")
        return told


def _of_the_lines(case: Case, code: int, printed: str, errors: str) -> list[str]:
    told = []
    lines = errors.splitlines()
    mistakes = [line for line in lines if line.startswith("hicp: ")]
    if code == 2 and not (printed if not lines else mistakes):
        told.append(f"no line that says what is wrong: {errors[:160]!r}")
    if len(lines) > len(mistakes) and code == 2 and not case.notes or len(mistakes) > 1:
        told.append(f"{len(lines)} lines of errors: {errors[:300]!r}")
    if any(len(line) > 10_000 for line in lines):
        told.append(f"a line of {max(map(len, lines))} characters")
    if found := _CONTROLS.search(printed + errors):
        told.append(f"prints {found[0]!r}")
    if case.says not in printed + errors:
        told.append(f"does not say {case.says!r}: {(printed + errors)[:200]!r}")
    return told


def _of_the_folder(before: dict, after: dict, was_killed: bool) -> list[str]:
    told = [f"{name!r} is gone" for name in before if name not in after]
    told += [f"{name!r} is changed" for name in before if name in after and after[name] != before[name]]
    new = [] if was_killed else [name for name in after if name not in before]
    told += [f"{name!r} is left" for name in new if ".partial" in name or not name.startswith(OUTPUTS)]
    return told


@contextmanager
def _server(case: Case):
    """The case's server, and its port."""
    if case.serve is None:
        yield None
        return
    listening = socket.create_server(("127.0.0.1", 0))

    def answer() -> None:
        with suppress(OSError):
            while True:
                connection, _ = listening.accept()
                threading.Thread(target=quietly, args=(connection,), daemon=True).start()

    def quietly(connection: socket.socket) -> None:
        with suppress(OSError):
            case.serve(connection)

    threading.Thread(target=answer, daemon=True).start()
    try:
        yield listening.getsockname()[1]
    finally:
        listening.shutdown(socket.SHUT_RDWR)
        listening.close()


def _remove(work: Path) -> None:
    if (work / FULL_DISK).is_mount():
        subprocess.run(["umount", str(work / FULL_DISK)], check=True)
    for where, folders, _ in os.walk(work):
        for name in (".", *folders):
            with suppress(OSError):
                os.chmod(Path(where, name), 0o700)
    shutil.rmtree(work)

"""Runs of notebooks: only when something they depend on changed, whole or not at all.

A run happens in a staging folder. It replaces the last one only if every cell completed, nothing was written
to stderr, and the results have the run's parameters; its stamp is written last. Without a stamp, with another
key, or if an output differs from the stamped one, the notebook runs again. Other files beside the outputs,
such as a user's notes, stay.
"""

import json
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import nbformat
import psutil

from hicp_lib.core.cache import code, digest, input_sha256
from hicp_lib.core.environment import usable_cores
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json, sha256_file, write_json
from hicp_lib.core.folders import remove_inside
from hicp_lib.core.limited import RAISE, raised
from hicp_lib.report.notebooks import is_path, read_notebook, source_sha256
from hicp_lib.report.run import WALL_LIMIT_S, Children, Folders, Run, RunError
from hicp_lib.report.schedule import needed, run_when_ready
from hicp_lib.study import provenance

Earlier = Callable[[], list[str]]
"""Returns the current digests of the runs before one."""
MEMORY_PER_RUN_BYTES = 2 * 10**9
"""Memory that one notebook may need with its workers; the study's largest takes 0.7 GB without them."""


def run_all(runs: list[Run], folders: Folders, log: Callable[[str], None], only: str | None = None) -> None:
    """Bring every run up to date, some at a time where they do not depend on each other.

    Parameters
    ----------
    runs : list of Run
        Those named in `after` run before them; names that are not among them are ignored.
    folders : Folders
    log : callable
        Takes one line per notebook.
    only : str, optional
        Name of the requested notebook, which runs with those it needs; by default all.

    Raises
    ------
    RunError
        If a notebook failed; the others still finish.
    InputError
        If a parameter names a file or folder that does not exist.
    """
    named = {run.notebook.name: run for run in runs}
    after = {name: [other for other in run.after if other in named] for name, run in named.items()}
    if only is not None:
        after = {name: after[name] for name in named if name in needed(after, only)}
    for name in after:
        _input_paths(named[name])  # report a mistake now, not when it is the notebook's turn
    folders.executed.mkdir(parents=True, exist_ok=True)
    for left_behind in folders.executed.glob(".run-*"):
        shutil.rmtree(left_behind, ignore_errors=True)
    for stamp in folders.executed.glob("*.json"):
        if stamp.stem not in named:
            _discard(stamp.stem, folders)
    n_workers = n_parallel()
    with ThreadPoolExecutor(n_workers) as pool, Children() as children:

        def job(name: str, before: list[Future]) -> None:
            if any(future.exception() for future in before):
                raise _SkippedError
            _bring_up_to_date(named[name], partial(_made, after[name], folders), folders, children, log)

        done = run_when_ready(after, job, pool, n_workers)
    for error in (done[name].exception() for name in after):
        if error is not None and not isinstance(error, _SkippedError):
            raise error


def n_parallel() -> int:
    """Number of notebooks in parallel: one per core of this process, limited by memory."""
    fitting = psutil.virtual_memory().available // MEMORY_PER_RUN_BYTES
    return max(1, min(usable_cores(), fitting))


class _SkippedError(Exception):
    """A notebook that was not run because one before it failed."""


def _made(names: list[str], folders: Folders) -> list[str]:
    """Digests that identify the results of earlier notebooks."""
    return [digest([read_stamp(folders.executed / f"{name}.json"), outputs(name, folders)]) for name in names]


def _bring_up_to_date(
    run: Run, earlier: Earlier, folders: Folders, children: Children, log: Callable
) -> None:
    """Run the notebook unless it is fresh."""
    name, key = run.notebook.name, run_key(run, earlier())
    reason = why_stale(name, key, folders)
    if reason is None:
        log(f"{name}: unchanged")
        return
    log(f"{name}: running ({reason}) ...")
    start_s = time.perf_counter()
    _run_notebook(run, key, earlier, folders, children)
    log(f"{name}: done in {time.perf_counter() - start_s:.1f} s")


def run_key(run: Run, before: list[str] | None = None) -> dict[str, Any]:
    """Hashes of everything that a run depends on, by name.

    Parameters
    ----------
    run : Run
    before : list of str, optional
        Digests of the runs before it.

    Returns
    -------
    dict of str to str

    Raises
    ------
    InputError
        If a parameter names a file or folder that does not exist.
    """
    made_by = code([*run.notebook.imports, "hicp_lib.report.execute"])
    inputs = {name: input_sha256(path) for name, path in _input_paths(run).items()}
    return {
        "notebook": run.notebook.source_sha256,
        "parameters": digest(run.parameters),
        "library": digest(made_by.modules),
        "lock": provenance.lock_sha256(),
        "installed packages": provenance.installed_sha256(),
        "data": digest(made_by.data),
        "weights": digest(provenance.weights_sha256()),
        "input files": digest(inputs),
        "earlier notebooks": digest(before or []),
    }


def _input_paths(run: Run) -> dict[str, Path]:
    paths = {
        f"{name} {k}" if k else name: run.notebook.path.parent / one
        for name, value in run.parameters.items()
        if is_path(name, run.notebook.defaults[name]) and value
        for k, one in enumerate(value if isinstance(value, list) else [value])
    }
    for name, path in paths.items():
        if not path.exists():
            raise InputError(f"{path}: does not exist; parameter '{name}' must name a file or folder")
    return paths


def why_stale(name: str, key: dict[str, Any], folders: Folders) -> str | None:
    """Why a new run is necessary, in words; None if the last run is still valid.

    Parameters
    ----------
    name : str
        The notebook's.
    key : dict of str to str
        As from `run_key`.
    folders : Folders
    """
    stamp = read_stamp(folders.executed / f"{name}.json")
    if stamp is None:
        return "no complete run yet"
    if changed := [part for part in key if stamp["key"].get(part) != key[part]]:
        return f"changed: {', '.join(changed)}"
    return None if stamp["outputs"] == outputs(name, folders) else "its outputs were changed"


def read_stamp(path: Path) -> dict[str, Any] | None:
    """The stamp of the last run: its `key` and `outputs`; None without a complete run."""
    try:
        stamp = json.loads(path.read_bytes())
        return stamp if isinstance(stamp["outputs"], dict) and stamp["key"] else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def outputs(name: str, folders: Folders) -> dict[str, str]:
    """SHA-256 of the executed copy and of every result file of a run, as far as they are there."""
    made = _listed(folders.executed / f"{name}.json")
    return {path: sha256_file(folders.root / path) for path in made if (folders.root / path).is_file()}


def _listed(stamp: Path) -> list[str]:
    """Outputs that a stamp names, also that of a run that is not finished; relative to the root."""
    with suppress(OSError, ValueError, KeyError, TypeError):
        return list(json.loads(stamp.read_bytes())["outputs"])
    return []


def _run_notebook(run: Run, key: dict, earlier: Earlier, folders: Folders, children: Children) -> None:
    """Run a notebook and replace the last run by its outcome, stamped with its key.

    Raises RunError if a cell failed, wrote to stderr or took too long, the results are not those of this run,
    or something in its key was changed meanwhile.
    """
    name = run.notebook.name
    prefix, parent = f".run-{name}-", folders.executed
    with tempfile.TemporaryDirectory(prefix=prefix, dir=parent, ignore_cleanup_errors=True) as temporary:
        staging = Path(temporary)
        copy = staging / f"{name}.ipynb"
        try:
            status = children.execute(run, copy, staging, folders)
            _check(run, status, copy, staging)
            _refuse_changed(run, key, copy, earlier)
        except RunError as error:
            raise RunError(f"{name}: {error}{_keep_failed(copy, staging, folders)}") from None
        results = staging / "results"
        made = [path for path in sorted(results.rglob("*")) if path.is_file()]
        moves = [(path, folders.results / path.relative_to(results)) for path in made]
        moves.append((copy, folders.executed / copy.name))
        _discard(name, folders, [target.relative_to(folders.root).as_posix() for _, target in moves])
        for path, target in moves:
            target.parent.mkdir(parents=True, exist_ok=True)
            os.replace(path, target)
    stamp = {"key": key, "parameters": run.parameters, "outputs": outputs(name, folders)}
    write_json(folders.executed / f"{name}.json", stamp, indent=2)


def _discard(name: str, folders: Folders, to_come: Sequence[str] = ()) -> None:
    """Remove what the last run made; from here on it counts as not run.

    A stamp without a key names what was made and what comes in its place, however this ends.
    """
    stamp = folders.executed / f"{name}.json"
    made = _listed(stamp)
    write_json(stamp, {"key": {}, "outputs": dict.fromkeys([*to_come, *made])})
    remove_inside(folders.root, made)
    for leftover in (folders.executed / "failed").glob(f"{name}.*"):
        leftover.unlink()
    results = folders.results / name
    for folder in sorted([results, *results.rglob("*")], reverse=True):
        with suppress(OSError):  # a file, or not empty
            folder.rmdir()
    if not to_come:
        stamp.unlink()


def _keep_failed(copy: Path, staging: Path, folders: Folders) -> str:
    """Keep a failed run's copy and log; returns the words that say where."""
    failed = folders.executed / "failed"
    failed.mkdir(exist_ok=True)
    for path in (copy, staging / "log.txt"):
        if path.is_file():
            os.replace(path, failed / f"{copy.stem}{path.suffix}")
    return f"; see {failed / copy.name}" if (failed / copy.name).is_file() else f"; see {failed}"


def _check(run: Run, status: int | None, copy: Path, staging: Path) -> None:
    """Raise RunError unless the executed copy and its results are whole."""
    if status is None:
        took = f"took longer than {raised(WALL_LIMIT_S):g} s and was stopped"
        raise RunError(f"{took}; run it again to continue, {RAISE}")
    if not copy.is_file():
        lines = (staging / "log.txt").read_text(errors="replace").strip().splitlines()
        raise RunError(f"did not run: {lines[-1] if lines else f'exit code {status}'}")
    problem = first_problem(copy) or (f"exit code {status}" if status else None)
    if problem is not None:
        raise RunError(problem)
    try:
        stamp = read_json(staging / "results" / run.notebook.name / "provenance.json")
    except InputError:
        raise RunError("ended without results; its last line must be `study.finish()`") from None
    if stamp["parameters"] != json.loads(json.dumps(run.parameters)):
        raise RunError("its results state other parameters than it ran with; pass all to `Study`")


def _refuse_changed(run: Run, key: dict[str, Any], copy: Path, earlier: Earlier) -> None:
    """Raise RunError if what was run, or is there now, differs from the key; InputError if it is gone."""
    now = run_key(replace(run, notebook=read_notebook(run.notebook.path)), earlier())
    if source_sha256(nbformat.read(copy, as_version=4).cells) != key["notebook"]:
        now["notebook"] = "another was run"
    if changed := [part for part in key if now[part] != key[part]]:
        raise RunError(f"{', '.join(changed)} changed while it ran; run the report again")


def first_problem(executed: Path) -> str | None:
    """The first cell of an executed notebook that did not complete or wrote to stderr, in words."""
    cells = nbformat.read(executed, as_version=4).cells
    for cell in cells:
        if cell.cell_type != "code":
            continue
        place = f"In [{cell.execution_count or ' '}]"
        for output in cell.outputs:
            if output.output_type == "error":
                return f"{place} failed: {output.ename}: {' '.join(output.evalue.split())}"
            if output.output_type == "stream" and output.name == "stderr":
                return f"{place} wrote to stderr: {output.text.strip().splitlines()[0]}"
        if cell.metadata.get("papermill", {}).get("status") != "completed":
            return f"{place} did not complete"
    return None

"""The whole report in one call: notebooks brought up to date, then the book."""

from __future__ import annotations

import fcntl
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from hicp_lib.core.errors import InputError
from hicp_lib.report.book import build_book
from hicp_lib.report.notebooks import parse_overrides, read_notebooks, read_profile
from hicp_lib.report.runs import Folders, Run, run_all


def make_report(
    profile: str, pairs: list[tuple[str, str]], say: Callable[[str], None], sources: Path, root: Path
) -> Path:
    """Run the notebooks of a study under a profile of its `notebooks/profiles.toml`, and build the book.

    Parameters
    ----------
    pairs : parameter names and values, as text, that override the profile's
    say : takes one line of progress
    sources : holds `notebooks` and `book`
    root : `results` and `_build` are written below it

    Returns
    -------
    The first page of the book.

    Raises
    ------
    InputError
        For an unknown profile or parameter, or when another report of this profile is being made.
    RunError
        When a notebook fails, or the book has a fault.
    """
    start_s = time.perf_counter()
    notebooks = read_notebooks(sources / "notebooks")
    chosen = read_profile(sources / "notebooks" / "profiles.toml", profile, notebooks)
    overrides = parse_overrides(pairs, notebooks)
    runs = [
        Run(
            notebook,
            notebook.defaults | chosen.parameters.get(notebook.name, {}) | overrides[notebook.name],
            tuple(chosen.after.get(notebook.name, ())),
        )
        for notebook in notebooks
    ]
    folders = Folders(sources, root.resolve(), profile)
    with _alone(folders):
        run_all(runs, folders, say)
        page, is_new = build_book(folders)
    say(f"book: {'built' if is_new else 'unchanged'}")
    say(f"The report is {page} ({time.perf_counter() - start_s:.0f} s)")
    return page


@contextmanager
def _alone(folders: Folders) -> Iterator[None]:
    """Let one process at a time work on a profile; the system frees the lock however it ends."""
    folders.executed.mkdir(parents=True, exist_ok=True)
    with open(folders.executed / ".lock", "w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                f"{lock.name}: another report of this profile is being made; wait for it to end"
            ) from None
        yield

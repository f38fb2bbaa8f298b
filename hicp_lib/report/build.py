"""The whole report in one call: notebooks brought up to date, then the book.

Fetched weights can be absent without a network. A notebook then runs on its other detectors; a notebook about
that detector only is left out, and its page says why. A detector that the user named is not dropped: its
notebook fails, and says what is missing.
"""

import time
from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

from hicp_lib.core.errors import InputError, refuse_unknown
from hicp_lib.core.folders import locked_folder
from hicp_lib.detectors.registry import COMBINED, DETECTORS
from hicp_lib.detectors.weights.default import registry
from hicp_lib.report.book import build_book
from hicp_lib.report.notebooks import Notebook, parse_overrides, read_notebooks, read_profile
from hicp_lib.report.run import Folders, Run
from hicp_lib.report.runs import run_all

_DETECTORS = ("names", "two names", "a name")  # start of the description of a parameter that names detectors


def make_report(
    profile: str,
    pairs: list[tuple[str, str]],
    log: Callable[[str], None],
    sources: Path,
    root: Path,
    only: str | None = None,
) -> Path | None:
    """Run the notebooks of a study under a profile of its `notebooks/profiles.toml`, and build the book.

    Parameters
    ----------
    profile : str
    pairs : list of (str, str)
        Names of parameters and their values as text, which override the profile's.
    log : callable
        Takes one line of progress.
    sources : Path
        Holds `notebooks` and `book`.
    root : Path
        Parent folder of `results` and `_build`.
    only : str, optional
        Name of a notebook: it runs, and those it needs by the profiles' `[after]`; no book is built.

    Returns
    -------
    Path or None
        The first page of the book; None if it was not requested.

    Raises
    ------
    InputError
        For an unknown profile, parameter or notebook, or when another report of this profile is being made.
    RunError
        When a notebook fails, or the book has a fault.
    """
    start_s = time.perf_counter()
    runs, left_out = _without_absent(_plan(profile, pairs, sources / "notebooks", only), dict(pairs), log)
    if only in left_out:
        raise InputError(f"--only {only}: {left_out[only]}")
    folders = Folders(sources, root.resolve(), profile)
    with locked_folder(folders.executed):
        run_all(runs, folders, log, only)
        page, is_new = build_book(folders, left_out) if only is None else (None, False)
    took = f"({time.perf_counter() - start_s:.0f} s)"
    if only is not None:
        log(f"The results are in {folders.results / only}; no book was built {took}")
        return None
    log(f"book: {'built' if is_new else 'unchanged'}")
    log(f"The report is {page} {took}")
    return page


def _plan(profile: str, pairs: list[tuple[str, str]], folder: Path, only: str | None) -> list[Run]:
    """Every notebook with its parameters from cell, profile and `pairs`, where later ones override."""
    notebooks = read_notebooks(folder)
    if only is not None:
        refuse_unknown("--only: notebook", only, [notebook.name for notebook in notebooks])
    chosen, after = read_profile(folder / "profiles.toml", profile, notebooks)
    overrides = parse_overrides(pairs, notebooks)
    runs = []
    for notebook in notebooks:
        name = notebook.name
        parameters = notebook.defaults | chosen.get(name, {}) | overrides[name]
        _refuse_unknown_detectors(notebook, parameters)
        runs.append(Run(notebook, parameters, after.get(name, [])))
    return runs


def _refuse_unknown_detectors(notebook: Notebook, parameters: dict[str, Any]) -> None:
    for name in (name for name, words in notebook.allowed.items() if words.startswith(_DETECTORS)):
        for one in [value] if isinstance(value := parameters[name], str) else value:
            if not one.startswith(COMBINED):
                refuse_unknown(f"-p {name}: detector", one, [*DETECTORS, f"{COMBINED}BODY+HANDS"])


def _without_absent(
    runs: list[Run], asked_for: Collection[str], log: Callable[[str], None]
) -> tuple[list[Run], dict[str, str]]:
    """The runs without detectors whose weights are absent, and why some are left out, by name."""
    able, left_out = [], {}
    for run in runs:
        parameters, dropped, can_run = without_absent(run.parameters, asked_for)
        if dropped:
            said = f"the weights of {', '.join(sorted(dropped))} are absent; hicp models fetch gets them"
            log(f"{run.notebook.name}: {'runs without some detectors' if can_run else 'left out'}: {said}")
        if can_run:
            able.append(replace(run, parameters=parameters))
        else:
            left_out[run.notebook.name] = said
    return able, left_out


def absent_weights(detector: str) -> list[str]:
    """Names of the weight files that a detector, or a part of a combination, needs and that are absent.

    Examples
    --------
    >>> absent_weights("movenet-thunder"), absent_weights("no detector")
    ([], [])
    """
    parts = set(detector.removeprefix(COMBINED).split("+"))
    used = [weight for weight in registry().values() if parts & set(weight.used_by)]
    return [weight.name for weight in used if not weight.path.is_file()]


def without_absent(
    parameters: dict[str, Any], asked_for: Collection[str] = ()
) -> tuple[dict[str, Any], set[str], bool]:
    """A notebook's parameters without detectors whose weights are absent.

    Parameters
    ----------
    parameters : dict of str to object
    asked_for : list of str
        Names of parameters that the user set, which are not changed.

    Returns
    -------
    parameters : dict of str to object
    dropped : set of str
        Detectors whose weights are absent.
    can_run : bool
        False if no detector is left in a list, or a single one is absent that is in no list.
    """
    free = {name: value for name, value in parameters.items() if name not in asked_for}
    named = [one for value in free.values() for one in (value if isinstance(value, list) else [value])]
    absent = [one for one in named if isinstance(one, str) and absent_weights(one)]
    lists = {name: value for name, value in free.items() if isinstance(value, list)}
    kept = parameters | {name: [one for one in value if one not in absent] for name, value in lists.items()}
    can_run = all(kept[name] or not value for name, value in lists.items())
    for name, value in free.items():
        if isinstance(value, str) and value in absent:
            offered = [key for key, one in parameters.items() if isinstance(one, list) and value in one]
            can_run &= bool(offered)
            kept[name] = next((kept[key][0] for key in offered if kept[key]), value)
    return kept, set(absent), can_run

"""Docstrings are numpydoc with types in the type slots, and their examples are true."""

from __future__ import annotations

import doctest
import importlib
from pathlib import Path

import pytest

from tests.docstrings import MODULES, problems

PENDING = Path(__file__).with_name("docstrings_pending.txt").read_text().split()
WITH_EXAMPLES = [name for name, path in MODULES.items() if ">>>" in path.read_text()]

BAD = '''
"""A module."""

from pathlib import Path


def good(path: Path, size_px: tuple[int, int], names: list[str], start=0) -> dict:
    """Read.

    Parameters
    ----------
    path : Path
    size_px : (int, int)
        Width and height.
    names : sequence of str, optional
    start : {0, 1} or None, default 0

    Returns
    -------
    dict of str to array, shape (n, 2)
    """


def prose(path):
    """Read.

    Parameters
    ----------
    path : where it lies
    """


def unit(length_m):
    """Measure.

    Parameters
    ----------
    length_m : float, of the arm

    Returns
    -------
    The same, longer
    """


def bare(a, b, c):
    """Add."""


def renamed(a):
    """Add.

    Parameters
    ----------
    b : int
    """


def none(a):
    pass


class Wrong:
    """Things.

    Attributes
    ----------
    x_m : float
    y_m : Nowhere
    """

    x_m: float
'''


def test_faults_are_found(tmp_path, monkeypatch):
    (tmp_path / "badly_documented.py").write_text(BAD)
    monkeypatch.syspath_prepend(tmp_path)
    found = problems("badly_documented")
    assert [line.split(": ")[0].removeprefix("badly_documented.") for line in found] == [
        "prose", "unit", "unit", "bare", "renamed", "none", "Wrong", "Wrong"
    ]  # fmt: skip


@pytest.mark.parametrize("name", [name for name in MODULES if name not in PENDING])
def test_docstrings_are_well_formed(name):
    assert problems(name) == []


def test_what_is_pending_is_not_done():
    """Else the list has to be written anew, see `tests.docstrings`."""
    assert [name for name in PENDING if name not in MODULES or not problems(name)] == []


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_examples_are_true(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    failed, tried = doctest.testmod(importlib.import_module(name))
    assert tried
    assert not failed

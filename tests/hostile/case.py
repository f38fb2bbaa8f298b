"""What one hostile input is: how it is made, what is asked with it, and what answers are right."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

OUTPUTS = "out"  # what names of files begin with that a command may write
FULL_DISK = "out_disk"  # where a case may mount a small file system


@dataclass(frozen=True)
class Case:
    """One hostile input and what is asked with it.

    Attributes
    ----------
    name : str
        Unique; its part before the colon is its kind.
    command : str or list of str
        Arguments of `hicp`, run in the folder of `tests.hostile.good` as `make` changed it.
    make : callable, optional
        Changes the folder it is given.
    exits : tuple of int
        Exit codes that are right; 2 is one line on standard error.
    says : str
        A part of what is printed.
    notes : bool
        Lines beside that one are right.
    check : callable, optional
        Given the folder after the command and what was printed; says what is wrong with them, or nothing.
    serve : callable, optional
        Given a connection that was accepted; answers it. Its port takes the place of `PORT` in the command.
    fresh : bool
        In an interpreter of its own, as a user starts it, in place of a fork of one that is ready.
    environment : dict, optional
        Variables beside those of the caller.
    """

    name: str
    command: str | list[str]
    make: Callable[[Path], Any] = lambda folder: None
    exits: tuple[int, ...] = (2,)
    says: str = ""
    notes: bool = False
    check: Callable[[Path, str], str | None] | None = None
    serve: Callable[[Any], None] | None = None
    fresh: bool = False
    environment: tuple[tuple[str, str], ...] = ()

    @property
    def kind(self) -> str:
        return self.name.partition(":")[0]

    def arguments(self, port: int | None = None) -> list[str]:
        """What follows `hicp` on the command line."""
        words = shlex.split(self.command) if isinstance(self.command, str) else list(self.command)
        return [word.replace("PORT", str(port)) for word in words]


def writing(name: str, content: bytes | str) -> Callable[[Path], None]:
    """A `make` that puts this content under a name."""

    def make(folder: Path) -> None:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)

    return make


def unique(cases: Iterator[Case]) -> dict[str, Case]:
    """Cases by their names."""
    by_name: dict[str, Case] = {}
    for case in cases:
        assert case.name not in by_name, case.name
        by_name[case.name] = case
    return by_name

"""Identities and everything sampled with them, in two disjoint splits.

Methods are tuned on *development* identities; the report evaluates on *held-out* ones. `data/identities.json`
assigns to each split the shapes of the body model, and the seeds from which clothes (with skin and hair),
rooms, lights, poses and cameras are sampled.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import zip_longest
from typing import Any

import numpy as np

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json
from hicp_lib.core.memo import memoised, plain_fields

Rng = np.random.Generator

SPLITS = ("development", "held out")
HELD_OUT = SPLITS[1]
KINDS = ("clothes", "room", "lights", "poses", "camera")
PEOPLE = read_json(DATA_DIR / "people.json")
"""Distributions of joints, poses, hands, hair, clothes and skin; see data/README.md."""
_read = memoised()(read_json)


@dataclass(frozen=True)
class Identity:
    """One person and the seeds of everything around them.

    Attributes
    ----------
    split : str
        One of `SPLITS`.
    body : str
        Name of a shape of the body model.
    clothes, room, lights, poses, camera : int
        The seed of each.
    """

    split: str
    body: str
    clothes: int
    room: int
    lights: int
    poses: int
    camera: int

    def draw(self, kind: str, *more: int | str) -> np.random.Generator:
        """A new generator for one of `KINDS`; with `more`, an independent one, see `stream`."""
        return stream(kind, getattr(self, kind), *more)


@dataclass(frozen=True)
class Subject:
    """One person of an experiment, with everything sampled around them.

    Subjects of one seed are different people: bodies are assigned without repetition, alternating women and
    men.

    Attributes
    ----------
    seed : int
        Of the experiment.
    number : int
        Of the person, from 0, below the number of bodies.
    split : str
        One of `SPLITS`.

    Raises
    ------
    InputError
        If a number is not whole or out of range, or there is no such split.

    Examples
    --------
    >>> len({Subject(0, number).identity.body for number in range(40)})
    40
    """

    seed: int = 0
    number: int = 0
    split: str = HELD_OUT

    def __post_init__(self) -> None:
        plain_fields(self)
        for name, most in (("seed", 2**32), ("number", len(split_members(self.split)["bodies"]) - 1)):
            value = getattr(self, name)
            if not isinstance(value, int) or not 0 <= value <= most:
                raise InputError(f"{name} is {value!r}; expected a whole number from 0 to {most}")

    @cached_property
    def identity(self) -> Identity:
        """The subject's identity; the same in every process."""
        return draw_identity(self.stream("identity"), self.split, _dealt(self.split, self.seed)[self.number])

    def stream(self, *numbers: int | str) -> np.random.Generator:
        """A generator for noise and the like of this subject only, see `stream`."""
        return stream(self.split, self.seed, self.number, *numbers)


def stream(*numbers: int | str) -> np.random.Generator:
    """A generator of random numbers, independent of other streams.

    Parameters
    ----------
    *numbers : int or str
        Non-negative; a name counts as the codes of its letters.

    Examples
    --------
    >>> stream("clothes", 0).random() == stream("room", 0).random()
    False
    """
    flat = [n for number in numbers for n in (number.encode() if isinstance(number, str) else (number,))]
    return np.random.default_rng([len(flat), *flat])  # without the length, zeros at the end would not count


def draw_identity(rng: np.random.Generator, split: str, body: str | None = None) -> Identity:
    """A random identity of a split.

    Parameters
    ----------
    rng : numpy.random.Generator
    split : str
        One of `SPLITS`.
    body : str, optional
        Name of the shape; sampled by default.

    Returns
    -------
    Identity

    Raises
    ------
    InputError
        If there is no such split.
    """
    members = split_members(split)
    names, ranges = members["bodies"], {kind: members[kind] for kind in KINDS}
    numbers = {kind: int(rng.integers(low, high + 1)) for kind, (low, high) in ranges.items()}
    return Identity(split, body or names[rng.integers(len(names))], **numbers)


def split_members(split: str) -> Mapping[str, Any]:
    """Members of a split: names of its `bodies`, and for each of `KINDS` the smallest and largest seed.

    Raises
    ------
    InputError
        If there is no such split.
    """
    if split not in SPLITS:
        raise InputError(f"no people {split!r}; choose one of {', '.join(SPLITS)}")
    return _read(DATA_DIR / "identities.json")[split]


def traits(name: str) -> Mapping[str, Any]:
    """Parameters of a shape, see data/body.json."""
    return _read(DATA_DIR / "body.json")["shapes"][name]


def is_woman(name: str) -> bool:
    """Whether a shape is a woman's; otherwise it is a man's."""
    return traits(name)["gender"] == 1.0


@memoised(16)
def _dealt(split: str, seed: int) -> list[str]:
    """A split's shapes in random order, alternating women and men as long as there are both."""
    mixed = [str(name) for name in stream(split, seed, "bodies").permutation(split_members(split)["bodies"])]
    women, men = ([name for name in mixed if is_woman(name) == woman] for woman in (True, False))
    turns = [women, men] if is_woman(mixed[0]) else [men, women]
    return [name for pair in zip_longest(*turns) for name in pair if name is not None]

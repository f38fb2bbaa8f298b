"""What a detector takes for granted about a model file, for people to read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Fact:
    """One property of a model: what, its value, and how it is known."""

    what: str
    value: str
    why: str

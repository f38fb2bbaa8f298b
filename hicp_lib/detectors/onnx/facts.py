"""What a detector takes for granted about a model file, for people to read."""

from typing import NamedTuple


class Fact(NamedTuple):
    """One property of a model.

    Attributes
    ----------
    what, value : str
    why : str
        How the value is known.
    """

    what: str
    value: str
    why: str

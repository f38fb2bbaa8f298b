"""Readable lists of what a detector assumes about a model file."""

from typing import Any, NamedTuple

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.files import read_json

TEXTS = read_json(DATA_DIR / "model_facts.json")
KNOWN_NETWORKS = ", ".join(TEXTS["networks"])
"""The networks that the detectors accept, in one line."""


class Fact(NamedTuple):
    """One property of a model.

    Attributes
    ----------
    what, value : str
    why : str
        How the value was determined.
    """

    what: str
    value: str
    why: str


def facts(name: str, **values: Any) -> list[Fact]:
    """The assumptions about one kind of network.

    Parameters
    ----------
    name : str
        Key of `facts` in `data/model_facts.json`.
    **values : object
        Values for the placeholders in braces.

    Examples
    --------
    >>> facts("nanodet", min_score=0.3, max_overlap=0.6)[1]
    Fact(what='person score', value='>= 0.3', why='overlaps above 0.6 are suppressed')
    """
    return [Fact(*(text.format(**values) for text in row)) for row in TEXTS["facts"][name]]

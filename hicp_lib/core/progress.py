"""A bar for what takes longer than two seconds; on a terminal only."""

from collections.abc import Iterable
from typing import TypeVar

from tqdm import tqdm

_Item = TypeVar("_Item")


def with_bar(items: Iterable[_Item], what: str, unit: str = "it") -> Iterable[_Item]:
    """The same items, with a bar on standard error while they are gone through.

    Parameters
    ----------
    items : iterable
    what : str
        What is done with them.
    unit : str, optional
        What they are.

    Returns
    -------
    iterable

    Examples
    --------
    >>> list(with_bar(range(3), "counting"))
    [0, 1, 2]
    """
    return tqdm(items, what, unit=unit, disable=None, delay=2.0, leave=False)

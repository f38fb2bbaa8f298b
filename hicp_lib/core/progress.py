"""A progress bar for loops longer than two seconds; on a terminal only."""

from collections.abc import Iterable
from typing import TypeVar

from tqdm import tqdm

_Item = TypeVar("_Item")


def with_bar(items: Iterable[_Item], what: str, unit: str = "it") -> Iterable[_Item]:
    """Iterate over items, with a progress bar on standard error.

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

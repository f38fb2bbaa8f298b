"""Which squares are trained on, which are held back, and in which order they come."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np

HELD_BACK = 4
"""Development bodies, the last of their sorted names, that are not trained on."""
N_CHECKED = 1500
"""About how many of their squares are looked at."""


def batches(rows: np.ndarray, size: int, seed: int, first: int, last: int) -> Iterator[np.ndarray]:
    """The rows of each step from `first`: all rows, in another order each time."""
    per_epoch = len(rows) // size
    if not per_epoch:
        sys.exit(f"{len(rows)} squares to train on are fewer than one step's {size}; make more")
    for k in range(first, last):
        epoch, place = divmod(k, per_epoch)
        if k == first or place == 0:
            order = np.random.default_rng([seed, epoch]).permutation(rows)
        yield np.sort(order[place * size : (place + 1) * size])


def chosen_rows(truth: dict[str, np.ndarray], views: str, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Rows to train on, of a share of the pictures, and some rows of the bodies that are held back."""
    bodies, pictures = sorted(set(truth["body"])), sorted(set(truth["picture"]))
    back = np.isin(truth["body"], bodies[-HELD_BACK:])
    used = np.random.default_rng(0).permutation(pictures)[: round(share * len(pictures))]
    of_view = np.isin(truth["view"], views.split("+")) if views else True
    chosen = ~back & of_view & np.isin(truth["picture"], used)
    checking = np.flatnonzero(back)
    return np.flatnonzero(chosen), checking[:: max(1, len(checking) // N_CHECKED)]

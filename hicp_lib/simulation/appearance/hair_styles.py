"""Styles of hair: how long it is, how it grows and lies, and who wears it."""

from dataclasses import dataclass

from hicp_lib.simulation.body.identities import PEOPLE, Rng


@dataclass(frozen=True)
class Style:
    """How hair grows and lies.

    Attributes
    ----------
    top_m, side_m : float
        Length on the crown and above the ears.
    lift : float
        How steeply it leaves the scalp, 0 flat to 1 upright.
    comb : tuple of float
        Direction it is combed to, in the head's frame (x forward, y left, z up), and how firmly.
    gravity : float
        Pull downwards per step.
    curl : float
        Random wandering, 0 straight.
    volume_m : float
        Thickness of the layer of hair.
    parting : float
        Sign of the side it is parted on, 0 none.
    tie : str
        "", "tail" or "bun": gathered at the back of the head.
    n_locks, n_steps : int
        How many locks of how many pieces.
    width_m : float
        Width of a lock.
    coil_m : float
        Radius of curls.
    """

    top_m: float
    side_m: float
    lift: float = 0.3
    comb: tuple[float, float, float] = (0.3, 0.0, -0.3)
    gravity: float = 0.15
    curl: float = 0.1
    volume_m: float = 0.012
    parting: float = 0.0
    tie: str = ""
    n_locks: int = 1400
    n_steps: int = 6
    width_m: float = 0.006
    coil_m: float = 0.0


_MOST_CURL = 0.10  # of the sampled lengths


def random_style(rng: Rng, woman: bool, age: float) -> Style | None:
    """A hair style; None for a shaven or bald head.

    Parameters
    ----------
    rng : numpy.random.Generator
    woman : bool
    age : float
        Years.

    Examples
    --------
    >>> import numpy as np
    >>> style = random_style(np.random.default_rng(0), woman=True, age=25)
    >>> 0.1 <= style.top_m < 0.5
    True
    """
    parting = float(rng.choice([-1, 1]))
    odds = PEOPLE["hair"]["women" if woman else "young_men" if age < 50 else "old_men"]
    kind = str(rng.choice(list(odds), p=list(odds.values())))
    wave = rng.uniform(0.0, _MOST_CURL)
    if kind == "bald":
        return None
    style = dict(PEOPLE["hair_styles"][kind])
    for name in ("top_m", "side_m"):
        style[name] = rng.uniform(*style[name]) if isinstance(style[name], list) else style[name]
    if kind in ("long", "bob"):
        style["side_m"] *= style["top_m"]
    style["parting"] *= parting
    return Style(**style | {"curl": wave if style["curl"] is None else style["curl"]})

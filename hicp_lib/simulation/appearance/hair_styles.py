"""Styles of hair: how long it is, how it grows and lies, and who wears it."""

from dataclasses import dataclass

import numpy as np

Rng = np.random.Generator


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


# How often a style is worn, by women, by men before and from the age of 50.
_WOMEN = {"long": 0.30, "bob": 0.2, "tail": 0.18, "bun": 0.12, "short": 0.1, "curly": 0.1}
_YOUNG_MEN = {"side": 0.42, "quiff": 0.2, "crop": 0.16, "curly": 0.08, "bald": 0.14}
_OLD_MEN = {"side": 0.4, "quiff": 0.05, "crop": 0.25, "curly": 0.05, "bald": 0.25}
# Length on the crown (m; a range is drawn from) and at the sides (a range; a share of the crown's for long
# hair), lift, comb, gravity, curl (None: drawn), volume (m), parted, tie, locks, pieces, width, coil (m).
_STYLES: dict[str, tuple] = {
    "long": ((0.30, 0.48), 0.95, 0.06, (-0.5, 0, -0.3), 1.0, None, 0.014, 1, "", 850, 9, 0.020, 0.0),
    "bob": ((0.17, 0.25), 0.85, 0.06, (-0.3, 0, -0.4), 1.0, None, 0.016, 1, "", 900, 7, 0.018, 0.0),
    "tail": (0.3, 0.3, 0.05, (-1, 0, 0.1), 0.0, 0.01, 0.006, 0, "tail", 700, 7, 0.013, 0.0),
    "bun": (0.3, 0.3, 0.05, (-1, 0, 0.1), 0.0, 0.01, 0.006, 0, "bun", 700, 7, 0.013, 0.0),
    "short": (0.10, 0.07, 0.08, (0.1, 0, -0.5), 0.5, None, 0.016, 1, "", 1300, 5, 0.011, 0.0),
    "curly": (0.07, 0.05, 0.5, (0, 0, -0.3), 0.1, 0.1, 0.03, 0, "", 1150, 7, 0.010, 0.007),
    "side": ((0.045, 0.08), (0.012, 0.025), 0.10, (0.45, 0, -0.2), 0.1, None, 0.014, 1, "",
             1600, 4, 0.009, 0.0),
    "quiff": ((0.04, 0.06), 0.014, 0.22, (-0.9, 0, 0.25), 0.05, None, 0.020, 0, "", 1600, 4, 0.009, 0.0),
    "crop": ((0.010, 0.018), 0.009, 0.3, (0.3, 0, -0.1), 0.0, 0.05, 0.010, 0, "", 1900, 2, 0.007, 0.0),
}  # fmt: skip
_LONG = ("long", "bob")
_MOST_CURL = 0.10  # of what is drawn


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
    >>> style = random_style(np.random.default_rng(0), woman=True, age=25)
    >>> 0.1 <= style.top_m < 0.5
    True
    """
    parting = float(rng.choice([-1, 1]))
    odds = _WOMEN if woman else _YOUNG_MEN if age < 50 else _OLD_MEN
    kind = str(rng.choice(list(odds), p=list(odds.values())))
    wave = rng.uniform(0.0, _MOST_CURL)
    if kind == "bald":
        return None
    top, side, lift, comb, gravity, curl, volume_m, is_parted, *others = _STYLES[kind]
    top_m, side_m = (rng.uniform(*drawn) if isinstance(drawn, tuple) else drawn for drawn in (top, side))
    side_m = side_m * top_m if kind in _LONG else side_m
    curl, parting = wave if curl is None else curl, parting if is_parted else 0.0
    return Style(top_m, side_m, lift, comb, gravity, curl, volume_m, parting, *others)

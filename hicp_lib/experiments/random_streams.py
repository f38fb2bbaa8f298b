"""Streams of random numbers: what a seed draws in one experiment says nothing about what it draws in another.

A stream is the seed and numbers after it, which `numpy.random.SeedSequence` mixes. Frames, doses and
photographs put their own number or name there; whole scenes the number of a stream below.
"""

import numpy as np

SEATED_PERSON = 1
MOVING_PERSON = 3
MOTION_CAPTURE = 4
AVOIDANCE = 4  # followed by the script's name, so it is never the stream of motion capture


def stream(seed: int, *numbers: int | str) -> np.random.Generator:
    """A generator of the random numbers of a stream.

    Parameters
    ----------
    seed : int
    *numbers : int or str
        A name counts as its letters' numbers.

    Examples
    --------
    >>> stream(0, SEATED_PERSON).random() == stream(0, MOVING_PERSON).random()
    False
    """
    flat = [n for number in numbers for n in (number.encode() if isinstance(number, str) else (number,))]
    return np.random.default_rng([seed, *flat])

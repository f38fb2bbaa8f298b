"""Materials of objects: paint, wood, floors, cloth on furniture, the view from a window."""

import colorsys

import numpy as np
from numpy.typing import ArrayLike

from hicp_lib.simulation.rendering import textures
from hicp_lib.simulation.rendering.surfaces import Look, Material, column

Rng = np.random.Generator


def linear(srgb: ArrayLike) -> np.ndarray:
    """sRGB in [0, 1] to linear RGB.

    Examples
    --------
    >>> linear([0.0, 0.5, 1.0]).round(3)
    array([0.   , 0.214, 1.   ])
    """
    srgb = np.asarray(srgb, float)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def hsv(hue: float, saturation: float, value: float) -> np.ndarray:
    """An sRGB colour in linear RGB, from its hue (any number), saturation and value (0 to 1).

    Parameters
    ----------
    hue, saturation, value : float

    Returns
    -------
    array, shape (3,)
    """
    return linear(colorsys.hsv_to_rgb(hue % 1, np.clip(saturation, 0, 1), np.clip(value, 0, 1)))


def any_colour(rng: Rng) -> np.ndarray:
    """A typical colour of objects: mostly muted, sometimes strong, linear RGB."""
    if rng.random() < 0.25:
        return linear(np.full(3, rng.choice([0.1, 0.2, 0.5, 0.75, 0.9])))
    return hsv(rng.random(), rng.beta(2, 2.2), rng.uniform(0.2, 0.9))


def muted(rng: Rng) -> np.ndarray:
    """A typical colour of furniture and curtains: greys and dull colours, linear RGB."""
    return hsv(rng.random(), rng.beta(1.4, 6), rng.uniform(0.2, 0.85))


def off_white(rng: Rng) -> np.ndarray:
    """White as paint is white, linear RGB."""
    return hsv(rng.uniform(0.06, 0.16), rng.uniform(0, 0.06), rng.uniform(0.84, 0.95))


def wood_colour(rng: Rng) -> np.ndarray:
    """The mean colour of a wood, linear RGB."""
    return hsv(rng.uniform(0.055, 0.095), rng.uniform(0.3, 0.6), rng.uniform(0.3, 0.8))


def plain(colour: np.ndarray, roughness: float = 0.5, gloss: float = 0.04, glow: float = 0.0) -> Look:
    """One colour all over.

    Parameters
    ----------
    colour : array, shape (3,)
        Linear RGB.
    roughness, gloss : float, optional
        See `surfaces.Look`.
    glow : float, optional
        Emitted light, as a fraction of the colour.

    Returns
    -------
    Look
    """
    return Look(column(colour), gloss=gloss, roughness=roughness, glow=glow and column(glow * colour))


def one_of(colours: list[np.ndarray], roughness: float) -> Material:
    """Plain colours, (3,) each; the mesh's only coordinate says which."""
    palette = np.array(colours, np.float32).T

    def look(coords: np.ndarray, footprint_m: np.ndarray) -> Look:
        return Look(palette.take(np.rint(coords[0]).astype(int), axis=1), roughness=roughness)

    return look


def mixed(
    pattern: textures.Pattern, colours: np.ndarray, roughness: float, height_m=0.0, gloss=0.04
) -> Material:
    """Colours mixed by a pattern.

    Parameters
    ----------
    pattern : callable
        One of `textures`, of n channels.
    colours : array, shape (n + 1, 3)
        Linear RGB: where all channels are 0, and where each is 1.
    roughness : float
    height_m : float, optional
        Of bumps where the first channel is 1.
    gloss : float, optional

    Returns
    -------
    callable
    """
    base, extra = column(colours[0]), (colours[1:].astype(np.float32) - colours[0].astype(np.float32)).T

    def look(coords: np.ndarray, footprint_m: np.ndarray) -> Look:
        weights = textures.sample(pattern, coords[:2], footprint_m)[: extra.shape[1]]
        height = height_m * weights[0] if height_m else 0.0
        return Look(base + extra @ weights, height_m=height, roughness=roughness, gloss=gloss)

    return look


def paint(colour: np.ndarray, unevenness: float) -> Material:
    """Paint on plaster."""
    return mixed(textures.plaster, np.array([colour * (1 - unevenness), colour * (1 + unevenness)]), 0.8)


def wooden(rng: Rng) -> Material:
    """Furniture wood."""
    return mixed(textures.wood, np.outer([0.6, 1.25], wood_colour(rng)), rng.uniform(0.3, 0.6))


def upholstery(rng: Rng) -> Material:
    """Cloth on furniture."""
    return mixed(textures.carpet, np.outer([0.85, 1.15], muted(rng)), 0.9, gloss=0.02)


def random_floor(rng: Rng) -> Material:
    """Boards, tiles, carpet or screed."""
    kind = rng.choice(4, p=[0.45, 0.2, 0.25, 0.1])
    if kind == 0:
        boards = np.outer([0.55, 1.3, 0.15], wood_colour(rng))
        return mixed(textures.planks, boards, rng.uniform(0.25, 0.6))
    if kind == 1:
        colour = hsv(rng.random(), rng.uniform(0, 0.2), rng.uniform(0.35, 0.9))
        grout = linear(np.full(3, rng.uniform(0.3, 0.7)))
        return mixed(textures.tiles, np.array([colour * 0.85, colour * 1.15, grout]), rng.uniform(0.15, 0.4))
    colour = hsv(rng.random(), rng.uniform(0, 0.22), rng.uniform(0.25, 0.75))
    if kind == 2:
        return mixed(textures.carpet, np.outer([0.8, 1.2], colour), 0.95, gloss=0.01)
    return mixed(textures.plaster, np.outer([0.9, 1.1], colour), 0.5)


def random_wall(rng: Rng) -> Material:
    """Paint, mostly light; sometimes darker, bricks or wooden boards."""
    kind = rng.choice(4, p=[0.6, 0.22, 0.1, 0.08])
    if kind == 0:
        return paint(hsv(rng.random(), rng.beta(1.2, 12), rng.uniform(0.7, 0.95)), 0.025)
    if kind == 1:
        return paint(hsv(rng.random(), rng.uniform(0.08, 0.3), rng.uniform(0.4, 0.8)), 0.03)
    if kind == 2:
        colour = hsv(rng.uniform(0.02, 0.07), rng.uniform(0.2, 0.6), rng.uniform(0.4, 0.8))
        mortar = linear(np.full(3, rng.uniform(0.5, 0.75)))
        return mixed(textures.bricks, np.array([colour * 0.6, colour * 1.3, mortar]), 0.9, 0.004)
    return mixed(textures.planks, np.outer([0.6, 1.25, 0.2], wood_colour(rng)), 0.6)


def pictured(number: int) -> Material:
    """A picture behind glass."""

    def look(coords: np.ndarray, footprint_m: np.ndarray) -> Look:
        seen = textures.sample(textures.picture, coords[:2], footprint_m, number)
        return Look(seen**2, roughness=0.3)

    return look


def foliage(rng: Rng) -> Material:
    """Leaves, each a little different."""
    colour = hsv(rng.uniform(0.22, 0.36), rng.uniform(0.4, 0.7), rng.uniform(0.3, 0.55))

    def look(coords: np.ndarray, footprint_m: np.ndarray) -> Look:
        return Look(column(colour) * (0.6 + 0.8 * coords[0]), roughness=0.4, softness=0.4)

    return look


def outside(rng: Rng) -> Material:
    """The bright view from a window: sky over blurred greenery."""
    sky = hsv(rng.uniform(0.54, 0.62), rng.uniform(0.0, 0.3), 1.0) * rng.uniform(1.5, 3.5)
    green = hsv(rng.uniform(0.15, 0.4), rng.uniform(0.1, 0.4), 0.6) * rng.uniform(0.8, 1.6)
    sky, green = column(sky), column(green)
    horizon, rough = rng.uniform(0.2, 0.7), rng.uniform(0.1, 0.3)

    def look(coords: np.ndarray, footprint_m: np.ndarray) -> Look:
        cloud = textures.sample(textures.cloud, coords[:2] * 0.4, 0.05)
        mix = np.clip((coords[1] - horizon + rough * cloud[0]) * 4 + 0.5, 0, 1)
        glow = (green + (sky - green) * mix) * (1 + 0.08 * cloud[1])
        return Look(np.zeros((3, 1), np.float32), glow=glow, roughness=0.1)

    return look

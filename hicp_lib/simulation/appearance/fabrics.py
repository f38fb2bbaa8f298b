"""Fabrics: patterns that follow the cloth, weave, folds and seams."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hicp_lib.core.keypoints import INDEX
from hicp_lib.simulation.appearance.materials import Rng, any_colour, hsv, linear
from hicp_lib.simulation.body.identities import PEOPLE
from hicp_lib.simulation.rendering import textures
from hicp_lib.simulation.rendering.surfaces import Look, Material, column

Panels = tuple[np.ndarray, np.ndarray]
"""Flat panels of a person's garments, at rest in the body frame: origins in metres, (5, 3), and
axis, front and side of each panel, (5, 3, 3), unit vectors at right angles to each other. 0 is the trunk,
then come left arm, right arm, left leg and right leg; coordinates run along the axis and around it, from
the front."""

_PANEL_ENDS = (("mid_hip", "neck"), ("left_shoulder", "left_wrist"), ("right_shoulder", "right_wrist"),
               ("left_hip", "left_ankle"), ("right_hip", "right_ankle"))  # fmt: skip
_BACK_M = 3.0  # where the trunk's back is on its panel: prints are on the chest only
_PANEL_RADII_M = np.array([0.15, 0.06, 0.06, 0.085, 0.085], np.float32)  # assumed radii of limbs


def make_panels(landmarks_m: np.ndarray) -> Panels:
    """Panels for a person with these keypoints at rest, shape (136, 3)."""
    starts, ends = (landmarks_m[[INDEX[pair[k]] for pair in _PANEL_ENDS]] for k in (0, 1))
    axes = np.array([axis / np.linalg.norm(axis) for axis in ends - starts])
    axes[0] = [0, 0, 1]
    fronts = [1.0, 0, 0] - axes.astype(float) * axes[:, :1]
    fronts = (fronts / np.linalg.norm(fronts, axis=1, keepdims=True)).astype(np.float32)
    return starts, np.stack([axes, fronts, np.cross(axes, fronts)], axis=1)


def panel_coordinates(panels: Panels, coords: np.ndarray, limbs: str) -> tuple[np.ndarray, np.ndarray]:
    """Panels and panel coordinates of points on a garment.

    Parameters
    ----------
    panels : Panels
    coords : array, shape (7, n)
        The garment's, see `clothing.put_on`.
    limbs : str
        "arms" for tops, whose sleeves begin where the `arm` field does, "legs" for trousers,
        whose halves meet in the middle, "" for skirts.

    Returns
    -------
    uv_m : array, shape (2, n), dtype float32
        Around and along the panel.
    panel : array of int, shape (n,)
    """
    rest, arm = coords[:3], coords[3]
    left = rest[1] > 0
    panel = np.zeros(len(arm), np.int8)
    if limbs == "arms":
        panel = np.where(arm > 0.15, np.where(left, 1, 2), 0)
    elif limbs == "legs":
        panel = np.where(left, 3, 4)
    uv = np.empty((2, len(arm)), np.float32)
    for number in np.unique(panel):
        rows = np.flatnonzero(panel == number)
        local = rest.take(rows, axis=1) - column(panels[0][number])
        axis, front, side = panels[1][number]
        around = np.arctan2(side @ local, front @ local) * _PANEL_RADII_M[number]
        along = axis @ local
        if number == 0 and limbs:  # two flat panels, front and back, that bend round the sides
            x, y = local[0], local[1]
            around = y + np.sign(y) * np.maximum(0.04 - np.abs(x), 0)
            around = np.where(x < 0, _BACK_M - around, around)
        uv[0, rows], uv[1, rows] = around, along
    return uv, panel


Weights = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Fabric:
    """A cloth: up to three colours, the pattern that mixes them, its surface.

    Attributes
    ----------
    colours : array, shape (3, 3)
        Linear RGB.
    pattern : callable or None
        Maps panel coordinates (2, n) and footprints (n,) to weights of the second colour, and of the
        third if it has one, (1, n) or (2, n); None for plain cloth.
    weave_m, crease_m : float
        Bump heights.
    fuzz : float
        The softness of `surfaces.Look`.
    """

    colours: np.ndarray
    pattern: Weights | None = None
    weave_m: float = 0.00012
    crease_m: float = 0.004
    fuzz: float = 0.15


def random_fabric(rng: Rng, plain: float) -> Fabric:
    """Cloth for shirts; `plain` is the chance of a single colour."""
    colours = np.array([any_colour(rng) for _ in range(3)])
    if rng.random() < 0.3:  # people mostly wear white, black and grey
        colours[0] = linear(np.full(3, rng.choice([0.93, 0.06, 0.15, 0.55])))
    return Fabric(
        colours,
        weave_m=rng.choice([0.0, 0.0001, 0.0002]),
        crease_m=rng.uniform(0.002, 0.006),
        fuzz=rng.uniform(0.05, 0.3),
        pattern=None if rng.random() < plain else _random_pattern(rng),
    )


# Frequency of a pattern, range of its period (m), its texture and the texture's parameters.
_PATTERNS = PEOPLE["patterns"]


def _random_pattern(rng: Rng) -> Weights:
    kind = str(rng.choice(list(_PATTERNS), p=[often for often, *_ in _PATTERNS.values()]))
    _, period, texture, numbers = _PATTERNS[kind]
    number, period_m, pattern = rng.choice(numbers), rng.uniform(*period), getattr(textures, texture)

    def weights(uv: np.ndarray, footprint: np.ndarray) -> np.ndarray:
        turned = uv[::-1] if kind == "uprights" else uv
        return textures.sample(pattern, turned / period_m, footprint / period_m, number)

    return weights


def printed(rng: Rng) -> Weights:
    """A print on the chest."""
    number, size = int(rng.integers(24)), rng.uniform(0.7, 1.1)

    def weights(uv: np.ndarray, footprint: np.ndarray) -> np.ndarray:
        place = np.stack([0.15 + uv[0] / size, 0.15 - (uv[1] - 0.34) / size])
        found = textures.sample(textures.prints, place, footprint / size, number)
        inside = (np.abs(place - 0.15) < 0.15).all(axis=0)
        return found * inside

    return weights


def denim(rng: Rng) -> Fabric:
    """Jeans, from raw to bleached; sometimes black."""
    value = rng.uniform(0.18, 0.62)
    blue = hsv(rng.uniform(0.58, 0.63), rng.uniform(0.35, 0.65), value)
    if rng.random() < 0.25:
        blue = linear(np.full(3, rng.uniform(0.06, 0.2)))
    worn = np.minimum(blue * 1.8 + 0.03, 0.6)

    def fade(uv: np.ndarray, footprint: np.ndarray) -> np.ndarray:
        cloud = textures.sample(textures.cloud, uv * 0.8, footprint)
        grain = textures.sample(textures.carpet, uv * np.float32(1.5), footprint * 1.5)[0] - 0.5
        thigh = np.exp(-((uv[0] / 0.05) ** 2)) * np.exp(-(((uv[1] - 0.2) / 0.25) ** 2))
        return np.clip(0.55 * thigh + 0.10 * cloud[0] + 1.1 * grain, 0, 1)[None]

    return Fabric(np.array([blue, worn, worn]), fade, 0.0002, rng.uniform(0.004, 0.007), 0.1)


def plain_fabric(rng: Rng, dark: bool = False) -> Fabric:
    """Plain cloth for trousers and jackets, mostly in the colours those have."""
    colour = hsv(rng.uniform(0, 1), rng.uniform(0, 0.35), rng.uniform(0.08, 0.3 if dark else 0.7))
    if rng.random() < 0.4:
        colour = hsv(rng.uniform(0.07, 0.12), rng.uniform(0.15, 0.45), rng.uniform(0.25, 0.8))
    crease_m, fuzz = rng.uniform(0.003, 0.006), rng.uniform(0.05, 0.2)
    return Fabric(np.array([colour] * 3), None, 0.0001, crease_m, fuzz)


@dataclass(frozen=True)
class Trim:
    """Sewn details.

    Attributes
    ----------
    hem : float
        How wide hems are, in units of the garment's distance from its edge.
    band : float
        Factor of the colour of collar, cuffs and hem.
    line : str
        In front: "none", "buttons" or "zip".
    """

    hem: float = 0.03
    band: float = 0.92
    line: str = "none"


def cloth_material(fabric: Fabric, panels: Panels, limbs: str, trim: Trim) -> Material:
    """The material of a garment.

    Parameters
    ----------
    fabric : Fabric
    panels : Panels
    limbs : str
        As in `panel_coordinates`.
    trim : Trim

    Returns
    -------
    callable
        For meshes with `clothing.put_on`'s coords.
    """
    colours: np.ndarray = fabric.colours.astype(np.float32)
    base, extra = colours[:1].T, (colours[1:] - colours[:1]).T

    def look(coords: np.ndarray, footprint_m: np.ndarray) -> Look:
        rest, distance = coords[:3], coords[6]
        uv, panel = panel_coordinates(panels, coords, limbs)
        albedo = np.repeat(base, uv.shape[1], axis=1)
        if fabric.pattern is not None:
            weights = fabric.pattern(uv, footprint_m)
            albedo += extra[:, : len(weights)] @ weights
        weave = textures.sample(textures.weave, uv, footprint_m)[0]
        soft, creased = textures.sample(textures.wrinkles, uv, footprint_m)
        height = fabric.crease_m * (0.55 * soft + 0.30 * creased)
        albedo *= 1 + 0.10 * weave * (fabric.weave_m > 0) + 0.04 * soft
        height, albedo = _sew(trim, distance, rest, panel, height, albedo)
        height += np.float32(fabric.weave_m) * weave * (footprint_m < 0.002)
        return Look(np.clip(albedo, 0.002, 0.95), height, gloss=0.02, roughness=0.85, softness=fabric.fuzz)

    return look


def _sew(trim: Trim, distance, rest, panel, height, albedo) -> tuple[np.ndarray, np.ndarray]:
    """Heights (n,) and albedo (3, n) with hems and a line in front."""
    band = distance < trim.hem
    seam = np.abs(distance - trim.hem) < 0.006
    one = np.float32(1)  # with plain Python numbers, np.where would compute in double precision
    albedo = albedo * (np.where(band, np.float32(trim.band), one) * np.where(seam, np.float32(0.8), one))
    height = height * np.where(band, np.float32(0.4), one) + np.float32(0.0006) * band
    if trim.line == "none":
        return height, albedo
    front = (rest[0] > 0) & (panel == 0)
    across = np.abs(rest[1])
    placket = front & (across < 0.016)
    albedo *= np.where(front & (np.abs(across - 0.016) < 0.0015), np.float32(0.75), one)
    height = height + np.float32(0.001) * placket
    if trim.line == "zip":
        albedo = np.where(front & (across < 0.004), np.float32(0.25), albedo)
    else:
        along = np.mod(rest[2], 0.085) - 0.04
        button = front & (rest[1] ** 2 + along**2 < 0.0042**2)
        albedo = np.where(button, 0.55 * albedo + 0.25, albedo)
    return height, albedo

"""Shoes: a closed tube around each foot, which hides the toes, on a sole."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import convolve1d

from hicp_lib.core.keypoints import INDEX
from hicp_lib.core.memo import memoised
from hicp_lib.simulation.body.model import PosedBody, load_body
from hicp_lib.simulation.rendering import mesh as g
from hicp_lib.simulation.rendering import textures
from hicp_lib.simulation.rendering.surfaces import Look, Material, column


@dataclass(frozen=True)
class Shoes:
    """A pair of shoes.

    Attributes
    ----------
    upper, sole : array, shape (3,)
        Colours, linear RGB.
    height_m : float
        How far up the leg it reaches.
    thickness_m : float
    laces : bool
    roughness : float
        See `surfaces.Look`.
    """

    upper: np.ndarray
    sole: np.ndarray
    height_m: float = 0.07
    thickness_m: float = 0.007
    laces: bool = True
    roughness: float = 0.5


_N_ROWS, _N_ANGLES = 16, 24
SOLE_M = 0.022


def put_on_shoe(shoes: Shoes, posed: PosedBody, side: str) -> g.Mesh:
    """One shoe around a foot.

    Parameters
    ----------
    shoes : Shoes
    posed : PosedBody
    side : str
        "left" or "right".

    Returns
    -------
    g.Mesh
        Its coords: along from heel 0 to toe 1, metres across, height above the sole's bottom.
    """
    points = posed.vertices_m[_foot(side)].astype(float)
    frame, heel = _frame(posed, side), posed.keypoints_m[INDEX[f"{side}_heel"]]
    local = (points - heel) @ frame.T  # along, across, up
    bottom = np.percentile(local[:, 2], 1)
    local = local[local[:, 2] < bottom + shoes.height_m]
    outline = _tube(local, shoes.thickness_m)
    outline[..., 2] = np.maximum(outline[..., 2], bottom - 0.004)
    vertices = outline.reshape(-1, 3) @ frame + heel
    vertices[:, 2] = np.maximum(vertices[:, 2], posed.vertices_m[:, 2].min() + 0.001)
    along, across, up = np.moveaxis(outline, -1, 0)
    coords = np.stack([(along - along.min()) / (along.max() - along.min()), across, up - bottom], axis=-1)
    grid = vertices.astype(np.float32).reshape(outline.shape)
    return g.closed_grid(grid, coords.astype(np.float32), axis=1)


@memoised()
def _foot(side: str) -> np.ndarray:
    """Numbers of the vertices that a shoe goes around."""
    body = load_body()
    foot = body.in_regions("foot", "shin", "nail")
    left = body.vertices_m[0, :, 1] > 0
    return np.flatnonzero(foot & (body.field("leg") > 1.85) & (left == (side == "left")))


def _frame(posed: PosedBody, side: str) -> np.ndarray:
    """Rows: from heel to toe, across (to the foot's left), up, in the world."""
    names = (f"{side}_{part}" for part in ("heel", "big_toe", "small_toe"))
    heel, toe, little = (posed.keypoints_m[INDEX[name]] for name in names)
    along = g.unit((0.6 * toe + 0.4 * little - heel).astype(float))
    across = (toe - little) * (-1 if side == "left" else 1)
    across = g.unit((across - (across @ along) * along).astype(float))
    return np.stack([along, across, np.cross(along, across)])


def _tube(local: np.ndarray, thickness: float) -> np.ndarray:
    """Outlines of slices from heel to toe, closed at both ends: (rows, angles + 1, 3)."""
    start, stop = local[:, 0].min() - thickness, local[:, 0].max() + 1.3 * thickness
    places = np.linspace(start + 0.012, stop - 0.012, _N_ROWS)
    angle = np.linspace(0, 2 * np.pi, _N_ANGLES + 1)
    ray = np.stack([np.cos(angle), np.sin(angle)])
    rows, middles = np.empty((_N_ROWS, _N_ANGLES + 1)), np.empty((_N_ROWS, 2))
    for row, place in enumerate(places):
        near = local[np.abs(local[:, 0] - place) < 0.022, 1:]
        middles[row] = (near.min(axis=0) + near.max(axis=0)) / 2
        rows[row] = ((near - middles[row]) @ ray).max(axis=0)
    mixed = convolve1d(np.column_stack([rows, middles]), [0.25, 0.5, 0.25], axis=0, mode="nearest")
    rows, middles = mixed[:, :-2] + thickness, mixed[:, -2:]
    which = np.clip(np.arange(-2, _N_ROWS + 2), 0, _N_ROWS - 1)  # the first and last slice close it, narrower
    along, scale = [start, start + 0.003, *places, stop - 0.003, stop], np.ones(_N_ROWS + 4)
    scale[[0, -1]], scale[[1, -2]] = 0, 0.75
    slices = middles[which, None] + (scale[:, None] * rows[which])[..., None] * ray.T
    return np.dstack([np.repeat(along, _N_ANGLES + 1).reshape(slices.shape[:2]), slices])


def shoe_material(shoes: Shoes) -> Material:
    """Upper, sole, a seam over the toes and laces."""
    upper, sole = column(shoes.upper), column(shoes.sole)

    def look(coords: np.ndarray, footprint_m: np.ndarray) -> Look:
        along, across, height = coords
        noise = textures.sample(textures.cloud, np.stack([along * 0.4, across]), footprint_m)[0]
        is_sole = height < SOLE_M * (0.75 + 0.35 * (along < 0.3))
        albedo = np.where(is_sole, sole, upper * (1 + 0.06 * noise))
        seam = (np.abs(along - 0.76 - 4 * across**2) < 0.006) & ~is_sole
        middle = (np.abs(across) < 0.018) & (along > 0.42) & (along < 0.72) & (height > 0.045)
        lace = middle & (np.mod(along * 26, 1) < 0.45) & shoes.laces
        albedo = albedo * np.where(seam, 0.6, 1) * np.where(middle & ~lace & shoes.laces, 0.7, 1)
        albedo = np.where(lace, sole, albedo)
        bump = np.where(is_sole, 0.0015, 0) + np.where(lace, 0.001, 0) + 0.0004 * noise
        return Look(albedo, bump.astype(np.float32), 0.04, np.where(is_sole, 0.8, shoes.roughness), 0.0)

    return look


def random_shoes(rng: np.random.Generator) -> Shoes:
    """Trainers, leather shoes or boots."""
    dark, white = np.full(3, rng.uniform(0.01, 0.04)), np.full(3, rng.uniform(0.55, 0.8))
    brown = np.array([0.16, 0.07, 0.03]) * rng.uniform(0.4, 1.6)
    kind = rng.choice(3, p=[0.55, 0.3, 0.15])
    if kind == 0:
        colour = rng.choice([dark, white, rng.random(3) * 0.5])
        return Shoes(colour, white if rng.random() < 0.7 else dark, rng.uniform(0.06, 0.09), 0.009, True, 0.7)
    upper = brown if rng.random() < 0.5 else dark
    height_m = 0.065 if kind == 1 else 0.13
    return Shoes(upper, dark, height_m, 0.007, bool(rng.random() < 0.6), rng.uniform(0.25, 0.5))

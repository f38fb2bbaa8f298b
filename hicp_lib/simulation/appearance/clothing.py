"""Clothes: parts of the body's surface, cut along smooth fields, inflated, smoothed and folded.

A garment's cut does not depend on the person's shape or pose, so it is made once and kept. On a posed body,
the cut's vertices are smoothed, as cloth bridges hollows, kept away from the skin by at least its thickness,
and folded.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.ndimage import map_coordinates

from hicp_lib.core.keypoints import INDEX
from hicp_lib.core.memo import memoised
from hicp_lib.simulation.body.model import PosedBody, load_body
from hicp_lib.simulation.rendering import mesh as g


@dataclass(frozen=True)
class Garment:
    """What one garment covers and how it sits.

    Attributes
    ----------
    kind : str
        "top" or "bottom".
    start, end : float
        Where it starts and ends. Top: height of hem and collar in the body's `torso` field.
        Bottom: end in the `leg` field and waist in the `torso` field.
    sleeve : float
        End of the sleeves in the `arm` field.
    opening : float
        How much deeper the collar is in front, in the `torso` field.
    thickness_m : float
        Everywhere.
    ease_m : float
        Further distance from the body at hems. The more, the further cloth hangs off the trunk, and the
        wider legs are.
    smoothing : int
        Steps of smoothing; more bridges wider hollows.
    """

    kind: str
    start: float
    end: float
    sleeve: float = 0.0
    opening: float = 0.0
    thickness_m: float = 0.005
    ease_m: float = 0.012
    smoothing: int = 10


# Chosen by eye, on development identities.
_CHEST = 0.8  # in the `torso` field: from there cloth hangs
_LOOSE_M = 0.014  # ease of a garment that hangs straight down
_MOST_AWAY_M = 0.06  # of hanging cloth from the body
_EVEN_STEPS = 4  # of smoothing, after which seams along hems are even


@dataclass(frozen=True)
class Pattern:
    """A cut-out garment with n vertices, ready to be put on.

    Attributes
    ----------
    cut : g.Cut
    smoothing : array, shape (n, n)
        See `g.smoothing`.
    fields : array, shape (n, 4), dtype float32
        The body's arm, leg and torso field, and how far inside the garment's edge each vertex is, in its
        field's units.
    rim : array of int, shape (n_edges, 2)
        The boundary's directed edges.
    edge : array of int, shape (n_rim,)
        The boundary's vertices, which are repeated after the n, turned inwards: hems, cuffs and collars show
        their thickness.
    triangles : array of int, shape (n_triangles, 3)
        Of n + n_rim vertices.
    source : array of int, shape (n_triangles,)
        Body triangle that each came from.
    hidden : array of bool, shape (n_t,)
        Body triangles well underneath.
    """

    cut: g.Cut
    smoothing: sparse.csr_array
    fields: np.ndarray
    rim: np.ndarray
    edge: np.ndarray
    triangles: np.ndarray
    source: np.ndarray
    hidden: np.ndarray


def cut_pattern(garment: Garment) -> Pattern:
    """Cut a garment out of the body's surface."""
    # The material does not change the cut.
    return _cut_pattern(garment.kind, garment.start, garment.end, garment.sleeve, garment.opening)


@memoised()
def _cut_pattern(kind: str, start: float, end: float, sleeve: float, opening: float) -> Pattern:
    body = load_body()
    arm, leg, torso = (body.field(name).astype(float) for name in ("arm", "leg", "torso"))
    if kind == "top":
        covered = body.in_regions("hips", "torso", "neck", "upper_arm", "forearm", "hand", "thigh")
        field = _top_field(body.vertices_m[0], arm, torso, start, end, sleeve, opening)
    else:
        covered = body.in_regions("hips", "torso", "thigh", "shin", "foot") & (arm == 0)
        field = np.minimum(end - torso, start - leg)
    field = np.where(covered, field, -1)
    cut, deep = g.cut(body.triangles, field), field > 0.03
    n = len(cut.i)
    smoothing = g.smoothing(cut.triangles, n)
    fields = cut.apply(np.column_stack([arm, leg, torso, np.maximum(field, 0)]).astype(np.float32))
    for _ in range(_EVEN_STEPS):
        fields[:, 3] = smoothing @ fields[:, 3]
    rim, owner = g.boundary_edges(cut.triangles), np.empty(n, int)
    owner[cut.triangles.T.ravel()] = np.tile(cut.source, 3)
    edge, (a, b) = np.unique(rim), rim.T
    inner_a, inner_b = np.searchsorted(edge, rim.T) + n
    strip = np.concatenate([np.stack([b, a, inner_a], axis=1), np.stack([b, inner_a, inner_b], axis=1)])
    triangles = np.concatenate([cut.triangles, strip]).astype(np.int32)
    source = np.concatenate([cut.source, np.tile(owner[a], 2)])
    hidden = deep[body.triangles].all(axis=1)
    return Pattern(cut, smoothing, fields, rim, edge, triangles, source, hidden)


def _top_field(rest_m: np.ndarray, arm, torso, start: float, end: float, sleeve: float, opening: float):
    front = np.clip(rest_m[:, 0] / 0.08, 0, 1) * np.clip(1 - np.abs(rest_m[:, 1]) / 0.10, 0, 1)
    trunk = np.minimum(torso - start, end - opening * front.astype(float) - torso)
    on_arm = arm > 0
    trunk = np.where(on_arm, np.maximum(trunk, np.minimum(8 * arm, 0.5)), trunk)
    return np.minimum(trunk, np.where(on_arm, sleeve - arm, 9))


def put_on(
    garment: Garment, posed: PosedBody, rest_m: np.ndarray, folds: np.ndarray, layers_m: np.ndarray
) -> g.Mesh:
    """Put a garment on a posed body.

    Parameters
    ----------
    garment : Garment
    posed : PosedBody
    rest_m : array, shape (n_v, 3)
        The same person at rest; patterns and folds are tied to it.
    folds : array, shape (n_waves, 5)
        Wave vector in rest coordinates (rad/m), phase, height (m).
    layers_m : array, shape (n_v,)
        Distance from the skin of the clothes worn below; updated in place.

    Returns
    -------
    g.Mesh
        Its coords are rest position (3) and the pattern's `fields`.
    """
    pattern = cut_pattern(garment)
    cut, edge = pattern.cut, pattern.edge
    skin, skin_normals = cut.apply(posed.vertices_m), g.unit(cut.apply(posed.normals))
    rest = cut.apply(rest_m.astype(np.float32))
    below = cut.apply(layers_m)
    # Smoothing also slides cloth along the skin: its pattern slides with it.
    smooth = np.concatenate([skin, rest], axis=1)
    for _ in range(garment.smoothing):
        smooth = pattern.smoothing @ smooth
    smooth, laid = smooth[:, :3], smooth[:, 3:]
    if garment.kind == "top":
        smooth = _hang(garment, pattern, smooth, skin + below[:, None] * skin_normals, posed)
    cloth = _drape(garment, pattern, smooth, skin, skin_normals, rest, folds, below)
    height = np.einsum("ij,ij->i", cloth - skin, skin_normals)
    for corners in (cut.i, cut.j):  # a cut edge lies between two of the body's vertices
        np.maximum.at(layers_m, corners, height)
    inner = cloth - (height + 0.004)[:, None] * skin_normals  # into the skin, without a gap
    vertices = np.concatenate([cloth, inner[edge]]).astype(np.float32)
    coords = np.column_stack([laid, pattern.fields]).astype(np.float32)
    normals = g.vertex_normals(vertices, pattern.triangles)
    return g.Mesh(vertices, pattern.triangles, normals, np.concatenate([coords, coords[edge]]))


def _drape(garment: Garment, pattern: Pattern, cloth, skin, skin_normals, rest, folds, below) -> np.ndarray:
    _, leg, torso, distance = pattern.fields.T.astype(float)
    ends = distance if garment.kind == "top" else garment.start - leg
    away = garment.thickness_m + garment.ease_m * np.exp(-ends / 0.25)
    if garment.kind == "bottom":  # a waistband is tight, legs are wider below
        away = np.where(torso > 0, garment.thickness_m, away + garment.ease_m * leg)
    away = np.maximum(away, below + 0.004 * (below > 0))
    cloth = _keep_away(cloth, skin, skin_normals, away)
    heights = sum(h * np.sin(rest @ np.array([x, y, z], np.float32) + p) for x, y, z, p, h in folds)
    cloth = cloth + (heights * np.minimum(away / 0.01, 1.5))[:, None] * skin_normals
    away = np.maximum(0.6 * away, below + 0.003 * (below > 0))
    return _keep_away(pattern.smoothing @ cloth.astype(np.float32), skin, skin_normals, away)


def _hang(garment: Garment, pattern: Pattern, cloth: np.ndarray, solid: np.ndarray, posed) -> np.ndarray:
    """The trunk's cloth falls from chest and shoulder blades, the further from the body the looser it is."""
    arm, _, torso, _ = pattern.fields.T
    rows = np.flatnonzero((arm == 0) & (torso < _CHEST))
    R = posed.rotations[load_body().bone_numbers["spine03"]].astype(np.float32)
    local, within = ((points[rows] - posed.keypoints_m[INDEX["mid_hip"]]) @ R for points in (cloth, solid))
    x, y, z = local.T
    heights = np.linspace(within[:, 2].max(), within[:, 2].min(), 16)
    angle = np.linspace(0, 2 * np.pi, 33)
    outline = np.maximum.accumulate(_outline(within, heights, angle), axis=0)
    row = (z - heights[0]) / (heights[1] - heights[0])
    column = np.mod(np.arctan2(y, x), 2 * np.pi) / angle[1]
    gap = map_coordinates(outline, [row, column], order=1, mode="nearest") - np.hypot(x, y)
    share = np.clip(garment.ease_m / _LOOSE_M, 0.5, 1) * np.clip((_CHEST - torso[rows]) / 0.15, 0, 1)
    away = share * np.clip(gap, 0, _MOST_AWAY_M) / np.hypot(x, y)
    hanging = cloth.copy()
    hanging[rows] += np.column_stack([away * x, away * y, 0 * z]).astype(np.float32) @ R.T
    return hanging


def _outline(points: np.ndarray, heights: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Radii (n_heights, n_angles) of the convex outline of points at heights, about their z axis."""
    ray, radius = np.stack([np.cos(angle), np.sin(angle)]), np.zeros((len(heights), len(angle)))
    for row, height in enumerate(heights):
        near = points[np.abs(points[:, 2] - height) < 0.05, :2]
        radius[row] = (near @ ray).max(axis=0) if len(near) > 8 else radius[row - 1]
    return radius


def _keep_away(cloth: np.ndarray, skin: np.ndarray, normals: np.ndarray, away: np.ndarray) -> np.ndarray:
    distance = np.einsum("ij,ij->i", cloth - skin, normals)
    return (cloth + np.maximum(away - distance, 0)[:, None] * normals).astype(np.float32)


def collar(garment: Garment, mesh: g.Mesh, posed: PosedBody, rise_m: float, open_m: float) -> g.Mesh:
    """A shirt collar on the edge around the neck: up, then folded out and down; open in front.

    Parameters
    ----------
    garment : Garment
    mesh : g.Mesh
        The garment as `put_on` returns it.
    posed : PosedBody
        The person wearing it.
    rise_m : float
        How high it stands.
    open_m : float
        Half the width of its opening.

    Returns
    -------
    g.Mesh
        With the garment's coords.
    """
    pattern = cut_pattern(garment)
    n = len(pattern.cut.i)
    x, y, _, arm, _, torso, _ = mesh.coords[pattern.rim].transpose(2, 0, 1)
    gap = (x > 0).all(axis=1) & (np.abs(y) < open_m).any(axis=1)
    edges = pattern.rim[((torso > 0.8) & (arm < 0.2)).all(axis=1) & ~gap]
    used, place = np.unique(edges, return_inverse=True)
    ring = mesh.vertices_m[:n][used]
    up = g.unit(posed.keypoints_m[INDEX["head_top"]] - posed.keypoints_m[INDEX["neck"]])
    out = ring - ring.mean(axis=0)
    out = g.unit(out - np.outer(out @ up, up))
    rows = [
        ring,
        ring + rise_m * up - 0.003 * out,
        ring + (rise_m + 0.004) * up + 0.004 * out,
        ring + 0.016 * out + 0.25 * rise_m * up,
        ring + 0.024 * out - 0.45 * rise_m * up,
    ]
    vertices = np.concatenate(rows).astype(np.float32)
    k = len(used)
    a, b = place.reshape(edges.shape).T
    strip = np.array([[b, a, a + k], [b, a + k, b + k]]).swapaxes(1, 2)
    lows = k * np.arange(len(rows) - 1)[:, None, None, None]
    triangles = (lows + strip).reshape(-1, 3).astype(np.int32)
    coords = np.tile(mesh.coords[:n][used], (len(rows), 1))
    coords[:, 6] = 1  # without a hem
    coords[:, 2] += np.repeat([0, rise_m, rise_m + 0.01, rise_m + 0.02, 2 * rise_m + 0.02], k)
    return g.Mesh(vertices, triangles, g.vertex_normals(vertices, triangles), coords)


def skirt(posed: PosedBody, layers_m: np.ndarray, length_m: float, flare: float, phase: float) -> g.Mesh:
    """A skirt around hips and legs: their outline at each height below the waist, folded towards the hem.

    Parameters
    ----------
    posed : PosedBody
    layers_m : array, shape (n_v,)
        Distance from the skin of the clothes tucked into it.
    length_m : float
    flare : float
        How much wider than the legs the hem is, as a share.
    phase : float
        Of the folds, radians.

    Returns
    -------
    g.Mesh
        Its coords are those of `put_on`.
    """
    body = load_body()
    legs = (body.field("leg") > 0) | body.in_regions("hips")
    legs |= body.in_regions("torso") & (body.field("torso") < 0.32) & (body.field("arm") == 0)
    hips, R = posed.keypoints_m[INDEX["mid_hip"]], posed.rotations[body.bone_numbers["root"]]
    worn = posed.vertices_m[legs] + posed.normals[legs] * layers_m[legs, None]
    points = (worn - hips) @ R  # x forward, y left, z up, in every pose
    angle, heights = np.linspace(0, 2 * np.pi, 73), np.linspace(0.14, -length_m, 16)
    radius, below = _outline(points, heights, angle), np.linspace(0, 1, len(heights))[:, None]
    radius = np.maximum.accumulate(radius * 0.97, axis=0) * (1 + flare * below**1.3) + 0.008
    folds = below * 0.016 * np.sin(9 * angle + phase + 2 * below)
    radius += folds + below * 0.008 * np.sin(17 * angle + 3 * phase)
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    coords = np.zeros((*radius.shape, 7), np.float32)
    coords[..., :2], coords[..., 2], coords[..., 6] = 0.2 * around, heights[:, None], 1 - below
    local = np.dstack([radius[..., None] * around, np.broadcast_to(heights[:, None], radius.shape)])
    return g.closed_grid((local @ R.T + hips).astype(np.float32), coords, axis=1)


def random_folds(rng: np.random.Generator, height_m: float, n_waves: int = 8) -> np.ndarray:
    """Waves for `put_on`: mostly vertical folds, some oblique.

    Parameters
    ----------
    rng : numpy.random.Generator
    height_m : float
        Of the folds, together.
    n_waves : int, optional

    Returns
    -------
    array, shape (n_waves, 5), dtype float32
        Wave vector (rad/m), phase, height (m).

    Examples
    --------
    >>> waves = random_folds(np.random.default_rng(0), 0.005)
    >>> waves.shape, bool(waves[:, 4].max() < 0.005)
    ((8, 5), True)
    """
    direction = rng.normal(size=(n_waves, 3)) * [1, 1, 0.55]
    number = 2 * np.pi / rng.uniform(0.05, 0.16, n_waves)
    waves = g.unit(direction) * number[:, None]
    heights = height_m * rng.uniform(0.3, 1, n_waves) / np.sqrt(n_waves)
    return np.column_stack([waves, rng.uniform(0, 2 * np.pi, n_waves), heights]).astype(np.float32)

"""Hair: locks grown from the scalp, combed, pulled down by gravity, kept off head and shoulders.

Locks are flat ribbons whose normals are bent at the edges, so that each catches light as a
rounded bundle of strands. They grow on the body at rest and are then carried along by the
head and, further down, by the back.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from hicp_lib.simulation.appearance.hair_styles import Style
from hicp_lib.simulation.body.model import Body, PosedBody
from hicp_lib.simulation.rendering import mesh as g
from hicp_lib.simulation.rendering import textures
from hicp_lib.simulation.rendering.surfaces import Look, Material, column

Rng = np.random.Generator


@dataclass(frozen=True)
class _Below:
    """The n vertices of head and trunk that hair lies on, at rest, body frame.

    `cloth_m` is the thickness of clothes there, `is_scalp` tells where short hair clings.
    """

    vertices_m: np.ndarray
    normals: np.ndarray
    cloth_m: np.ndarray
    is_scalp: np.ndarray
    tree: KDTree


_CLOTH_M = 0.018


def _below_hair(body: Body, rest_m: np.ndarray, normals: np.ndarray) -> _Below:
    trunk = body.in_regions("hips", "torso")
    kept = body.in_regions("face", "scalp", "neck", "eyebrow") & (body.field("ear") < 0.3) | trunk
    vertices, is_scalp = rest_m[kept], body.field("hairline_m")[kept] > -0.01
    # Hair slides off shoulders to the front or the back, not to the side.
    sideless = normals * [1, 0.2, 0.5] + np.where(normals[:, :1] < 0, -0.7, 0.7) * [1, 0, 0]
    normals = np.where(trunk[:, None], g.unit(sideless), normals)
    return _Below(vertices, normals[kept], _CLOTH_M * trunk[kept], is_scalp, KDTree(vertices))


def _lay(below: _Below, points: np.ndarray, layer_m: np.ndarray, lift: float) -> np.ndarray:
    """Push points out of head and trunk; those above the scalp sink towards it, the less the hair's lift."""
    _, nearest = below.tree.query(points)
    normals, least_m = below.normals[nearest], layer_m + below.cloth_m[nearest]
    height_m = np.einsum("ij,ij->i", points - below.vertices_m[nearest], normals)
    sinking = np.where(below.is_scalp[nearest], min(2 * lift + 0.2, 1.0), 1.0)
    excess = height_m - least_m
    return points + (np.where(excess > 0, sinking * excess, 0) - excess)[:, None] * normals


def grow(style: Style, body: Body, rest_m: np.ndarray, landmarks_m: np.ndarray, rng: Rng) -> g.Mesh:
    """Hair on the body at rest.

    Parameters
    ----------
    style : Style
    body : Body
    rest_m : array, shape (n_v, 3)
        The person at rest, body frame.
    landmarks_m : array, shape (136, 3)
        The person's keypoints at rest.
    rng : numpy.random.Generator

    Returns
    -------
    g.Mesh
        Its coords: across a lock (-1 to 1), metres along it, a random number per lock, root 0 to tip 1.
    """
    skin_normals = g.vertex_normals(rest_m.astype(np.float32), body.triangles)
    ears, top = landmarks_m[3:5].mean(axis=0), landmarks_m[17]
    centre = np.array([ears[0] + 0.005, 0.0, 0.5 * (ears[2] + top[2]) - 0.015])  # of the head
    below = _below_hair(body, rest_m, skin_normals)
    points, reach = _strands(style, centre, below, *_roots(style, body, rest_m, skin_normals, rng), rng)
    if style.tie:
        tied, tied_reach = _tail(style, centre, rng)
        points, reach = np.concatenate([points, tied]), np.concatenate([reach, tied_reach])
    return _ribbons(style, centre, points, reach, rng)


def _roots(style: Style, body: Body, rest_m: np.ndarray, skin_normals: np.ndarray, rng: Rng):
    field = body.field("hairline_m")
    triangles = body.triangles[(field[body.triangles] > -0.004).all(axis=1)]
    corners = rest_m[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    rows = rng.choice(len(triangles), style.n_locks, p=area / area.sum())
    a, b = np.sqrt(rng.random(len(rows))), rng.random(len(rows))
    weights = np.stack([1 - a, a * (1 - b), a * b], axis=1)
    roots = np.einsum("nk,nkj->nj", weights, corners[rows])
    normals = skin_normals[triangles[rows]]
    inside = np.einsum("nk,nk->n", weights, field[triangles[rows]])
    return roots, g.unit(np.einsum("nk,nkj->nj", weights, normals)), inside


def _strands(style: Style, centre: np.ndarray, below: _Below, roots, normals, inside, rng) -> tuple[np.ndarray, np.ndarray]:
    """Points along the locks, (n, n_steps + 1, 3), and each lock's length."""
    n = len(roots)
    relative = roots - centre
    crown = np.clip((relative[:, 2] + 0.02) / 0.09, 0, 1)
    length = style.side_m + (style.top_m - style.side_m) * crown
    length = length * rng.uniform(0.85, 1.05, n) * np.clip(0.35 + inside / 0.012, 0.35, 1)
    layer = style.volume_m * rng.random(n) * np.clip(inside / 0.02, 0.1, 1) + 0.001
    if style.tie:
        length = 1.25 * np.linalg.norm(_tie_point(style, centre) - roots, axis=1)
    comb = _combing(style, centre, roots, normals)
    wave = _smooth_random(rng, roots)
    direction = g.unit(style.lift * normals + (1 - style.lift) * comb + 0.04 * rng.normal(0, 1, (n, 3)))
    step = (length / style.n_steps)[:, None]
    points = [roots - 0.001 * normals]
    for k in range(style.n_steps):
        shared = 1.5 * np.roll(wave, k, axis=1) * (-1) ** (k // 2)
        wander = style.curl * (shared + 0.6 * rng.normal(0, 1, (n, 3)))
        direction = g.unit(direction + 0.6 * comb + np.array([0, 0, -style.gravity]) + wander)
        here = points[-1]
        if style.tie:
            left = _tie_point(style, centre) - here
            comb, step = g.unit(left), np.minimum(step, np.linalg.norm(left, axis=1)[:, None])
        else:
            comb = comb * 0.7
        points.append(_lay(below, here + step * direction, layer, style.lift))
        direction = g.unit(points[-1] - here)
    return _coil(style, np.stack(points, axis=1), rng), length


def _coil(style: Style, points: np.ndarray, rng: Rng) -> np.ndarray:
    """Wind locks around themselves, the more the curlier."""
    if style.coil_m == 0:
        return points
    n, k, _ = points.shape
    start, step_rad = rng.uniform(0, 2 * np.pi, (n, 1)), rng.uniform(1.3, 2.0, (n, 1))
    turn = start + np.arange(k) * step_rad * rng.choice([-1, 1], (n, 1))
    axes = rng.normal(0, 1, (2, n, 1, 3))
    axes = axes / np.linalg.norm(axes, axis=-1, keepdims=True)
    grow = np.minimum(np.arange(k) / 2, 1)[:, None] * style.coil_m
    return points + grow * (np.cos(turn)[..., None] * axes[0] + np.sin(turn)[..., None] * axes[1])


def _smooth_random(rng: Rng, roots: np.ndarray) -> np.ndarray:
    """Random vectors (n, 3) that neighbouring locks share."""
    waves = rng.normal(0, 60, (3, 3, 3))
    phase = rng.uniform(0, 2 * np.pi, (3, 3))
    return np.sin(np.einsum("nj,kwj->nkw", roots, waves) + phase).mean(axis=2)


def _tie_point(style: Style, centre: np.ndarray) -> np.ndarray:
    height = 0.03 if style.tie == "tail" else 0.0
    return centre + np.array([-0.105, 0, height])


def _combing(style: Style, centre: np.ndarray, roots, normals) -> np.ndarray:
    if style.tie:
        comb = _tie_point(style, centre) - roots
    else:
        comb = np.tile(np.array(style.comb, float), (len(roots), 1))
        side = np.where(roots[:, 1] > 0.02 * style.parting, 1.0, -1.0)
        comb[:, 1] += 0.45 * side * (style.parting != 0)
        front = np.clip((roots[:, 0] - centre[0]) / 0.08, 0, 1)
        comb[:, 0] -= 0.5 * front * (style.top_m > 0.1)  # long hair leaves the face free
    comb = comb - np.einsum("ij,ij->i", comb, normals)[:, None] * normals
    return g.unit(comb)


def _tail(style: Style, centre: np.ndarray, rng: Rng) -> tuple[np.ndarray, np.ndarray]:
    """Locks of a ponytail or a bun, from the point where the hair is tied."""
    n = 260
    origin = _tie_point(style, centre)
    steps = np.arange(style.n_steps + 1) / style.n_steps
    if style.tie == "tail":
        length = rng.uniform(0.2, 0.32) * rng.uniform(0.7, 1.05, n)
        spread = rng.normal(0, 1, (n, 2)) * 0.012
        t = steps[None] * length[:, None]
        back = 0.05 * np.sin(np.minimum(steps * 4, np.pi / 2)) + 0.02
        swell = 0.4 + 1.3 * np.sin(np.pi * np.minimum(steps * 1.1, 1))
        x = -back[None] - spread[:, :1] * swell
        y = spread[:, 1:] * swell + rng.normal(0, 0.002, (n, len(steps)))
        z = 0.03 * np.sin(np.minimum(steps * 5, np.pi)) - t
        return origin + np.stack([np.broadcast_to(x, t.shape), y, z], axis=-1), length
    radius = 0.034
    axis = g.unit(rng.normal(0, 1, (n, 3)) * [1, 0.5, 0.5])
    start = g.unit(np.cross(axis, rng.normal(0, 1, (n, 3))))
    other = np.cross(axis, start)
    angle = steps[None, :, None] * 2.6
    ring = np.cos(angle) * start[:, None] + np.sin(angle) * other[:, None]
    scale = radius * rng.uniform(0.75, 1.05, (n, 1, 1)) * np.array([0.8, 1, 1])
    return origin + np.array([-0.018, 0, 0]) + ring * scale, np.full(n, 0.08)


def _ribbons(style: Style, centre: np.ndarray, points: np.ndarray, length: np.ndarray, rng) -> g.Mesh:
    n, k, _ = points.shape
    along = np.gradient(points, axis=1)
    outward = g.unit(points - centre)
    low = points[..., 2] < centre[2] - 0.12
    outward[low, 2] = 0
    outward = g.unit(outward)
    side = g.unit(np.cross(along, outward))
    outward = g.unit(np.cross(side, along))
    twist = rng.normal(0, 0.12, (n, 1, 1))
    side, outward = side + twist * outward, outward - twist * side
    t = np.linspace(0, 1, k)
    width = style.width_m * rng.uniform(0.5, 1.2, (n, 1)) * (1 - 0.75 * t**2)
    half = 0.5 * width[..., None] * side
    vertices = np.stack([points - half, points + half], axis=2)
    normals = g.unit(np.stack([outward - 0.35 * side, outward + 0.35 * side], axis=2))
    coords = np.empty((n, k, 2, 4), np.float32)
    coords[..., 0] = [-1, 1]
    coords[..., 1] = (t * length[:, None])[..., None]
    coords[..., 2] = rng.random(n)[:, None, None]
    coords[..., 3] = t[:, None]
    strip = g.grid_triangles(k, 2)[:, ::-1]  # which face outwards, as the normals do
    triangles = (np.arange(n)[:, None, None] * (2 * k) + strip).reshape(-1, 3).astype(np.int32)
    flat = [x.reshape(-1, x.shape[-1]).astype(np.float32) for x in (vertices, normals, coords)]
    return g.Mesh(flat[0], triangles, flat[1], flat[2])


def carry(
    hair: g.Mesh, body: Body, posed: PosedBody, rest_heads_m: np.ndarray, landmarks_m: np.ndarray
) -> g.Mesh:
    """Hair at rest moved to the pose: by the head, and below the chin increasingly by the back.

    Parameters
    ----------
    hair : g.Mesh
        As `grow` returns it.
    body : Body
    posed : PosedBody
    rest_heads_m : array, shape (n_bones, 3)
        Where the bones begin at rest.
    landmarks_m : array, shape (136, 3)
        The person's keypoints at rest.

    Returns
    -------
    g.Mesh
        In the world frame.
    """
    chin = landmarks_m[34, 2]
    share = np.clip((chin - hair.vertices_m[:, 2:]) / 0.14, 0, 1).astype(np.float32)
    places, normals = [], []
    for bone in (body.bone_numbers["head"], body.bone_numbers["spine01"]):
        R = posed.rotations[bone].astype(np.float32)
        offset = (posed.heads_m[bone] - posed.rotations[bone] @ rest_heads_m[bone]).astype(np.float32)
        places.append(hair.vertices_m @ R.T + offset)
        normals.append(hair.normals @ R.T)
    vertices, turned = (a + share * (b - a) for a, b in (places, normals))
    return g.Mesh(vertices, hair.triangles, g.unit(turned), hair.coords)


def hair_material(colour: np.ndarray) -> Material:
    """Hair: locks of slightly different colour, single strands, darker at the roots."""
    colour = column(colour)

    def look(coords: np.ndarray, footprint_m: np.ndarray) -> Look:
        across, along, lock, t = coords
        uv = np.stack([across * 0.007 + lock * 7.3, along + lock * 3.1])
        strand = textures.sample(textures.strands, uv, footprint_m * 0.5)[0]
        shade = (0.8 + 0.35 * lock) * (1 + 0.35 * strand) * (0.7 + 0.35 * np.minimum(3 * t, 1))
        albedo = colour * np.clip(shade, 0.15, 2) + 0.004
        return Look(np.minimum(albedo, 0.9), gloss=0.022 + 0.015 * strand, roughness=0.42, softness=0.5)

    return look

"""Hair: locks grown from the scalp, combed, pulled down by gravity, kept off head and shoulders.

Locks are flat ribbons whose normals are bent at the edges, so that each catches light as a
rounded bundle of strands. They grow on the body at rest and are then carried along by the
head and, further down, by the back.
"""

from collections.abc import Callable

import numpy as np
from scipy.spatial import KDTree

from hicp_lib.simulation.appearance.hair_styles import Style
from hicp_lib.simulation.body.identities import PEOPLE, Rng
from hicp_lib.simulation.body.model import Body, PosedBody
from hicp_lib.simulation.rendering import mesh as g
from hicp_lib.simulation.rendering import textures
from hicp_lib.simulation.rendering.surfaces import Look, Material, column

_CLOTH_M = 0.018  # of clothes below hair
Lay = Callable[[np.ndarray, np.ndarray, float], np.ndarray]


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
    lay = _laying(body, rest_m, skin_normals)
    points, reach = _strands(style, centre, lay, rng, *_roots(style, body, rest_m, skin_normals, rng))
    if style.tie:  # beyond the knot, hair grows from there
        loose = Style(**PEOPLE["tied_hair"][style.tie], n_steps=style.n_steps)
        roots = _tie_point(style, centre) + rng.normal(0, 0.008, (loose.n_locks, 3))
        backward, inside = np.tile([-1.0, 0, 0], (loose.n_locks, 1)), np.ones(loose.n_locks)
        tied, tied_reach = _strands(loose, centre, lay, rng, roots, backward, inside)
        points, reach = np.concatenate([points, tied]), np.concatenate([reach, tied_reach])
    return _ribbons(style, centre, points, reach, rng)


def _laying(body: Body, rest_m: np.ndarray, normals: np.ndarray) -> Lay:
    """What pushes points (n, 3) out of head and trunk, to a layer (n,) above them.

    Points above the scalp sink towards it, the less lift the hair has.
    """
    trunk = body.in_regions("hips", "torso")
    kept = body.in_regions("face", "scalp", "neck", "eyebrow") & (body.field("ear") < 0.3) | trunk
    surface, cloth_m, on_scalp = rest_m[kept], _CLOTH_M * trunk[kept], body.field("hairline_m")[kept] > -0.01
    # Hair slides off shoulders to the front or the back, not to the side.
    sideless = normals * [1, 0.2, 0.5] + np.where(normals[:, :1] < 0, -0.7, 0.7) * [1, 0, 0]
    away = np.where(trunk[:, None], g.unit(sideless), normals)[kept]
    tree = KDTree(surface)

    def lay(points: np.ndarray, layer_m: np.ndarray, lift: float) -> np.ndarray:
        _, nearest = tree.query(points)
        height_m = np.einsum("ij,ij->i", points - surface[nearest], away[nearest])
        excess_m = height_m - layer_m - cloth_m[nearest]
        sunk = np.where(on_scalp[nearest], min(2 * lift + 0.2, 1.0), 1.0) * np.maximum(excess_m, 0)
        return points + (sunk - excess_m)[:, None] * away[nearest]

    return lay


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


def _strands(style: Style, centre: np.ndarray, lay: Lay, rng: Rng, roots, normals, inside):
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
        points.append(lay(here + step * direction, layer, style.lift))
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


def _ribbons(style: Style, centre: np.ndarray, points: np.ndarray, length: np.ndarray, rng) -> g.Mesh:
    n, k, _ = points.shape
    along = np.gradient(points, axis=1)
    outward = points - centre
    outward[..., 2] *= outward[..., 2] > -0.12  # below the head: from a vertical
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

"""Hair: locks grown from the scalp, combed, pulled down by gravity, kept off head and shoulders.

Locks are flat ribbons whose normals are bent at the edges, so that each catches light as a
rounded bundle of strands. They grow on the body at rest and are then carried along by the
head and, further down, by the back.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from hicp_lib.simulation.appearance.hair_styles import Style
from hicp_lib.simulation.body.model import Body, PosedBody
from hicp_lib.simulation.rendering import mesh as g
from hicp_lib.simulation.rendering import textures
from hicp_lib.simulation.rendering.surfaces import Look, Material, column

Rng = np.random.Generator


@dataclass(frozen=True)
class Obstacles:
    """Surfaces that hair lies on, at rest, body frame.

    Attributes
    ----------
    centre_m : array, shape (3,)
        Middle of the head.
    radius_m : array, shape (36, 72)
        Of head and neck by direction from there: rows of elevation, columns of azimuth.
    corner_m : array, shape (2,)
        Where the trunk's grid over y and z begins; its cells are `_CELL_M` wide.
    back_m, front_m : array, shape (rows, columns)
        The trunk's extent along x in each cell.
    """

    centre_m: np.ndarray
    radius_m: np.ndarray
    corner_m: np.ndarray
    back_m: np.ndarray
    front_m: np.ndarray


_GRID = (36, 72)
_CELL_M = 0.02
_CLOTH_M = 0.018
_FAR_M = 9.0  # for a column without trunk


def obstacles(body: Body, rest_m: np.ndarray, landmarks_m: np.ndarray) -> Obstacles:
    """Head, neck and trunk of a body at rest.

    Parameters
    ----------
    body : Body
    rest_m : array, shape (n_v, 3)
        The person at rest, body frame.
    landmarks_m : array, shape (136, 3)
        The person's keypoints at rest.

    Returns
    -------
    Obstacles
    """
    ears, top = landmarks_m[3:5].mean(axis=0), landmarks_m[17]
    centre = np.array([ears[0] + 0.005, 0.0, 0.5 * (ears[2] + top[2]) - 0.015])
    trunk = body.in_regions("hips", "torso") & (rest_m[:, 2] > centre[2] - 0.75)
    head = rest_m[body.in_regions("face", "scalp", "neck", "eyebrow")]
    return Obstacles(centre, _radii(head - centre), *_columns(rest_m[trunk]))


def _radii(offset: np.ndarray) -> np.ndarray:
    row, column = (x.astype(int) for x in _place(offset))
    radius = np.zeros(_GRID)
    cells = np.clip(row, 0, _GRID[0] - 1), column % _GRID[1]
    np.maximum.at(radius, cells, np.linalg.norm(offset, axis=1))
    while not radius.all():  # directions without a vertex take their neighbours' values
        padded = np.pad(radius, ((1, 1), (0, 0)), mode="edge")
        around = [np.roll(radius, s, axis=1) for s in (-1, 1)] + [padded[2:], padded[:-2]]
        radius = np.where(radius == 0, np.max(around, axis=0), radius)
    padded = np.pad(np.pad(radius, ((2, 2), (0, 0)), mode="edge"), ((0, 0), (6, 6)), mode="wrap")
    return np.maximum(cv2.GaussianBlur(padded, (0, 0), 0.8)[2:-2, 6:-6], radius * 0.98)


def _columns(trunk_m: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    corner = trunk_m[:, 1:].min(axis=0)
    cells = ((trunk_m[:, 1:] - corner) / _CELL_M).astype(int)
    shape = tuple(cells.max(axis=0) + 1)
    back, front = np.full(shape, _FAR_M), np.full(shape, -_FAR_M)
    np.minimum.at(back, tuple(cells.T), trunk_m[:, 0])
    np.maximum.at(front, tuple(cells.T), trunk_m[:, 0])
    kernel = np.ones((3, 3))
    return corner, cv2.erode(back, kernel), cv2.dilate(front, kernel)


def _place(offset: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Row and column in the grid of directions, fractional."""
    rise = np.arctan2(offset[..., 2], np.hypot(offset[..., 0], offset[..., 1]))
    azimuth = np.arctan2(offset[..., 1], offset[..., 0])
    return (rise / np.pi + 0.5) * _GRID[0], (azimuth / (2 * np.pi) + 0.5) * _GRID[1]


def _radius(head: Obstacles, offset: np.ndarray) -> np.ndarray:
    """Bilinear between the middles of cells."""
    row, column = _place(offset)
    row, column = np.clip(row - 0.5, 0, _GRID[0] - 1.001), np.mod(column - 0.5, _GRID[1])
    r, c = row.astype(int), column.astype(int)
    fr, fc, right = row - r, column - c, (c + 1) % _GRID[1]
    c = c % _GRID[1]
    radius = head.radius_m
    low = radius[r, c] * (1 - fc) + radius[r, right] * fc
    high = radius[r + 1, c] * (1 - fc) + radius[r + 1, right] * fc
    return low * (1 - fr) + high * fr


def _keep_off(head: Obstacles, points: np.ndarray, layer: np.ndarray) -> np.ndarray:
    """Push points out of the head, away from its centre, and out of the trunk, to its front or back."""
    offset = points - head.centre_m
    distance = np.linalg.norm(offset, axis=1)
    wanted = _radius(head, offset) + layer
    scale = np.where(distance < wanted, wanted / np.maximum(distance, 1e-3), 1)
    points = head.centre_m + offset * scale[:, None]
    cell = ((points[:, 1:] - head.corner_m) / _CELL_M).astype(int)
    shape = head.back_m.shape
    within = ((cell >= 0) & (cell < shape)).all(axis=1)
    cell = np.clip(cell, 0, np.array(shape) - 1)
    row, column = cell.T
    back = head.back_m[row, column] - _CLOTH_M - layer
    front = head.front_m[row, column] + _CLOTH_M + layer
    x = points[:, 0]
    inside = within & (x > back) & (x < front)
    points[:, 0] = np.where(inside, np.where(x < 0.45 * back + 0.55 * front, back, front), x)
    return points


def grow(style: Style, body: Body, rest_m: np.ndarray, head: Obstacles, rng: Rng) -> g.Mesh:
    """Hair on the body at rest.

    Parameters
    ----------
    style : Style
    body : Body
    rest_m : array, shape (n_v, 3)
        The person at rest, body frame.
    head : Obstacles
        The person's.
    rng : numpy.random.Generator

    Returns
    -------
    g.Mesh
        Its coords: across a lock (-1 to 1), metres along it, a random number per lock, root 0 to tip 1.
    """
    roots, normals, inside = _roots(style, body, rest_m, rng)
    points, reach = _strands(style, head, roots, normals, inside, rng)
    if style.tie:
        tied, tied_reach = _tail(style, head, rng)
        points, reach = np.concatenate([points, tied]), np.concatenate([reach, tied_reach])
    return _ribbons(style, head, points, reach, rng)


def _roots(style: Style, body: Body, rest_m: np.ndarray, rng: Rng):
    field = body.field("hairline_m")
    triangles = body.triangles[(field[body.triangles] > -0.004).all(axis=1)]
    corners = rest_m[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    rows = rng.choice(len(triangles), style.n_locks, p=area / area.sum())
    a, b = np.sqrt(rng.random(len(rows))), rng.random(len(rows))
    weights = np.stack([1 - a, a * (1 - b), a * b], axis=1)
    roots = np.einsum("nk,nkj->nj", weights, corners[rows])
    normals = g.vertex_normals(rest_m.astype(np.float32), triangles)[triangles[rows]]
    inside = np.einsum("nk,nk->n", weights, field[triangles[rows]])
    return roots, g.unit(np.einsum("nk,nkj->nj", weights, normals)), inside


def _strands(style: Style, head: Obstacles, roots, normals, inside, rng) -> tuple[np.ndarray, np.ndarray]:
    """Points along the locks, (n, n_steps + 1, 3), and each lock's length."""
    n = len(roots)
    relative = roots - head.centre_m
    crown = np.clip((relative[:, 2] + 0.02) / 0.09, 0, 1)
    length = style.side_m + (style.top_m - style.side_m) * crown
    length = length * rng.uniform(0.85, 1.05, n) * np.clip(0.35 + inside / 0.012, 0.35, 1)
    layer = style.volume_m * rng.random(n) * np.clip(inside / 0.02, 0.1, 1) + 0.001
    if style.tie:
        length = 1.25 * np.linalg.norm(_tie_point(style, head) - roots, axis=1)
    comb = _combing(style, head, roots, normals)
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
            left = _tie_point(style, head) - here
            comb, step = g.unit(left), np.minimum(step, np.linalg.norm(left, axis=1)[:, None])
        else:
            comb = comb * 0.7
        points.append(_keep_off(head, here + step * direction, layer))
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


def _tie_point(style: Style, head: Obstacles) -> np.ndarray:
    height = 0.03 if style.tie == "tail" else 0.0
    return head.centre_m + np.array([-0.105, 0, height])


def _combing(style: Style, head: Obstacles, roots, normals) -> np.ndarray:
    if style.tie:
        comb = _tie_point(style, head) - roots
    else:
        comb = np.tile(np.array(style.comb, float), (len(roots), 1))
        side = np.where(roots[:, 1] > 0.02 * style.parting, 1.0, -1.0)
        comb[:, 1] += 0.45 * side * (style.parting != 0)
        front = np.clip((roots[:, 0] - head.centre_m[0]) / 0.08, 0, 1)
        comb[:, 0] -= 0.5 * front * (style.top_m > 0.1)  # long hair leaves the face free
    comb = comb - np.einsum("ij,ij->i", comb, normals)[:, None] * normals
    return g.unit(comb)


def _tail(style: Style, head: Obstacles, rng: Rng) -> tuple[np.ndarray, np.ndarray]:
    """Locks of a ponytail or a bun, from the point where the hair is tied."""
    n = 260
    origin = _tie_point(style, head)
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


def _ribbons(style: Style, head: Obstacles, points: np.ndarray, length: np.ndarray, rng) -> g.Mesh:
    n, k, _ = points.shape
    along = np.gradient(points, axis=1)
    outward = g.unit(points - head.centre_m)
    low = points[..., 2] < head.centre_m[2] - 0.12
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
    strip = g.grid_triangles(k, 2)
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

"""Hair: locks grown from the scalp, combed, pulled down by gravity, kept off head and shoulders.

Locks are flat ribbons whose normals are bent at the edges, so that each catches light as a
rounded bundle of strands. They grow on the body at rest and are then carried along by the
head and, further down, by the back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hicp_lib.simulation import mesh as g
from hicp_lib.simulation import textures
from hicp_lib.simulation.body import Body, PosedBody
from hicp_lib.simulation.surfaces import Hits, Look, Material


@dataclass(frozen=True)
class Style:
    """How hair grows and lies.

    Attributes
    ----------
    top_m, side_m : length on the crown and above the ears
    lift : how steeply it leaves the scalp, 0 flat to 1 upright
    comb : direction it is combed to, in the head's frame (x forward, y left, z up), and how firmly
    gravity : pull downwards per step
    curl : random wandering, 0 straight
    volume_m : thickness of the layer of hair
    parting : sign of the side it is parted on, 0 none
    tie : "", "tail" or "bun": gathered at the back of the head
    n_locks, n_steps : how many locks of how many pieces
    width_m : width of a lock
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


def random_style(rng: np.random.Generator, woman: bool, age: float) -> Style | None:
    """A hair style; None for a shaven or bald head."""
    parting = float(rng.choice([-1, 1]))
    if woman:
        kind = rng.choice(["long", "bob", "tail", "bun", "short", "curly"], p=[0.30, 0.2, 0.18, 0.12, 0.1, 0.1])
    else:
        odds = [0.42, 0.2, 0.16, 0.08, 0.14] if age < 50 else [0.4, 0.05, 0.25, 0.05, 0.25]
        kind = rng.choice(["side", "quiff", "crop", "curly", "bald"], p=odds)
    wave = rng.uniform(0.04, 0.22)
    if kind == "bald":
        return None
    if kind == "long":
        length = rng.uniform(0.30, 0.48)
        return Style(length, length * 0.9, 0.15, (-0.35, 0, -0.35), 0.35, wave, 0.014, parting, "", 1500, 13, 0.008)
    if kind == "bob":
        length = rng.uniform(0.16, 0.24)
        return Style(length, length * 0.8, 0.2, (-0.2, 0, -0.4), 0.35, wave, 0.016, parting, "", 1500, 9, 0.008)
    if kind in ("tail", "bun"):
        return Style(0.3, 0.3, 0.05, (-1, 0, 0.1), 0.0, 0.03, 0.006, 0, kind, 1300, 9, 0.006)
    if kind == "short":
        return Style(0.09, 0.06, 0.3, (0.1, 0, -0.4), 0.2, wave, 0.016, parting, "", 1800, 6, 0.006)
    if kind == "curly":
        return Style(0.07, 0.05, 0.8, (0, 0, 0), 0.05, 0.75, 0.035, 0, "", 2200, 6, 0.006)
    if kind == "side":
        length = rng.uniform(0.04, 0.075)
        return Style(length, rng.uniform(0.01, 0.025), 0.35, (0.35, 0, -0.2), 0.08, wave, 0.012, parting, "", 2200, 4, 0.005)
    if kind == "quiff":
        return Style(rng.uniform(0.04, 0.07), 0.012, 0.8, (-0.1, 0, 0.25), 0.0, wave, 0.03, 0, "", 2200, 4, 0.005)
    return Style(rng.uniform(0.008, 0.016), 0.007, 0.7, (0.2, 0, -0.1), 0.0, 0.1, 0.014, 0, "", 2400, 2, 0.004)


@dataclass(frozen=True)
class Head:
    """What hair must know of the head at rest: its middle, and its radius by direction."""

    centre_m: np.ndarray
    radius_m: np.ndarray  # (n_rise, n_azimuth)


_GRID = (36, 72)


def measure_head(rest_m: np.ndarray, landmarks_m: np.ndarray) -> Head:
    """Radii of everything within reach of hair, seen from the middle of the head."""
    ears, top = landmarks_m[3:5].mean(axis=0), landmarks_m[17]
    centre = np.array([ears[0] + 0.005, 0.0, 0.5 * (ears[2] + top[2]) - 0.015])
    offset = rest_m - centre
    distance = np.linalg.norm(offset, axis=1)
    near = (distance < 0.55) & (offset[:, 2] > -0.5)
    row, column = _cell(offset[near])
    radius = np.zeros(_GRID)
    np.maximum.at(radius, (row, column), distance[near])
    for _ in range(12):  # directions no vertex lies in take their neighbours'
        around = [np.roll(radius, s, axis=1) for s in (-1, 1)] + [_shifted(radius, s) for s in (-1, 1)]
        radius = np.where(radius == 0, np.max(around, axis=0), radius)
    return Head(centre, radius)


def _shifted(grid: np.ndarray, step: int) -> np.ndarray:
    return np.concatenate([grid[1:], grid[-1:]]) if step > 0 else np.concatenate([grid[:1], grid[:-1]])


def _cell(offset: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    rise = np.arctan2(offset[..., 2], np.hypot(offset[..., 0], offset[..., 1]))
    azimuth = np.arctan2(offset[..., 1], offset[..., 0])
    row = np.clip(((rise / np.pi + 0.5) * _GRID[0]).astype(int), 0, _GRID[0] - 1)
    return row, np.clip(((azimuth / (2 * np.pi) + 0.5) * _GRID[1]).astype(int), 0, _GRID[1] - 1)


def grow(style: Style, body: Body, rest_m: np.ndarray, landmarks_m: np.ndarray, rng: np.random.Generator) -> g.Mesh:
    """Hair on the body at rest; coords are (across -1..1, length along in metres, random per lock, lying depth)."""
    head = measure_head(rest_m, landmarks_m)
    roots, normals, inside = _roots(style, body, rest_m, rng)
    points, reach = _strands(style, head, roots, normals, inside, rng)
    if style.tie:
        tied, tied_reach = _tail(style, head, rng)
        points, reach = _pad(points, tied), np.concatenate([reach, tied_reach])
    return _ribbons(style, head, points, reach, rng)


def _pad(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.concatenate([a, b], axis=0)


def _roots(style: Style, body: Body, rest_m: np.ndarray, rng: np.random.Generator):
    field = body.field("hairline_m")
    triangles = body.triangles[(field[body.triangles] > -0.004).all(axis=1)]
    corners = rest_m[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    rows = rng.choice(len(triangles), style.n_locks, p=area / area.sum())
    a, b = np.sqrt(rng.random(len(rows))), rng.random(len(rows))
    weights = np.stack([1 - a, a * (1 - b), a * b], axis=1)
    roots = np.einsum("nk,nkj->nj", weights, corners[rows])
    normals = g.vertex_normals(rest_m.astype(np.float32), body.triangles)[triangles[rows]]
    inside = np.einsum("nk,nk->n", weights, field[triangles[rows]])
    return roots, g.unit(np.einsum("nk,nkj->nj", weights, normals)), inside


def _strands(style: Style, head: Head, roots, normals, inside, rng) -> tuple[np.ndarray, np.ndarray]:
    """Points along the locks, (n, n_steps + 1, 3), and each lock's length."""
    n = len(roots)
    relative = roots - head.centre_m
    crown = np.clip((relative[:, 2] + 0.02) / 0.09, 0, 1)
    length = style.side_m + (style.top_m - style.side_m) * crown
    length = length * rng.uniform(0.75, 1.1, n) * np.clip(0.35 + inside / 0.012, 0.35, 1)
    layer = style.volume_m * rng.random(n) ** 1.5 * np.clip(inside / 0.02, 0.1, 1) + 0.0015
    comb = _combing(style, head, roots, normals)
    clump = rng.normal(0, 1, (n, 3))
    direction = g.unit(style.lift * normals + (1 - style.lift) * comb + 0.15 * clump)
    step = (length / style.n_steps)[:, None]
    points = [roots - 0.001 * normals]
    for k in range(style.n_steps):
        wander = rng.normal(0, 1, (n, 3)) * style.curl + 0.5 * style.curl * clump * np.sin(2.2 * k + clump[:, :1] * 3)
        pull = np.array([0, 0, -style.gravity])
        direction = g.unit(direction + 0.5 * (1 - style.lift) * comb + pull + wander)
        points.append(_keep_off(head, points[-1] + step * direction, layer))
        direction = g.unit(points[-1] - points[-2])
        if not style.tie:
            comb = comb * 0.75
        else:
            comb = g.unit(_tie_point(style, head) - points[-1])
    return np.stack(points, axis=1), length


def _tie_point(style: Style, head: Head) -> np.ndarray:
    height = 0.03 if style.tie == "tail" else 0.0
    return head.centre_m + np.array([-0.105, 0, height])


def _combing(style: Style, head: Head, roots, normals) -> np.ndarray:
    if style.tie:
        comb = _tie_point(style, head) - roots
    else:
        comb = np.tile(np.array(style.comb, float), (len(roots), 1))
        side = np.where(roots[:, 1] > 0.02 * style.parting, 1.0, -1.0)
        comb[:, 1] += 0.7 * side * (style.parting != 0)
        front = np.clip((roots[:, 0] - head.centre_m[0]) / 0.08, 0, 1)
        comb[:, 0] -= 0.5 * front * (style.top_m > 0.1)  # long hair leaves the face free
    comb = comb - np.einsum("ij,ij->i", comb, normals)[:, None] * normals
    return g.unit(comb)


def _keep_off(head: Head, points: np.ndarray, layer: np.ndarray) -> np.ndarray:
    offset = points - head.centre_m
    distance = np.linalg.norm(offset, axis=1)
    wanted = head.radius_m[_cell(offset)] + layer
    # Below the head only shoulders and back are in the way, and cloth lies on them.
    wanted = wanted + np.where(offset[:, 2] < -0.2, 0.015, 0)
    scale = np.where((distance < wanted) & (distance > 0.02), wanted / np.maximum(distance, 1e-6), 1)
    return head.centre_m + offset * scale[:, None]


def _tail(style: Style, head: Head, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
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


def _ribbons(style: Style, head: Head, points: np.ndarray, length: np.ndarray, rng) -> g.Mesh:
    n, k, _ = points.shape
    along = np.gradient(points, axis=1)
    outward = g.unit(points - head.centre_m)
    low = points[..., 2] < head.centre_m[2] - 0.12
    outward[low, 2] = 0
    outward = g.unit(outward)
    side = g.unit(np.cross(along, outward))
    outward = g.unit(np.cross(side, along))
    twist = rng.normal(0, 0.25, (n, 1, 1))
    side, outward = side + twist * outward, outward - twist * side
    t = np.linspace(0, 1, k)
    width = style.width_m * rng.uniform(0.5, 1.2, (n, 1)) * (1 - 0.75 * t**2)
    half = 0.5 * width[..., None] * side
    vertices = np.stack([points - half, points + half], axis=2)
    normals = g.unit(np.stack([outward - 0.55 * side, outward + 0.55 * side], axis=2))
    coords = np.empty((n, k, 2, 4), np.float32)
    coords[..., 0] = [-1, 1]
    coords[..., 1] = (t * length[:, None])[..., None]
    coords[..., 2] = rng.random(n)[:, None, None]
    coords[..., 3] = t[:, None]
    strip = g.grid_triangles(k, 2)
    triangles = (np.arange(n)[:, None, None] * (2 * k) + strip).reshape(-1, 3).astype(np.int32)
    flat = [x.reshape(-1, x.shape[-1]).astype(np.float32) for x in (vertices, normals, coords)]
    return g.Mesh(flat[0], triangles, flat[1], flat[2])


def carry(hair: g.Mesh, body: Body, posed: PosedBody, rest_heads_m: np.ndarray, landmarks_m: np.ndarray) -> g.Mesh:
    """Hair at rest brought to the pose: by the head, and from the chin down more and more by the back."""
    head, back = (body.bone_names.index(name) for name in ("head", "spine01"))
    chin = landmarks_m[34, 2]
    share = np.clip((chin - hair.vertices_m[:, 2:]) / 0.14, 0, 1).astype(np.float32)
    places, normals = [], []
    for bone in (head, back):
        R = posed.rotations[bone].astype(np.float32)
        offset = (posed.heads_m[bone] - posed.rotations[bone] @ rest_heads_m[bone]).astype(np.float32)
        places.append(hair.vertices_m @ R.T + offset)
        normals.append(hair.normals @ R.T)
    vertices = places[0] + share * (places[1] - places[0])
    return g.Mesh(vertices, hair.triangles, g.unit(normals[0] + share * (normals[1] - normals[0])), hair.coords)


def hair_material(colour: np.ndarray) -> Material:
    """Hair: locks of slightly different colour, single strands, darker at the roots."""
    colour = np.float32(colour)[:, None]

    def look(hits: Hits) -> Look:
        across, along, lock, t = hits.coords
        uv = np.stack([across * 0.003 + lock * 7.3, along + lock * 3.1])
        strand = textures.strands().sample(uv, hits.footprint_m * 0.5)[0]
        shade = (0.72 + 0.5 * lock) * (1 + 0.28 * strand) * (0.62 + 0.45 * np.minimum(3 * t, 1))
        albedo = colour * np.clip(shade, 0.15, 2) + 0.004
        return Look(np.minimum(albedo, 0.9), gloss=0.06 + 0.02 * strand, roughness=0.38, softness=0.5)

    return look

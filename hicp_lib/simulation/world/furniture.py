"""Furniture and clutter, built of boxes and turned shapes; floor at z = 0, metres."""

from collections.abc import Callable, Iterable
from itertools import product

import numpy as np

from hicp_lib.core.keypoints import INDEX
from hicp_lib.simulation.appearance import materials as m
from hicp_lib.simulation.body.model import PosedBody, load_body
from hicp_lib.simulation.rendering import mesh as g
from hicp_lib.simulation.rendering.surfaces import Surface

Rng = np.random.Generator


def furnish(rng: Rng, half_m: np.ndarray, keep_clear_m: np.ndarray) -> list[Surface]:
    """Furniture and clutter for a room around the origin.

    Parameters
    ----------
    rng : numpy.random.Generator
    half_m : array, shape (2,)
        Half the room's sizes.
    keep_clear_m : array, shape (n, 3)
        Discs (x, y, radius) to keep free.

    Returns
    -------
    list of Surface
    """
    surfaces: list[Surface] = []
    taken = [tuple(disc) for disc in keep_clear_m]
    for number in rng.permutation(len(_PIECES))[: rng.integers(4, 9)]:
        make, radius, turns = _PIECES[number]
        for _ in range(_N_TRIES):
            x, y = rng.uniform(-half_m + radius * 0.8, half_m - radius * 0.8)
            if all(np.hypot(x - a, y - b) > radius + r for a, b, r in taken):
                taken.append((x, y, radius))
                yaw = rng.uniform(-np.pi, np.pi) if turns else rng.choice([0, np.pi / 2])
                surfaces += make(rng, np.array([x, y, 0], np.float32), float(yaw))
                break
    return surfaces


def _boxes_at(place: np.ndarray, yaw: float, spans: list[tuple]) -> g.Mesh:
    """Boxes between pairs of corners about a place, turned about it."""
    return g.turned(g.boxes(place + np.array(spans)), yaw, place)


def legs(xs: Iterable[float], ys: Iterable[float], half: float, low: float, high: float) -> list[tuple]:
    """Square legs or posts.

    Parameters
    ----------
    xs, ys : iterable of float
        Positions: all pairs of these.
    half : float
        Half their width.
    low, high : float
        Heights between which they reach.

    Returns
    -------
    list of tuple
        Pairs of corners, (x, y, z) each.
    """
    return [((x - half, y - half, low), (x + half, y + half, high)) for x, y in product(xs, ys)]


def _table(rng: Rng, place: np.ndarray, yaw: float) -> list[Surface]:
    a, b, h = rng.uniform([0.4, 0.3, 0.55], [0.8, 0.45, 0.78])
    top = ((-a, -b, h - 0.035), (a, b, h))
    spans = [top, *legs((-a + 0.05, a - 0.05), (-b + 0.05, b - 0.05), 0.025, 0, h - 0.03)]
    surfaces = [Surface(_boxes_at(place, yaw, spans), m.wooden(rng))]
    for _ in range(rng.integers(0, 5)):
        x, y = rng.uniform([-a + 0.15, -b + 0.12], [a - 0.15, b - 0.12])
        thing = _small_thing(rng, place + np.array([x, y, h], np.float32))
        surfaces.append(Surface(g.turned(thing, yaw, place), m.plain(m.any_colour(rng), 0.4)))
    return surfaces


def _small_thing(rng: Rng, spot: np.ndarray) -> g.Mesh:
    """A vase or a box."""
    if rng.random() < 0.5:
        r, tall = rng.uniform(0.03, 0.05), rng.uniform(0.08, 0.25)
        mouth = r * rng.uniform(0.4, 1.2)
        return g.lathe([[0, 0], [r, 0], [r, tall * 0.6], [mouth, tall], [0, tall]], spot, 16)
    w, d, t = rng.uniform([0.05, 0.05, 0.01], [0.15, 0.12, 0.2])
    return g.box(spot - [w, d, 0], spot + [w, d, t], rng.uniform(0, 3))


def _chair(rng: Rng, place: np.ndarray, yaw: float) -> list[Surface]:
    h, r = 0.45, 0.21
    frame = legs((-r, r), (-r, r), 0.02, 0, h) + legs((-r, r), (r,), 0.02, h, 0.95)
    cushions = [((-r - 0.02, -r - 0.02, h), (r + 0.02, r + 0.02, h + 0.05))]
    cushions.append(((-r, r - 0.025, 0.62), (r, r + 0.025, 0.95)))
    seat = m.upholstery(rng) if rng.random() < 0.5 else m.plain(m.muted(rng), 0.4)
    stand = m.wooden(rng) if rng.random() < 0.5 else m.plain(np.full(3, 0.08), 0.3)
    return [Surface(_boxes_at(place, yaw, frame), stand), Surface(_boxes_at(place, yaw, cushions), seat)]


def _sofa(rng: Rng, place: np.ndarray, yaw: float) -> list[Surface]:
    w = rng.uniform(0.7, 1.0)
    spans = [
        ((-w, -0.4, 0.05), (w, 0.4, 0.25)),
        ((-w, 0.25, 0.25), (w, 0.45, 0.85)),
        ((-w - 0.12, -0.42, 0.05), (-w, 0.45, 0.6)),
        ((w, -0.42, 0.05), (w + 0.12, 0.45, 0.6)),
        *(((x, -0.42, 0.25), (x + w - 0.01, 0.26, 0.43)) for x in (-w + 0.005, 0.005)),
    ]
    sofa = Surface(_boxes_at(place, yaw, spans), m.upholstery(rng))
    pillow = _boxes_at(place, yaw, [((0.1 - w, 0.05, 0.43), (0.5 - w, 0.2, 0.75))])
    return [sofa, Surface(pillow, m.upholstery(rng))]


def _plant(rng: Rng, place: np.ndarray, yaw: float) -> list[Surface]:
    r, h = rng.uniform(0.11, 0.18), rng.uniform(0.2, 0.4)
    pot = g.lathe([[0, 0], [r * 0.75, 0], [r, h], [r * 0.9, h], [r * 0.88, h - 0.03], [0, h - 0.03]], place)
    n, tall = int(rng.integers(30, 90)), rng.uniform(0.4, 1.1)
    azimuth, rise = rng.uniform(0, 2 * np.pi, n), rng.uniform(0.1, 1, n)
    start = place + np.stack([0 * rise, 0 * rise, h + rise * tall * 0.6], axis=1)
    out = np.stack([np.cos(azimuth), np.sin(azimuth), rng.uniform(0.1, 1.1, n)], axis=1)
    out *= (rng.uniform(0.15, 0.35, n) * (1.2 - 0.5 * rise))[:, None]
    side = np.stack([-np.sin(azimuth), np.cos(azimuth), 0 * rise], axis=1) * rng.uniform(0.02, 0.06)
    drop = np.array([0, 0, -0.1])
    leaf = np.stack([start, start + 0.5 * out + side, start + out + drop, start + 0.5 * out - side], axis=1)
    triangles = (4 * np.arange(n)[:, None, None] + g.QUAD).reshape(-1, 3).astype(np.int32)
    vertices = leaf.reshape(-1, 3).astype(np.float32)
    coords = np.repeat(rng.random((n, 2)), 4, axis=0).astype(np.float32)
    leaves = g.Mesh(vertices, triangles, g.vertex_normals(vertices, triangles), coords)
    return [Surface(pot, m.plain(m.any_colour(rng), 0.5)), Surface(leaves, m.foliage(rng))]


def _boxes(rng: Rng, place: np.ndarray, yaw: float) -> list[Surface]:
    surfaces, z = [], 0.0
    for _ in range(rng.integers(1, 4)):
        a, b, h = rng.uniform([0.15, 0.12, 0.12], [0.3, 0.25, 0.4])
        mesh = g.box(place + [-a, -b, z], place + [a, b, z + h], yaw + rng.normal(0, 0.15))
        colour = np.array([0.42, 0.28, 0.15]) if rng.random() < 0.6 else m.muted(rng)
        surfaces.append(Surface(mesh, m.paint(colour, 0.1)))
        z += h
    return surfaces


def _lamp(rng: Rng, place: np.ndarray, yaw: float) -> list[Surface]:
    h = rng.uniform(1.3, 1.7)
    stand = g.lathe([[0, 0], [0.14, 0], [0.14, 0.02], [0.012, 0.03], [0.012, h], [0, h]], place, 16)
    shade = g.lathe([[0.2, h - 0.12], [0.13, h + 0.16]], place)
    return [
        Surface(stand, m.plain(np.full(3, 0.06), 0.3, 0.2)),
        Surface(shade, m.plain(np.array([0.8, 0.72, 0.6]), 0.6, glow=rng.uniform(0.0, 0.8))),
    ]


def _cupboard(rng: Rng, place: np.ndarray, yaw: float) -> list[Surface]:
    a, b, h = rng.uniform([0.4, 0.2, 0.7], [0.6, 0.28, 1.9])
    doors = [
        ((x, side * b - 0.01, 0.08), (x + a - 0.02, side * b + 0.012, h - 0.03))
        for x in (-a + 0.01, 0.01)
        for side in (-1, 1)
    ]
    material = m.wooden(rng) if rng.random() < 0.6 else m.plain(m.off_white(rng), 0.35)
    return [Surface(_boxes_at(place, yaw, [((-a, -b, 0.05), (a, b, h)), *doors]), material)]


# Function that makes a piece, its size (radius, m), and whether it may have any orientation.
_PIECES: list[tuple[Callable[[Rng, np.ndarray, float], list[Surface]], float, bool]] = [
    (_table, 0.85, False), (_chair, 0.35, True), (_chair, 0.35, True), (_sofa, 1.0, False),
    (_plant, 0.3, False), (_boxes, 0.4, True), (_lamp, 0.25, False), (_cupboard, 0.6, False),
    (_plant, 0.3, False), (_chair, 0.35, True),
]  # fmt: skip
_N_TRIES = 12


def stool(rng: Rng, posed: PosedBody) -> Surface:
    """A stool under a sitting person."""
    seat = posed.vertices_m[load_body().in_regions("hips", "torso", "thigh")]
    x, y = posed.keypoints_m[INDEX["mid_hip"], :2]
    near = np.hypot(seat[:, 0] - x, seat[:, 1] - y) < 0.2
    top = float(seat[near, 2].min()) - 0.004
    r = rng.uniform(0.17, 0.21)
    if rng.random() < 0.5:
        mesh = g.box([x - r, y - r, 0], [x + r, y + r, top], rng.uniform(0, 3))
    else:
        profile = [[r * 0.8, 0], [0.05, 0.05], [0.05, top - 0.06], [r, top - 0.05], [r, top], [0, top]]
        mesh = g.lathe(profile, [x, y, 0])
    return Surface(mesh, m.wooden(rng) if rng.random() < 0.5 else m.plain(m.muted(rng), 0.4))

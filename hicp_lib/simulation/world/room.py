"""Rooms: walls, a floor, windows and doors, furniture and clutter.

World frame: z up, floor at z = 0, metres. The room is a box around the origin.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from hicp_lib.simulation.appearance import materials as m
from hicp_lib.simulation.rendering import mesh as g
from hicp_lib.simulation.rendering.surfaces import Surface
from hicp_lib.simulation.world.furniture import furnish

Rng = np.random.Generator
Span = tuple[float, float]
Window = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Room:
    """A furnished room.

    Attributes
    ----------
    half_m : array, shape (2,)
        Half its sizes along x and y.
    height_m : float
    surfaces : list of Surface
    windows : list of tuple of array, shape (3,)
        Centre, half_u, half_v and inward normal of each pane, for the light.
    """

    half_m: np.ndarray
    height_m: float
    surfaces: list[Surface]
    windows: list[Window]


def make_room(rng: Rng, keep_clear_m: np.ndarray) -> Room:
    """A random room.

    Parameters
    ----------
    rng : numpy.random.Generator
    keep_clear_m : array, shape (n, 3)
        Discs (x, y, radius) on the floor to keep free, for people and the view of them.

    Returns
    -------
    Room

    Examples
    --------
    >>> room = make_room(np.random.default_rng(0), np.array([[0.0, 0.0, 1.0]]))
    >>> 2.4 <= room.height_m <= 3.1, len(room.surfaces) > 10
    (True, True)
    """
    half = rng.uniform([2.6, 3.2], [4.2, 4.6])
    height = rng.uniform(2.4, 3.1)
    walls = [_Wall(number, half, height) for number in range(4)]
    surfaces = _shell(rng, half, height, walls)
    for wall in walls:
        surfaces += _on_wall(rng, wall)
    surfaces += furnish(rng, half, keep_clear_m)
    return Room(half, height, surfaces, [window for wall in walls for window in wall.windows])


class _Wall:
    """One wall's own frame: u along it, v up, w into the room; and the windows in it, see `Room`."""

    def __init__(self, number: int, half: np.ndarray, height: float):
        axis, sign = number // 2, 1 - 2 * (number % 2)
        self.inward = np.zeros(3, np.float32)
        self.inward[axis] = -sign
        self.u = np.cross([0, 0, 1], self.inward).astype(np.float32)
        self.half_width, self.height = float(half[1 - axis]), height
        self.centre = np.zeros(3, np.float32)
        self.centre[axis] = sign * half[axis]
        self.windows: list[Window] = []

    def point(self, u: float | np.ndarray, v: float, w: float | np.ndarray = 0.0) -> np.ndarray:
        """A place, or several for u and w of shape (n, 1)."""
        return self.centre + u * self.u + np.array([0, 0, v], np.float32) + w * self.inward

    def boxes(self, *spans: tuple[Span, Span, Span]) -> g.Mesh:
        """Boxes, each ((u, u), (v, v), (w, w))."""
        u, v, w = (np.array(spans, np.float32)[:, k, :, None] for k in range(3))
        points = self.centre + u * self.u + v * np.array([0, 0, 1], np.float32) + w * self.inward
        return g.boxes(np.stack([points.min(axis=1), points.max(axis=1)], axis=1))

    def panel(self, u: tuple[float, float], v: tuple[float, float], w: float) -> g.Mesh:
        return g.quad(self.point(u[0], v[0], w), (u[1] - u[0]) * self.u, np.array([0, 0, v[1] - v[0]]))


def _shell(rng: Rng, half: np.ndarray, height: float, walls: list[_Wall]) -> list[Surface]:
    x, y = half
    floor = g.quad([-x, -y, 0], [2 * x, 0, 0], [0, 2 * y, 0])
    if rng.random() < 0.5:
        floor = g.quad([x, -y, 0], [0, 2 * y, 0], [-2 * x, 0, 0])
    ceiling = g.quad([-x, y, height], [2 * x, 0, 0], [0, -2 * y, 0])
    surfaces = [Surface(floor, m.random_floor(rng)), Surface(ceiling, m.paint(m.off_white(rng), 0.03))]
    paint = m.random_wall(rng)
    accent = int(rng.integers(0, 8))  # often, one wall differs
    for number, wall in enumerate(walls):
        material = m.random_wall(rng) if number == accent else paint
        surfaces.append(Surface(wall.panel((-wall.half_width, wall.half_width), (0, height), 0), material))
    skirting_colour = m.off_white(rng) if rng.random() < 0.7 else m.wood_colour(rng)
    skirting = [wall.boxes(((-wall.half_width, wall.half_width), (0, 0.09), (0, 0.015))) for wall in walls]
    return [*surfaces, Surface(g.concatenate(skirting), m.plain(skirting_colour, 0.4))]


def _on_wall(rng: Rng, wall: _Wall) -> list[Surface]:
    """Objects on a wall and openings in it, side by side."""
    surfaces: list[Surface] = []
    u = -wall.half_width + rng.uniform(0.1, 0.8)
    while u < wall.half_width - 0.5:
        kind = rng.choice(list(_ON_WALL), p=[often for often, _, _ in _ON_WALL.values()])
        _, width, make = _ON_WALL[kind]
        width *= rng.uniform(0.8, 1.25)
        if u + width > wall.half_width - 0.1:
            break
        surfaces += make(rng, wall, (u, u + width))
        u += width + rng.uniform(0.15, 0.9)
    return surfaces


def _radiator(rng: Rng, wall: _Wall, span: Span) -> list[Surface]:
    ribs = [((u, u + 0.05), (0.12, 0.7), (0.03, 0.12)) for u in np.arange(span[0], span[1] - 0.05, 0.075)]
    return [Surface(wall.boxes(*ribs), m.plain(m.off_white(rng), 0.35))]


def _window(rng: Rng, wall: _Wall, span: Span) -> list[Surface]:
    low, high = rng.uniform(0.6, 1.0), rng.uniform(2.0, min(2.3, wall.height - 0.1))
    pane = wall.panel(span, (low, high), 0.01)
    centre = wall.point(sum(span) / 2, (low + high) / 2, 0.03)
    half_u, half_v = wall.u * (span[1] - span[0]) / 2, np.array([0, 0, (high - low) / 2])
    wall.windows.append((centre, half_u, half_v, wall.inward))
    bars = [span[0], *np.linspace(*span, rng.integers(2, 4))[1:-1], span[1]]
    frame = [((b - 0.03, b + 0.03), (low - 0.03, high + 0.03), (0, 0.04)) for b in bars]
    frame += [(span, (b - 0.03, b + 0.03), (0, 0.04)) for b in (low, high)]
    frame.append(((span[0] - 0.08, span[1] + 0.08), (low - 0.06, low - 0.03), (0, 0.16)))
    surfaces = [Surface(pane, m.outside(rng)), Surface(wall.boxes(*frame), m.plain(m.off_white(rng), 0.35))]
    if rng.random() < 0.5:
        surfaces.append(_curtains(rng, wall, span, high))
    return surfaces


def _curtains(rng: Rng, wall: _Wall, span: Span, high: float) -> Surface:
    meshes = []
    width, bottom = rng.uniform(0.25, 0.5), rng.choice([0.05, 0.6])
    for side in (span[0] - 0.2, span[1] + 0.2 - width):
        u = np.linspace(side, side + width, 40)
        fold = 0.09 + 0.03 * np.sin((u - side) * 2 * np.pi / rng.uniform(0.07, 0.11) + rng.uniform(0, 6))
        rows = [wall.point(u[:, None], v, fold[:, None]) for v in (bottom, high + 0.1)]
        vertices = np.concatenate(rows).astype(np.float32)
        triangles = g.grid_triangles(2, len(u))
        coords = np.tile(np.c_[(u - side) * 2, u * 0], (2, 1)).astype(np.float32)
        coords[len(u) :, 1] = high - bottom
        meshes.append(g.Mesh(vertices, triangles, g.vertex_normals(vertices, triangles), coords))
    return Surface(g.concatenate(meshes), m.upholstery(rng))


def _door(rng: Rng, wall: _Wall, span: Span) -> list[Surface]:
    top = 2.05
    leaf = wall.panel(span, (0, top), 0.012)
    parts: list[tuple[Span, Span, Span]]
    parts = [((b - 0.04, b + 0.04), (0, top + 0.04), (0, 0.04)) for b in span]
    parts.append(((span[0] - 0.04, span[1] + 0.04), (top, top + 0.08), (0, 0.04)))
    inset = (span[0] + 0.13, span[1] - 0.13)
    parts += [(inset, v, (0.012, 0.022)) for v in ((0.2, 0.85), (1.05, 1.9))]
    handle = wall.boxes(((span[1] - 0.13, span[1] - 0.03), (1.02, 1.04), (0.04, 0.07)))
    material = m.plain(m.off_white(rng), 0.35) if rng.random() < 0.5 else m.wooden(rng)
    return [
        Surface(g.concatenate([leaf, wall.boxes(*parts)]), material),
        Surface(handle, m.plain(np.full(3, 0.35), 0.25, 0.5)),
    ]


def _picture(rng: Rng, wall: _Wall, span: Span) -> list[Surface]:
    height = (span[1] - span[0]) * rng.uniform(0.6, 1.4)
    middle = rng.uniform(1.45, 1.75)
    v = (middle - height / 2, middle + height / 2)
    frame = wall.boxes(((span[0] - 0.03, span[1] + 0.03), (v[0] - 0.03, v[1] + 0.03), (0, 0.02)))
    mount = wall.panel(span, v, 0.022)
    border = rng.uniform(0.0, 0.12) * (span[1] - span[0])
    image = wall.panel((span[0] + border, span[1] - border), (v[0] + border, v[1] - border), 0.024)
    frame_colour = rng.choice([np.full(3, 0.02), np.full(3, 0.7), m.wood_colour(rng)])
    return [
        Surface(frame, m.plain(frame_colour, 0.4)),
        Surface(mount, m.plain(np.full(3, 0.75), 0.8)),
        Surface(image, m.pictured(int(rng.integers(24)))),
    ]


def _shelf(rng: Rng, wall: _Wall, span: Span) -> list[Surface]:
    """A bookcase on the floor, or boards on the wall, with books and boxes."""
    standing = rng.random() < 0.6
    depth = rng.uniform(0.22, 0.35)
    low, high = (0.0, rng.uniform(1.2, 2.1)) if standing else (rng.uniform(1.1, 1.4), rng.uniform(1.7, 2.1))
    levels = np.linspace(low + 0.03, high, int(np.ceil((high - low) / 0.36)) + 1)
    boards = [(span, (v - 0.012, v + 0.012), (0, depth)) for v in levels]
    if standing:
        boards += [((b - 0.012, b + 0.012), (0, high), (0, depth)) for b in span]
        boards.append((span, (0, high), (0, 0.01)))
    books = wall.boxes(
        *chain(*(_row_of_books(rng, span, v, depth, levels[1] - levels[0]) for v in levels[:-1]))
    )
    wood = m.wooden(rng) if rng.random() < 0.6 else m.plain(m.off_white(rng), 0.4)
    colour = np.repeat(rng.integers(5, size=len(books.vertices_m) // 24), 24)[:, None].astype(np.float32)
    coloured = m.one_of([m.muted(rng), *(m.any_colour(rng) for _ in range(4))], 0.55)
    return [Surface(wall.boxes(*boards), wood), Surface(replace(books, coords=colour), coloured)]


def _row_of_books(rng: Rng, span: Span, v: float, depth: float, room: float) -> np.ndarray:
    """Books, boxes and gaps on a board at height `v`, the next `room` above: spans, (n, 3, 2)."""
    n = int((span[1] - span[0]) / 0.015)  # more than fit
    thick = np.where(rng.random(n) < 0.85, rng.uniform(0.015, 0.05, n), rng.uniform(0.12, 0.25, n))
    gap = np.where(rng.random(n) < 0.15, rng.uniform(0.05, 0.25, n), 0.002)
    end = span[0] + 0.03 + np.cumsum(gap + thick)
    high = v + np.minimum(rng.uniform(0.17, 0.29, n), room - 0.04)
    front = depth - rng.uniform(0.01, 0.07, n)
    low, back = np.full(n, v + 0.012), np.full(n, 0.015)
    spans = np.stack(
        [np.stack(ends, axis=1) for ends in ((end - thick, end), (low, high), (back, front))], axis=1
    )
    return spans[end < span[1] - 0.02]


# Objects on a wall: frequency, width (m), function that makes them.
_ON_WALL: dict[str, tuple[float, float, Callable[[Rng, _Wall, Span], list[Surface]]]] = {
    "window": (0.22, 1.4, _window),
    "door": (0.13, 0.9, _door),
    "picture": (0.30, 0.6, _picture),
    "shelf": (0.17, 1.0, _shelf),
    "nothing": (0.10, 0.6, lambda rng, wall, span: []),
    "radiator": (0.08, 1.0, _radiator),
}

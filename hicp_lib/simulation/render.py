"""From surfaces, lights and a camera to what the camera sees: colour, depth, people and parts."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from hicp_lib.simulation import lights
from hicp_lib.simulation.antialias import edge_pixels, smooth_edges
from hicp_lib.simulation.camera import Camera, pixel_rays
from hicp_lib.simulation.filters import Looks, View, tilt_by_height
from hicp_lib.simulation.raycast import RayScene, Trace, dot, trace_image
from hicp_lib.simulation.shadows import visibility
from hicp_lib.simulation.surfaces import Look, Surface

_BLOCK = 16_384  # pixels shaded at a time: what the processor's cache holds


@dataclass(frozen=True)
class World:
    """All there is to see: surfaces, area lights, ambient light, and the colour where nothing is."""

    surfaces: list[Surface]
    lights: list[lights.Light]
    ambient: lights.Ambient
    backdrop: np.ndarray


@dataclass(frozen=True)
class Frame:
    """What a camera sees.

    Attributes
    ----------
    radiance : linear RGB, shape (height, width, 3), float32; a sensor makes an image of it
    depth_m : along the camera's z axis, shape (height, width), float32; infinite where nothing is
    person : index of the person seen at each pixel, -1 for none, shape (height, width), int16
    part : body part seen there (numbering of the surfaces' `parts`), -1 for none, same shape, int16
    rays : the scene, to ask further questions of
    """

    radiance: np.ndarray
    depth_m: np.ndarray
    person: np.ndarray
    part: np.ndarray
    rays: RayScene


def render(world: World, camera: Camera, rng: np.random.Generator) -> Frame:
    """Render one frame; the random generator scatters the shadow rays.

    Depth and people are exact at every pixel, but only people are shaded there: they are in focus.
    What is around them is shaded at every second row and column, and a little out of focus.
    """
    scene = RayScene(world.surfaces)
    rays = pixel_rays(camera)
    shape = (camera.height_px, camera.width_px)
    trace = trace_image(scene, rays, shape, np.array([s.person >= 0 for s in world.surfaces]))
    person, part = (labels.reshape(shape) for labels in _labels(scene, trace))
    around = View.of(trace, rays, (slice(None, None, 2), slice(None, None, 2)), person < 0)
    image = _enlarge(
        _paint(world, scene, around, camera, False, rng), around.wanted, trace.surface.reshape(shape)
    )
    image.reshape(-1, 3)[trace.surface < 0] = world.backdrop
    rows, columns = (np.flatnonzero((person >= 0).any(axis=axis)) for axis in (1, 0))
    if len(rows):
        crop = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        people = View.of(trace, rays, crop, person >= 0)
        painted = _paint(world, scene, people, camera, True, rng)
        cv2.copyTo(cv2.merge(list(painted)), people.wanted.astype(np.uint8), image[crop])
        image = smooth_edges(image, edge_pixels(trace, person >= 0), trace, scene, camera)
    return Frame(image, trace.depth_m.reshape(shape), person, part, scene)


def _paint(world: World, scene: RayScene, view: View, camera: Camera, sharp: bool, rng) -> np.ndarray:
    """Linear RGB of a view, (3, rows, columns), black where nothing is wanted."""
    looks = _gather_looks(scene, view, 1 / camera.fx_px)
    positions, normals, heights = (
        looks.on_grid(name, view) for name in ("positions_m", "normals", "height_m")
    )
    tilt_by_height(normals, positions, heights, view)
    looks.normals = normals[:, looks.pixels]
    seen = visibility(world.lights, scene, view, positions, normals, sharp, rng)
    image = np.zeros((3, view.wanted.size), np.float32)
    for start in range(0, len(looks.pixels), _BLOCK):
        block = looks.part(slice(start, start + _BLOCK))
        direction = view.rays[block.pixels, 3:].T
        image[:, block.pixels] = _shade_block(world, block, direction, seen[:, block.pixels])
    return image.reshape(3, *view.wanted.shape)


def _enlarge(painted: np.ndarray, wanted: np.ndarray, surface: np.ndarray) -> np.ndarray:
    """From every second pixel to all, (height, width, 3), out of focus; colours run on under people.

    Each pixel takes the colour of the nearest painted one that shows the same surface, so
    that outlines stay where they are.
    """
    columns = painted.shape[2]
    coarse_surface = np.where(wanted, surface[::2, ::2], np.int16(-1))
    wrong = np.flatnonzero(_doubled(coarse_surface, surface.shape) != surface)
    row, column = (numbers // 2 for numbers in np.divmod(wrong, surface.shape[1]))
    best = row * columns + column
    coarse_surface = coarse_surface.ravel()
    for dv, du in ((-1, -1), (-1, 1), (1, -1), (1, 1), (-1, 0), (0, -1), (1, 0), (0, 1)):
        near = np.clip(row + dv, 0, painted.shape[1] - 1) * columns + np.clip(column + du, 0, columns - 1)
        same = coarse_surface[near] == surface.ravel()[wrong]
        best[same] = near[same]
    weighted = np.dstack([np.moveaxis(painted, 0, -1) * wanted[..., None], wanted]).astype(np.float32)
    weighted += 1e-4 * cv2.blur(weighted, (9, 9)) + 1e-9
    full = _doubled(weighted, surface.shape)
    full.reshape(-1, 4)[wrong] = weighted.reshape(-1, 4)[best]
    full = cv2.GaussianBlur(full, (0, 0), 1.1)
    weight = np.ascontiguousarray(full[..., 3])
    return cv2.merge([full[..., channel] / weight for channel in range(3)])


def _doubled(image: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Each pixel as two by two, cut to `shape` (height, width)."""
    height, width = image.shape[:2]
    doubled = cv2.resize(image, (2 * width, 2 * height), interpolation=cv2.INTER_NEAREST)
    return np.ascontiguousarray(doubled[: shape[0], : shape[1]])


def _labels(scene: RayScene, trace: Trace) -> tuple[np.ndarray, np.ndarray]:
    """Person and part per ray, -1 where there is none."""
    owner = np.array([s.person for s in scene.surfaces] + [-1], np.int16)
    parts = [np.full(len(s.mesh.triangles), -1) if s.parts is None else s.parts for s in scene.surfaces]
    return owner[trace.surface], np.concatenate([*parts, [-1]]).astype(np.int16)[trace.triangle]


def _gather_looks(scene: RayScene, view: View, pixel_rad: float) -> Looks:
    wanted = np.flatnonzero(view.wanted)
    # Sorted by surface, each one's hits lie side by side.
    pixels = wanted[np.argsort(view.trace.surface[wanted], kind="stable")]
    bounds = np.searchsorted(view.trace.surface[pixels], np.arange(len(scene.surfaces) + 1))
    looks = Looks.empty(pixels)
    trace, rays = view.trace.take(pixels), view.rays.take(pixels, axis=0)
    for number in np.flatnonzero(np.diff(bounds)):
        rows = slice(bounds[number], bounds[number + 1])
        hits = scene.hits(trace.between(rows), rays[rows], number, pixel_rad)
        look: Look = scene.surfaces[number].material(hits)
        looks.positions_m[:, rows] = hits.positions_m
        looks.normals[:, rows] = hits.normals if look.normals is None else look.normals
        for name in ("albedo", "height_m", "gloss", "roughness", "softness", "glow"):
            value = getattr(look, name)
            if np.ndim(value) or value:
                getattr(looks, name)[..., rows] = value
    return looks


def _shade_block(world: World, looks: Looks, direction: np.ndarray, seen: np.ndarray) -> np.ndarray:
    view = direction / -np.sqrt(dot(direction, direction))
    light = lights.ambient_light(world.ambient, looks.normals)
    facing = 1 - np.clip(dot(looks.normals, view), 0, 1)
    facing *= facing
    fresnel = looks.gloss * (1 + 4 * facing * facing) * (1 - 0.7 * looks.roughness)
    # Part of what is hidden returns by bouncing about: crevices are not black.
    light *= seen[-1] * 0.85 + 0.15
    highlight = fresnel * light
    diffuse = light
    for number, source in enumerate(world.lights):
        more, shine = lights.diffuse_and_highlight(
            source, looks.positions_m, looks.normals, view, looks.gloss, looks.roughness, looks.softness
        )
        diffuse += more * seen[number]
        highlight += shine * seen[number]
    return looks.albedo * diffuse + highlight + looks.glow

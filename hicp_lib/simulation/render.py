"""From surfaces, lights and a camera to what the camera sees: colour, depth, people and parts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hicp_lib.simulation import lights
from hicp_lib.simulation.antialias import edge_pixels, smooth_edges
from hicp_lib.simulation.camera import Camera, pixel_rays
from hicp_lib.simulation.filters import Looks, tilt_by_height
from hicp_lib.simulation.raycast import RayScene, Trace, dot
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
    """Render one frame; the random generator scatters the shadow rays."""
    scene = RayScene(world.surfaces)
    rays = pixel_rays(camera)
    trace = scene.trace(rays)
    shape = (camera.height_px, camera.width_px)
    person, part = _labels(scene, trace)
    looks = _gather_looks(scene, trace, rays, 1 / camera.fx_px)
    tilt_by_height(looks, trace, shape)
    seen = visibility(world.lights, scene, trace, looks, person >= 0, shape, rng)
    image = _shade(world, looks, rays, seen, trace).T.reshape(*shape, 3)
    image = smooth_edges(image, edge_pixels(trace, shape), trace, scene, camera)
    return Frame(image, trace.depth_m.reshape(shape), person.reshape(shape), part.reshape(shape), scene)


def _labels(scene: RayScene, trace: Trace) -> tuple[np.ndarray, np.ndarray]:
    """Person and part per ray, -1 where there is none."""
    owner = np.array([s.person for s in scene.surfaces] + [-1], np.int16)
    parts = [np.full(len(s.mesh.triangles), -1) if s.parts is None else s.parts for s in scene.surfaces]
    return owner[trace.surface], np.concatenate([*parts, [-1]]).astype(np.int16)[trace.triangle]


def _gather_looks(scene: RayScene, trace: Trace, rays: np.ndarray, pixel_rad: float) -> Looks:
    order = np.argsort(trace.surface, kind="stable")
    bounds = np.searchsorted(trace.surface[order], np.arange(len(scene.surfaces) + 1))
    looks = Looks.empty(len(rays))
    for number, (start, stop) in enumerate(zip(bounds[:-1], bounds[1:], strict=True)):
        if start == stop:
            continue
        rows = order[start:stop]
        hits = scene.hits(trace, rays, rows, number, pixel_rad)
        look: Look = scene.surfaces[number].material(hits)
        looks.positions_m[:, rows] = hits.positions_m
        looks.normals[:, rows] = hits.normals if look.normals is None else look.normals
        for name in ("albedo", "height_m", "gloss", "roughness", "softness", "glow"):
            value = getattr(look, name)
            if np.ndim(value) or value:
                getattr(looks, name)[..., rows] = value
    return looks


def _shade(world: World, looks: Looks, rays: np.ndarray, seen: np.ndarray, trace: Trace) -> np.ndarray:
    """Linear RGB per ray, (3, n)."""
    image = np.empty((3, len(rays)), np.float32)
    for start in range(0, len(rays), _BLOCK):
        block = slice(start, start + _BLOCK)
        image[:, block] = _shade_block(world, looks.part(block), rays[block, 3:].T, seen[:, block])
    image[:, trace.surface < 0] = world.backdrop.astype(np.float32)[:, None]
    return image


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

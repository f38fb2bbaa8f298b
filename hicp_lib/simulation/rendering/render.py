"""Render surfaces and lights to a camera's view: colour, depth, people and body parts."""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from hicp_lib.simulation.rendering.antialias import edge_pixels, smooth_edges
from hicp_lib.simulation.rendering.camera import PlacedCamera, image_directions
from hicp_lib.simulation.rendering.filters import tilt_by_height
from hicp_lib.simulation.rendering.gbuffer import GBuffer, Shading, View, evaluate_materials, from_half
from hicp_lib.simulation.rendering.lights import Ambient, Light, ambient_light, diffuse_and_highlight
from hicp_lib.simulation.rendering.raycast import RayScene, dot, doubled, pick, place, trace_image
from hicp_lib.simulation.rendering.shadows import visibility
from hicp_lib.simulation.rendering.surfaces import Surface, column

_BLOCK = 16_384  # pixels shaded at a time, to fit the processor's cache


@dataclass(frozen=True)
class World:
    """A scene to render.

    Attributes
    ----------
    surfaces : list of Surface
    lights : list of Light
    ambient : Ambient
    backdrop : array, shape (3,)
        Linear RGB of the background.
    """

    surfaces: list[Surface]
    lights: list[Light]
    ambient: Ambient
    backdrop: np.ndarray

    @cached_property
    def rays(self) -> RayScene:
        """The surfaces, ready for ray tracing; shared by all frames without motion."""
        return RayScene(self.surfaces)


@dataclass(frozen=True)
class Frame:
    """What a camera sees.

    Attributes
    ----------
    radiance : array, shape (height, width, 3), dtype float32
        Linear RGB; a sensor makes an image of it.
    depth_m : array, shape (height, width), dtype float32
        Along the camera's z axis; infinite where nothing is.
    person : array, shape (height, width), dtype int16
        Index of the person seen at each pixel, -1 for none.
    rays : RayScene
        The scene, to ask further questions of.
    """

    radiance: np.ndarray
    depth_m: np.ndarray
    person: np.ndarray
    rays: RayScene


def render(world: World, camera: PlacedCamera) -> Frame:
    """Render one frame.

    Depth and people are exact at every pixel, but only people are shaded at full resolution, in focus.
    Everything else is shaded at every second row and column, slightly out of focus.

    Parameters
    ----------
    world : World
    camera : PlacedCamera

    Returns
    -------
    Frame

    Examples
    --------
    >>> from hicp_lib.simulation.appearance.materials import plain
    >>> from hicp_lib.simulation.rendering.camera import look_at
    >>> from hicp_lib.simulation.rendering.mesh import quad
    >>> wall = Surface(quad([-5, 2, -5], [10, 0, 0], [0, 0, 10]), plain(np.full(3, 0.5)))
    >>> dim = Ambient(np.full(3, 0.4), np.full(3, 0.2), np.zeros(3), np.array([1.0, 0, 0]))
    >>> camera = PlacedCamera(64, 48, 60.0, 60.0, 31.5, 23.5, look_at([0, -1, 0], [0, 0, 0]))
    >>> frame = render(World([wall], [], dim, np.zeros(3)), camera)
    >>> frame.radiance.shape, float(frame.depth_m[24, 32].round(3))
    ((48, 64, 3), 3.0)
    """
    scene, directions = world.rays, image_directions(camera)
    centre_m = camera.centre_m.astype(np.float32)
    shape = (camera.height_px, camera.width_px)
    trace, half_trace = trace_image(scene, centre_m, directions, scene.owners[:-1] >= 0)
    person = scene.owners.take(trace.surface, mode="wrap").reshape(shape)
    is_person = person >= 0
    view = View(trace, centre_m, directions)
    half = View(half_trace, centre_m, np.ascontiguousarray(directions[:, ::2, ::2]))
    coarse = [GBuffer(half, wanted[::2, ::2]) for wanted in (~is_person, is_person)]
    normals = [part.normals(scene) for part in coarse]
    seen = visibility(world.lights, scene, coarse, normals)
    around, _ = coarse
    painted = _paint(world, around, normals[0], camera, pick(seen, around.pixels))
    image = _enlarge(painted, around, view, ~is_person)
    pixels = image.reshape(-1, 3).T
    place(pixels, np.flatnonzero(trace.surface < 0), column(world.backdrop))
    if is_person.any():
        people = GBuffer(view, is_person)
        lit = from_half(seen, half, view, people.pixels)
        place(pixels, people.pixels, _paint(world, people, people.normals(scene), camera, lit))
        image = smooth_edges(image, edge_pixels(trace, is_person), trace, scene, camera)
    return Frame(image, trace.depth_m.reshape(shape), person, scene)


def _paint(world: World, gbuffer: GBuffer, normals, camera: PlacedCamera, seen: np.ndarray) -> np.ndarray:
    """Linear RGB of a G-buffer's pixels, (3, n), where `seen` (n_lights + 1, n) is visible of each light."""
    shading = evaluate_materials(world.rays, gbuffer, normals, 1 / camera.fx_px)
    if shading.height_m.any():
        shading.normals = tilt_by_height(shading.normals, shading.height_m, gbuffer)
    positions_m, painted = gbuffer.positions_m, np.empty_like(shading.normals)
    for start in range(0, len(gbuffer.pixels), _BLOCK):
        block = slice(start, start + _BLOCK)
        geometry = (values[:, block] for values in (positions_m, gbuffer.directions, seen))
        painted[:, block] = _shade_block(world, shading.part(block), *geometry)
    return painted


def _shade_block(world: World, shading: Shading, positions_m, direction, seen: np.ndarray) -> np.ndarray:
    view = direction / -np.sqrt(dot(direction, direction))
    diffuse = ambient_light(world.ambient, shading.normals)
    facing = 1 - np.clip(dot(shading.normals, view), 0, 1)
    facing *= facing
    fresnel = shading.gloss * (1 + 4 * facing * facing) * (1 - np.float32(0.7) * shading.roughness)
    # Part of the blocked light arrives by indirect reflection: crevices are not black.
    diffuse *= seen[-1] * np.float32(0.95) + np.float32(0.05)
    highlight = fresnel * diffuse
    for source, visible in zip(world.lights, seen[:-1], strict=True):
        more, shine = diffuse_and_highlight(source, positions_m, view, shading)
        more *= visible
        shine *= visible
        diffuse += more
        highlight += shine
    diffuse *= shading.albedo
    diffuse += highlight
    diffuse += shading.glow
    return diffuse


def _enlarge(painted: np.ndarray, around: GBuffer, view: View, wanted: np.ndarray) -> np.ndarray:
    """From every second pixel to all, (height, width, 3), out of focus; colours run on under people.

    The `wanted` pixels take the colours (3, n) of painted ones that show the same surface, so that outlines
    stay where they are.
    """
    half = around.view
    coarse = np.zeros((*half.shape, 4), np.float32)
    place(coarse.reshape(-1, 4).T, around.pixels, [*painted, np.float32(1)])
    empty = np.flatnonzero(coarse[..., 3] == 0)
    *near, weight = cv2.blur(coarse, (9, 9)).reshape(-1, 4).take(empty, axis=0).T
    place(coarse.reshape(-1, 4).T, empty, [*near / np.maximum(weight, np.float32(1e-9)), np.float32(1)])
    colours = np.ascontiguousarray(coarse[..., :3])
    full = doubled(colours, view.shape)
    differs = doubled(half.trace.surface.reshape(half.shape), view.shape) != view.trace.surface.reshape(
        view.shape
    )
    wrong = np.flatnonzero(differs & wanted)
    place(full.reshape(-1, 3).T, wrong, from_half(colours.reshape(-1, 3).T, half, view, wrong))
    return cv2.GaussianBlur(full, (7, 7), 1.1)

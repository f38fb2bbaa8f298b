"""Smooth edges against the area of pixels that a plane's edge covers."""

import numpy as np

from hicp_lib.simulation.appearance import materials
from hicp_lib.simulation.rendering import mesh as g
from hicp_lib.simulation.rendering.antialias import edge_pixels, smooth_edges
from hicp_lib.simulation.rendering.camera import PlacedCamera, image_directions, look_at
from hicp_lib.simulation.rendering.raycast import RayScene, trace_image
from hicp_lib.simulation.rendering.surfaces import Surface

CAMERA = PlacedCamera(80, 60, 70.0, 70.0, 39.5, 29.5, look_at([0, -3, 0], [0, 0, 0]))
SLOPE = 0.3  # of the edge, in the image as in the world
FAINT = 1e-3  # so little light that compression does not bend the mean


def _seen():
    """A board whose upper edge slants through the image, before a wall."""
    board = g.quad([-5, 0, -5 - 5 * SLOPE], [10, 0, 10 * SLOPE], [0, 0, 5])
    wall = g.quad([-9, 2, -9], [18, 0, 0], [0, 0, 18])
    grey = materials.plain(np.full(3, 0.5))
    scene = RayScene([Surface(board, grey, 0), Surface(wall, grey)])
    trace, _ = trace_image(scene, CAMERA.centre_m, image_directions(CAMERA), np.array([True, False]))
    return scene, trace, (trace.surface == 0).reshape(60, 80)


def _covered() -> np.ndarray:
    """Share of each pixel below the edge, by 16 x 16 points."""
    sub = (np.arange(16) + 0.5) / 16 - 0.5
    v = np.arange(60)[:, None, None, None] + sub[:, None]
    u = np.arange(80)[:, None, None] + sub
    return (-(v - 29.5) < SLOPE * (u - 39.5)).mean(axis=(2, 3))


def test_edge_pixels_take_the_share_that_is_covered():
    scene, trace, board = _seen()
    edges = edge_pixels(trace, board)
    image = np.repeat(np.where(board, FAINT, 0)[..., None], 3, axis=2).astype(np.float32)
    rough = image[..., 0] / FAINT - _covered()
    smooth = smooth_edges(image, edges, trace, scene, CAMERA)[..., 0] / FAINT - _covered()
    assert np.sqrt((smooth.ravel()[edges] ** 2).mean()) < 0.5 * np.sqrt((rough.ravel()[edges] ** 2).mean())
    assert abs(smooth.ravel()[edges].mean()) < 0.01


def test_only_pixels_at_the_edge_change():
    scene, trace, board = _seen()
    edges = edge_pixels(trace, board)
    assert 0 < len(edges) < 4 * 80
    image = np.random.default_rng(0).random((60, 80, 3), np.float32)
    smooth = smooth_edges(image.copy(), edges, trace, scene, CAMERA)
    same = np.ones(60 * 80, bool)
    same[edges] = False
    assert (smooth == image).reshape(-1, 3)[same].all()
    assert len(edge_pixels(trace, np.zeros_like(board))) == 0

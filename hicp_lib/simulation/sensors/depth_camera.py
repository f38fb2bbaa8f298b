"""A stereo depth camera like Intel's RealSense D435: what it measures of a scene, and what it misses.

Depth is measured in the left imager's view as disparity, d = f B / z, and has the errors of stereo
matching; then it is aligned to the colour camera, which sits 15 mm to the left of the left imager.
Both look the same way. Sources: Intel's "Tuning depth cameras for best performance" (Grunnet-Jepsen,
Sweetser, Woodfill) for the noise, the D435's data sheet for geometry and invalid band, librealsense
for units, range and alignment; the book's page on simulated sensors has the formulas.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from hicp_lib.simulation.appearance.people import RIGHT
from hicp_lib.simulation.body.model import REGIONS
from hicp_lib.simulation.rendering.camera import PlacedCamera, image_directions, join_rays, pixel_rays
from hicp_lib.simulation.rendering.raycast import RayScene, doubled
from hicp_lib.simulation.sensors.depth_alignment import align_to_colour
from hicp_lib.simulation.sensors.depth_noise import correlated_noise, patches

Rng = np.random.Generator

_CURVED_PX = 0.08  # disparities whose second difference is larger are not interpolated
_STEP_PX = 1.0  # neighbours whose disparities differ by more lie on different surfaces
_EDGE_JITTER = 0.12  # how far texture moves the edges of matching, as a share of the window
_EDGE_GROWTH = 0.06  # and how far near surfaces, which stand out, spread over far ones
_HAIR_PARTS = (REGIONS.index("scalp"), REGIONS.index("scalp") + RIGHT)


@dataclass(frozen=True)
class DepthCamera:
    """Geometry and errors of the depth camera; zero (or False) switches an error off.

    Attributes
    ----------
    width_px, height_px : int
        Of the left imager; its principal point is the middle.
    focal_px : float
        Of the left imager.
    baseline_m : float
        From the left to the right imager.
    colour_offset_m : float
        From the colour camera to the left imager.
    subpixel_rms_px : float
        Standard deviation of disparity; z**2 * subpixel_rms_px / (f B) in depth.
    window_px : int
        Side of the matching window, odd; noise is correlated over about this much.
    edge_px : float
        Width of the slope of flying pixels between two depths; 0 makes depth steps sharp.
    edge_holes : float
        Share of that slope that gets no depth.
    disparity_step_px : float
        What disparity is a multiple of.
    depth_units_per_m : float
        What depth is a multiple of.
    searched_px : float
        Largest disparity that is searched; nearer than f B / searched_px there is no depth.
    max_range_m : float
        No depth beyond.
    left_band : bool
        No depth where the right imager's image ends, at the left edge.
    shadow : bool
        No depth where something hides the surface from the right imager.
    hair_holes : float
        Share of hair that gives no depth.
    """

    width_px: int = 848
    height_px: int = 480
    focal_px: float = 424.0
    baseline_m: float = 0.050
    colour_offset_m: float = 0.015
    subpixel_rms_px: float = 0.08
    window_px: int = 7
    edge_px: float = 2.5
    edge_holes: float = 0.35
    disparity_step_px: float = 1 / 32
    depth_units_per_m: float = 1000.0
    searched_px: float = 126.0
    max_range_m: float = 10.0
    left_band: bool = True
    shadow: bool = True
    hair_holes: float = 0.25

    @property
    def focal_baseline(self) -> float:
        """f B, in pixels times metres: disparity is this divided by depth."""
        return self.focal_px * self.baseline_m


D435 = DepthCamera()
"""The mode with the best depth, 848 x 480."""

D435_VGA = DepthCamera(width_px=640, focal_px=384.0)
"""640 x 480."""


def without_errors(settings: DepthCamera) -> DepthCamera:
    """The same camera, all its errors switched off; sampling and alignment stay."""
    return replace(
        settings, subpixel_rms_px=0, edge_px=0, disparity_step_px=0, depth_units_per_m=0, searched_px=0,
        max_range_m=0, left_band=False, shadow=False, hair_holes=0,
    )  # fmt: skip


def simulate_depth(scene: RayScene, colour: PlacedCamera, settings: DepthCamera, rng: Rng) -> np.ndarray:
    """Depth aligned to the colour image.

    Parameters
    ----------
    scene : RayScene
        What is there, such as `Frame.rays` of a rendered frame.
    colour : PlacedCamera
        The colour camera; what lies outside the left imager's view has no depth.
    settings : DepthCamera
    rng : numpy.random.Generator
        Of the noise.

    Returns
    -------
    array, shape (colour.height_px, colour.width_px), dtype float32
        Metres along the camera's z axis, NaN where there is none.

    Examples
    --------
    >>> from hicp_lib.simulation.appearance.materials import plain
    >>> from hicp_lib.simulation.rendering.camera import look_at
    >>> from hicp_lib.simulation.rendering.mesh import quad
    >>> from hicp_lib.simulation.rendering.surfaces import Surface
    >>> wall = Surface(quad([-5, 1, -5], [10, 0, 0], [0, 0, 10]), plain(np.ones(3)))
    >>> camera = PlacedCamera(640, 480, 600.0, 600.0, 319.5, 239.5, look_at([0, 0, 0], [0, 1, 0]))
    >>> depth_m = simulate_depth(RayScene([wall]), camera, D435, np.random.default_rng(0))
    >>> float(np.nanmedian(depth_m).round(2))
    1.0
    """
    left = left_imager(colour, settings)
    first_column, view = _crop(left, colour, settings)
    return align_to_colour(_measure(scene, view, first_column, settings, rng), view, colour)


def simulate_raw_depth(scene: RayScene, colour: PlacedCamera, settings: DepthCamera, rng: Rng) -> np.ndarray:
    """Depth as the left imager sees it, before alignment.

    Parameters
    ----------
    scene : RayScene
    colour : PlacedCamera
    settings : DepthCamera
    rng : numpy.random.Generator

    Returns
    -------
    array, shape (settings.height_px, settings.width_px), dtype float32
        Else as of `simulate_depth`.
    """
    return _measure(scene, left_imager(colour, settings), 0, settings, rng)


def left_imager(colour: PlacedCamera, settings: DepthCamera) -> PlacedCamera:
    """The left imager as a camera: beside the colour camera, to its right."""
    T_colour_left = np.eye(4)
    T_colour_left[0, 3] = settings.colour_offset_m
    centre = (settings.width_px - 1) / 2, (settings.height_px - 1) / 2
    focal = settings.focal_px, settings.focal_px
    pose = colour.T_world_camera @ T_colour_left
    return PlacedCamera(settings.width_px, settings.height_px, *focal, *centre, pose)


def _crop(left: PlacedCamera, colour: PlacedCamera, settings: DepthCamera) -> tuple[int, PlacedCamera]:
    """The part of the left imager's view that alignment and shadows need: its first column, a camera."""
    nearest_m = settings.focal_baseline / (settings.searched_px or settings.width_px)
    reach = colour.width_px - 1 - colour.cx_px
    low_u = left.cx_px - left.fx_px * (colour.cx_px / colour.fx_px + settings.colour_offset_m / nearest_m)
    high_u = left.cx_px + left.fx_px * reach / colour.fx_px + settings.focal_baseline / nearest_m
    low_v = left.cy_px - left.fy_px * colour.cy_px / colour.fy_px
    high_v = left.cy_px + left.fy_px * (colour.height_px - 1 - colour.cy_px) / colour.fy_px
    u0, v0 = max(0, int(low_u) - 4), max(0, int(low_v) - 4)
    u1, v1 = min(left.width_px, int(high_u) + 5), min(left.height_px, int(high_v) + 5)
    cropped = replace(left, width_px=u1 - u0, height_px=v1 - v0, cx_px=left.cx_px - u0, cy_px=left.cy_px - v0)
    return u0, cropped


def _measure(
    scene: RayScene, view: PlacedCamera, first_column: int, settings: DepthCamera, rng: Rng
) -> np.ndarray:
    """What the left imager measures, (view.height_px, view.width_px), float32, NaN for none."""
    true_px, hair = _true_disparity(scene, view, settings.focal_baseline)
    valid = true_px > 0
    measured_px = true_px
    if settings.edge_px:
        measured_px, clear = _edges(true_px, settings, rng)
        valid &= clear
    if settings.subpixel_rms_px:
        noise = correlated_noise(true_px.shape, settings.window_px, rng)
        measured_px = measured_px + np.float32(settings.subpixel_rms_px) * noise
    if settings.disparity_step_px:
        measured_px = np.rint(measured_px / settings.disparity_step_px) * settings.disparity_step_px
    if settings.searched_px:
        valid &= measured_px <= settings.searched_px
    if settings.left_band:
        column = first_column + np.arange(view.width_px, dtype=np.float32)
        valid &= measured_px <= column
    if settings.shadow:
        valid &= ~_hidden_from_right(true_px)
    if settings.hair_holes and hair.any():
        valid &= ~(hair & patches(hair.shape, settings.hair_holes, settings.window_px, rng))
    return _to_depth(measured_px, valid, settings)


def _to_depth(disparity_px: np.ndarray, valid: np.ndarray, settings: DepthCamera) -> np.ndarray:
    valid = valid & (disparity_px > 0)
    depth_m = np.full(disparity_px.shape, np.nan, np.float32)
    np.divide(np.float32(settings.focal_baseline), disparity_px, out=depth_m, where=valid)
    if settings.max_range_m:
        depth_m[depth_m > settings.max_range_m] = np.nan
    if settings.depth_units_per_m:
        units = np.float32(settings.depth_units_per_m)
        depth_m = np.rint(depth_m * units) / units
    return depth_m


def _true_disparity(
    scene: RayScene, view: PlacedCamera, focal_baseline: float
) -> tuple[np.ndarray, np.ndarray]:
    """Disparity (0 where nothing is) and where there is hair, both (height, width).

    Disparity is linear over a plane's image. So every second row and column is cast, and where
    those bend nowhere what lies between is interpolated; all the rest is cast as well.
    """
    shape = (view.height_px, view.width_px)
    directions = image_directions(view)[:, ::2, ::2]
    coarse_shape = directions.shape[1:]
    trace = scene.trace(join_rays(view.centre_m, directions.reshape(3, -1)))
    coarse = (np.float32(focal_baseline) / trace.depth_m).reshape(coarse_shape)
    # OpenCV's resizing puts the samples elsewhere: means of neighbours by hand.
    full = np.empty(shape, np.float32)
    full[::2, ::2] = coarse
    right, below = np.roll(coarse, -1, axis=1), np.roll(coarse, -1, axis=0)
    full[::2, 1::2] = ((coarse + right) / 2)[:, : shape[1] // 2]
    full[1::2, ::2] = ((coarse + below) / 2)[: shape[0] // 2]
    full[1::2, 1::2] = ((right + below) / 2)[: shape[0] // 2, : shape[1] // 2]
    unknown = doubled(_bent(coarse), shape)
    unknown[::2, ::2] = False
    rows, columns = np.nonzero(unknown)
    rays = pixel_rays(view, np.stack([columns, rows], axis=1))
    full[rows, columns] = focal_baseline / scene.trace(rays).depth_m
    is_hair = np.array([s.parts is not None and np.isin(s.parts, _HAIR_PARTS).all() for s in scene.surfaces])
    hair = np.append(is_hair, False)[trace.surface].reshape(coarse_shape)
    return full, doubled(hair, shape)


def _bent(coarse_px: np.ndarray) -> np.ndarray:
    """Where disparity is not linear, or the image ends."""
    bent = np.ones(coarse_px.shape, np.uint8)
    inner = coarse_px[1:-1, 1:-1]
    across = np.abs(coarse_px[1:-1, :-2] + coarse_px[1:-1, 2:] - 2 * inner)
    down = np.abs(coarse_px[:-2, 1:-1] + coarse_px[2:, 1:-1] - 2 * inner)
    bent[1:-1, 1:-1] = np.maximum(across, down) > _CURVED_PX
    return cv2.dilate(bent, np.ones((3, 3), np.uint8)).astype(bool)


def _edges(true_px: np.ndarray, settings: DepthCamera, rng: Rng) -> tuple[np.ndarray, np.ndarray]:
    """Disparity as windows that reach over depth steps find it, and where they find any.

    A window takes the disparity of the surface that fills most of it; about half and half, one
    in between. Texture decides as well, so outlines are ragged.
    """
    box = np.ones((settings.window_px, settings.window_px), np.uint8)
    small = np.ones((3, 3), np.uint8)
    step = cv2.dilate(true_px, small) - cv2.erode(true_px, small) > _STEP_PX
    rows, columns = np.nonzero(cv2.dilate(step.astype(np.uint8), box))
    low, high = (f(true_px, box)[rows, columns] for f in (cv2.erode, cv2.dilate))
    mean = cv2.blur(true_px, (settings.window_px, settings.window_px))[rows, columns]
    jitter = correlated_noise(true_px.shape, settings.window_px, rng)[rows, columns]
    share = (mean - low) / np.maximum(high - low, 1e-6) - 0.5 + _EDGE_GROWTH + _EDGE_JITTER * jitter
    share = np.clip(0.5 + share * (settings.window_px / settings.edge_px), 0, 1)
    measured, clear = true_px.copy(), np.ones(true_px.shape, bool)
    measured[rows, columns] = low + share * (high - low)
    between = (share > 0) & (share < 1)
    holes = patches(true_px.shape, settings.edge_holes, settings.window_px, rng)
    clear[rows[between], columns[between]] = ~holes[rows[between], columns[between]]
    return measured, clear


def _hidden_from_right(true_px: np.ndarray) -> np.ndarray:
    """Whether something nearer falls on the same pixel of the right imager, (height, width)."""
    height, width = true_px.shape
    margin = int(np.ceil(true_px.max(initial=0))) + 2
    column = np.arange(width, dtype=np.float32) - true_px + margin
    start = np.arange(height)[:, None] * (width + margin + 2)
    nearest = np.zeros(height * (width + margin + 2), np.float32)
    at = column.astype(np.int32) + start
    # On both pixels it lies between: surfaces that turn to the right imager have no gaps there.
    for offset in (0, 1):
        np.maximum.at(nearest, (at + offset).ravel(), true_px.ravel())
    return nearest[np.rint(column).astype(np.int32) + start] > true_px + _STEP_PX

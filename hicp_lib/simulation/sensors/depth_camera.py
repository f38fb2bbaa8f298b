"""A depth camera beside the colour camera: its depth, aligned to the colour image.

Depth is measured in an imager's own view and has the errors of its kind (`stereo_camera`, `time_of_flight`).
Then it is aligned to the colour camera. Both look the same way.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from hicp_lib.simulation.appearance.people import RIGHT
from hicp_lib.simulation.body.model import REGIONS
from hicp_lib.simulation.rendering.camera import PlacedCamera, image_directions, join_rays, pixel_rays
from hicp_lib.simulation.rendering.raycast import RayScene, between, doubled
from hicp_lib.simulation.sensors.depth_alignment import align_to_colour

Rng = np.random.Generator

_CURVED_PX = 0.08  # disparities whose second difference is larger are not interpolated
_HAIR_PARTS = (REGIONS.index("scalp"), REGIONS.index("scalp") + RIGHT)


@dataclass(frozen=True, kw_only=True)
class DepthCamera:
    """Geometry of a depth camera, and common settings; zero switches an error off.

    Attributes
    ----------
    width_px, height_px : int
        Of the imager; its principal point is the middle.
    focal_px : float
        Of the imager.
    baseline_m : float
        Baseline; f B is the disparity times depth.
    colour_offset_m : float
        From the colour camera to the imager, to the right.
    nearest_m, max_range_m : float
        No depth nearer, and beyond.
    depth_units_per_m : float
        Resolution of depth.
    """

    width_px: int
    height_px: int
    focal_px: float
    baseline_m: float
    colour_offset_m: float
    nearest_m: float
    max_range_m: float
    depth_units_per_m: float = 1000.0

    @property
    def focal_baseline(self) -> float:
        """f B, in pixels times metres: disparity is this divided by depth."""
        return self.focal_px * self.baseline_m

    def measure(self, true_px: np.ndarray, hair: np.ndarray, first_column: int, rng: Rng) -> np.ndarray:
        """What the imager measures.

        Parameters
        ----------
        true_px : array, shape (h, w), dtype float32
            True disparity in a part of its view; 0 where nothing is.
        hair : array of bool, shape (h, w)
        first_column : int
            Where that part begins.
        rng : numpy.random.Generator

        Returns
        -------
        array, shape (h, w), dtype float32
            Depth in metres; NaN for none.
        """
        raise NotImplementedError


def simulate_depth(scene: RayScene, colour: PlacedCamera, settings: DepthCamera, rng: Rng) -> np.ndarray:
    """Depth aligned to the colour image.

    Parameters
    ----------
    scene : RayScene
        The scene, such as `Frame.rays` of a rendered frame.
    colour : PlacedCamera
        The colour camera; what lies outside the imager's view has no depth.
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
    >>> from hicp_lib.simulation.sensors.stereo_camera import D435
    >>> wall = Surface(quad([-5, 1, -5], [10, 0, 0], [0, 0, 10]), plain(np.ones(3)))
    >>> camera = PlacedCamera(640, 480, 600.0, 600.0, 319.5, 239.5, look_at([0, 0, 0], [0, 1, 0]))
    >>> depth_m = simulate_depth(RayScene([wall]), camera, D435, np.random.default_rng(0))
    >>> float(np.nanmedian(depth_m).round(2))
    1.0
    """
    imager = depth_imager(colour, settings)
    first_column, view = _crop(imager, colour, settings)
    return align_to_colour(_measure(scene, view, first_column, settings, rng), view, colour)


def depth_imager(colour: PlacedCamera, settings: DepthCamera) -> PlacedCamera:
    """The imager as a camera: beside the colour camera."""
    T_colour_imager = np.eye(4)
    T_colour_imager[0, 3] = settings.colour_offset_m
    centre = (settings.width_px - 1) / 2, (settings.height_px - 1) / 2
    focal = settings.focal_px, settings.focal_px
    pose = colour.T_world_camera @ T_colour_imager
    return PlacedCamera(settings.width_px, settings.height_px, *focal, *centre, pose)


def _crop(imager: PlacedCamera, colour: PlacedCamera, settings: DepthCamera) -> tuple[int, PlacedCamera]:
    """The part of the imager's view that alignment and shadows need: its first column, a camera."""
    nearest_m = settings.nearest_m or settings.focal_baseline / settings.width_px
    offset_m = abs(settings.colour_offset_m)
    reach = colour.width_px - 1 - colour.cx_px
    low_u = imager.cx_px - imager.fx_px * (colour.cx_px / colour.fx_px + offset_m / nearest_m)
    high_u = imager.cx_px + imager.fx_px * reach / colour.fx_px + settings.focal_baseline / nearest_m
    low_v = imager.cy_px - imager.fy_px * colour.cy_px / colour.fy_px
    high_v = imager.cy_px + imager.fy_px * (colour.height_px - 1 - colour.cy_px) / colour.fy_px
    u0, v0 = max(0, int(low_u) - 4), max(0, int(low_v) - 4)
    u1, v1 = min(imager.width_px, int(high_u) + 5), min(imager.height_px, int(high_v) + 5)
    cx_px, cy_px = imager.cx_px - u0, imager.cy_px - v0
    return u0, replace(imager, width_px=u1 - u0, height_px=v1 - v0, cx_px=cx_px, cy_px=cy_px)


def _measure(
    scene: RayScene, view: PlacedCamera, first_column: int, settings: DepthCamera, rng: Rng
) -> np.ndarray:
    """What the imager measures, (view.height_px, view.width_px), float32, NaN for none."""
    true_px, hair = _true_disparity(scene, view, settings.focal_baseline)
    depth_m = settings.measure(true_px, hair, first_column, rng)
    depth_m[(depth_m < settings.nearest_m) | (depth_m > (settings.max_range_m or np.inf))] = np.nan
    if settings.depth_units_per_m:
        units = np.float32(settings.depth_units_per_m)
        depth_m = np.rint(depth_m * units) / units
    return depth_m


def _true_disparity(
    scene: RayScene, view: PlacedCamera, focal_baseline: float
) -> tuple[np.ndarray, np.ndarray]:
    """Disparity (0 where nothing is) and where there is hair, both (height, width).

    Disparity is linear over a plane's image. So every second row and column is cast, and where those are
    linear, values between are interpolated; all other rays are cast as well.
    """
    shape = (view.height_px, view.width_px)
    directions = image_directions(view)[:, ::2, ::2]
    coarse_shape = directions.shape[1:]
    trace = scene.trace(join_rays(view.centre_m, directions.reshape(3, -1)))
    coarse = (np.float32(focal_baseline) / trace.depth_m).reshape(coarse_shape)
    full = between(coarse, shape)
    unknown = doubled(_bent(coarse), shape)
    unknown[::2, ::2] = 0
    rows, columns = np.nonzero(unknown)
    rays = pixel_rays(view, np.stack([columns, rows], axis=1))
    full[rows, columns] = focal_baseline / scene.trace(rays).depth_m
    is_hair = np.array([s.parts is not None and np.isin(s.parts, _HAIR_PARTS).all() for s in scene.surfaces])
    hair = np.append(is_hair, False)[trace.surface].reshape(coarse_shape)
    return full, doubled(hair.view(np.uint8), shape).view(bool)


def _bent(coarse_px: np.ndarray) -> np.ndarray:
    """Where disparity is not linear, or the image ends; 0 or 1."""
    bent = np.ones(coarse_px.shape, np.uint8)
    inner = coarse_px[1:-1, 1:-1]
    across = np.abs(coarse_px[1:-1, :-2] + coarse_px[1:-1, 2:] - 2 * inner)
    down = np.abs(coarse_px[:-2, 1:-1] + coarse_px[2:, 1:-1] - 2 * inner)
    bent[1:-1, 1:-1] = np.maximum(across, down) > _CURVED_PX
    return cv2.dilate(bent, np.ones((3, 3), np.uint8))

"""Depth cameras without errors, and before alignment."""

from dataclasses import replace

import numpy as np

from hicp_lib.simulation.rendering.camera import PlacedCamera
from hicp_lib.simulation.rendering.raycast import RayScene
from hicp_lib.simulation.sensors.depth_camera import DepthCamera, _measure, depth_imager
from hicp_lib.simulation.sensors.stereo_camera import StereoCamera


def simulate_raw_depth(
    scene: RayScene, colour: PlacedCamera, settings: DepthCamera, rng: np.random.Generator
) -> np.ndarray:
    """Depth as the imager sees it; else as of `simulate_depth`."""
    return _measure(scene, depth_imager(colour, settings), 0, settings, rng)


def without_errors(settings: StereoCamera) -> StereoCamera:
    """The same camera, all its errors switched off; sampling and alignment stay."""
    return replace(
        settings, subpixel_rms_px=0, edge_px=0, disparity_step_px=0, depth_units_per_m=0, nearest_m=0,
        max_range_m=0, left_band=False, shadow=False, hair_holes=0,
    )  # fmt: skip

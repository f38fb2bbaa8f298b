"""What the depth camera's model costs beside the render it is simulated for.

Frames are scenes as `hicp scenes render` makes them, at 640 x 480, one after the other in one
process. Two baselines in the same run: the bare render of the frame (no scene staged, no image
developed), and the bare ray casting of the left imager's whole view, one ray per pixel, which alone
is what a model without any error would cost. Processor time, since it tells more than wall time on a
machine that is busy otherwise; every depth image is measured some times and the least counts.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from timing import Comparison, best_seconds, run

from hicp_lib.simulation.rendering.camera import pixel_rays
from hicp_lib.simulation.rendering.render import render
from hicp_lib.simulation.sensors.depth_camera import depth_imager, simulate_depth
from hicp_lib.simulation.sensors.stereo_camera import D435
from hicp_lib.simulation.world.staging import random_stage

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.simulation.sensors.bare_depth import simulate_raw_depth, without_errors  # noqa: E402

SEED = 20220


def frame_cost(index: int, turns: int) -> list[float]:
    """Processor seconds of one frame's render, bare ray casting, and the depth camera in several forms."""
    rng = np.random.default_rng(np.random.SeedSequence([SEED, index]))
    stage = random_stage(rng)
    start = time.process_time()
    frame = render(stage.world, stage.camera)
    rendered_s = time.process_time() - start
    scene, camera = frame.rays, stage.camera
    rays = pixel_rays(depth_imager(camera, D435))
    return [rendered_s] + best_seconds(
        lambda: scene.trace(rays),
        lambda: simulate_depth(scene, camera, D435, rng),
        lambda: simulate_depth(scene, camera, without_errors(D435), rng),
        lambda: simulate_raw_depth(scene, camera, D435, rng),
        turns=turns,
    )


def measure(options) -> Iterator[Comparison]:
    cv2.setNumThreads(1)
    frame_cost(1000, 1)  # textures and patterns of clothes are made once
    costs_s = [frame_cost(index, options.turns) for index in range(options.frames)]
    render_s, rays_s, aligned_s, exact_s, whole_s = np.mean(costs_s, axis=0).tolist()
    rays = "one ray for each pixel of the left imager"
    yield Comparison("aligned depth image", aligned_s, "bare render of the frame", render_s)
    yield Comparison("aligned depth image", aligned_s, rays, rays_s)
    yield Comparison("aligned depth image without errors", exact_s, rays, rays_s)
    yield Comparison("whole image of the left imager", whole_s, rays, rays_s)


if __name__ == "__main__":
    run(measure, __doc__, frames=(12, 1), turns=(3, 1))

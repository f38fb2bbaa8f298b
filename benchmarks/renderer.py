"""How many frames a second the scene renderer makes at 640 x 480.

Whole scenes as `hicp scenes render` makes them: people drawn and dressed, a furnished room,
colour, depth, segments, the visibility of all keypoints, and the finished 8-bit image; without
writing files. The baseline, in the same run, is what no renderer on Open3D can go below: the bare
`RaycastingScene` call for one ray per pixel at the same scenes. The project's floor is 8 frames a
second on two processors. Processor time is given too: it tells more than wall time on a machine
that is busy otherwise.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
import open3d as o3d
from timing import Comparison, run

from hicp_lib.core.executor import Processes
from hicp_lib.simulation.rendering.camera import pixel_rays
from hicp_lib.simulation.rendering.colour_sensor import expose
from hicp_lib.simulation.rendering.render import render
from hicp_lib.simulation.world.scenes import annotate, render_scene
from hicp_lib.simulation.world.staging import random_stage

SEED = 20220
FLOOR_FRAMES_PER_S = 8  # on two processors


def frame_steps(index: int) -> dict[str, float]:
    """Processor seconds of the steps of one frame, and of the bare ray casting."""
    rng = np.random.default_rng(np.random.SeedSequence([SEED, index]))
    clock = [time.process_time()]
    stage = random_stage(rng)
    clock.append(time.process_time())
    frame = render(stage.world, stage.camera, rng)
    clock.append(time.process_time())
    annotate(stage, frame)
    expose(frame.radiance, stage.sensor, rng, frame.person >= 0)
    clock.append(time.process_time())
    rays = o3d.core.Tensor(pixel_rays(stage.camera))
    frame.rays._scene.cast_rays(rays, nthreads=1)
    clock.append(time.process_time())
    return dict(zip(("scene", "render", "develop", "bare_rays"), np.diff(clock).tolist(), strict=True))


def _whole(index: int) -> float:
    start = time.process_time()
    render_scene(SEED, index)
    return time.process_time() - start


def measure(options) -> Iterator[Comparison]:
    with Processes(options.workers) as pool:
        # Workers keep the textures and patterns of clothes they have made.
        list(pool.map(_whole, range(1000, 1000 + options.first * options.workers)))
        start = time.perf_counter()
        cpu_s = list(pool.map(_whole, range(options.frames)))
        wall_s = (time.perf_counter() - start) / options.frames
        steps = list(pool.map(frame_steps, range(options.frames)))
    means_s = {name: float(np.mean([step[name] for step in steps])) for name in steps[0]}
    rays, rays_s = "bare ray casting, one ray a pixel", means_s.pop("bare_rays")
    what = f"a frame, processes: {options.workers}, wall time"
    yield Comparison(what, wall_s, rays, rays_s, most_s=1 / FLOOR_FRAMES_PER_S)
    yield Comparison("a frame", float(np.mean(cpu_s)), rays, rays_s)
    for name, step_s in means_s.items():
        yield Comparison(f"its {name}", step_s, rays, rays_s)


if __name__ == "__main__":
    run(measure, __doc__, frames=(40, 1), workers=(2, 1), first=(12, 1))

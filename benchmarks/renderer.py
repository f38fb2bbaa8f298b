"""How many frames a second the scene renderer makes at 640 x 480.

Whole scenes as `hicp scenes render` makes them: people drawn and dressed, a furnished room,
colour, depth, segments, the visibility of all keypoints, and the finished 8-bit image; without
writing files. The baseline, in the same run, is what no renderer on Open3D can go below: the bare
`RaycastingScene` call for one ray per pixel at the same scenes. The project's floors are 10 frames a
second on two processors, and 3.2 times that call's processor time, which tells more than wall time on a
machine that is busy otherwise. What limits both: every frame has new people, so the tree that rays search is
built anew; people are dressed anew; and rays for people's pixels, shadows and edges cannot be left out.
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
from hicp_lib.simulation.rendering.raycast import RayScene
from hicp_lib.simulation.rendering.render import render
from hicp_lib.simulation.world.scenes import annotate, render_scene
from hicp_lib.simulation.world.staging import random_stage

SEED = 20220
FLOOR_FRAMES_PER_S, MOST_OF_BARE_RAYS = 10, 3.2  # on two processors; in processor time


def frame_steps(index: int) -> dict[str, float]:
    """Processor seconds of a frame's steps (the ray tree is part of the render), and of bare ray casting."""
    rng = np.random.default_rng(np.random.SeedSequence([SEED, index]))
    clock = [time.process_time()]
    stage = random_stage(rng)
    clock.append(time.process_time())
    frame = render(stage.world, stage.camera)
    clock.append(time.process_time())
    annotate(stage, frame)
    expose(frame.radiance, stage.sensor, rng, frame.person >= 0)
    clock.append(time.process_time())
    rays = pixel_rays(stage.camera)
    RayScene(stage.world.surfaces).trace(rays[:1])
    clock.append(time.process_time())
    frame.rays._scene.cast_rays(o3d.core.Tensor(rays), nthreads=1)
    clock.append(time.process_time())
    return dict(
        zip(("scene", "render", "develop", "ray tree", "bare_rays"), np.diff(clock).tolist(), strict=True)
    )


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
    yield Comparison("a frame", float(np.mean(cpu_s)), rays, rays_s, most=MOST_OF_BARE_RAYS)
    for name, step_s in means_s.items():
        yield Comparison(f"its {name}", step_s, rays, rays_s)


if __name__ == "__main__":
    run(measure, __doc__, frames=(40, 1), workers=(2, 1), first=(12, 1))

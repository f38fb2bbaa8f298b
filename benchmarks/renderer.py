"""How many frames a second the scene renderer makes at 640 x 480.

    python benchmarks/renderer.py [--frames 40] [--workers 2] [--json OUT]

Whole scenes as `hicp scenes render` makes them: people drawn and dressed, a furnished room,
colour, depth, segments, the visibility of all keypoints, and the finished 8-bit image; without
writing files. The baseline, in the same run, is what no renderer on Open3D can go below: the bare
`RaycastingScene` call for one ray per pixel at the same scenes. The project's floor is 8 frames a
second on two processors. Processor time is given too: it tells more than wall time on a machine
that is busy otherwise.
"""

from __future__ import annotations

import argparse
import json
import time

import numpy as np
import open3d as o3d

from hicp_lib.simulation.rendering.camera import pixel_rays
from hicp_lib.simulation.rendering.colour_sensor import expose
from hicp_lib.simulation.rendering.render import render
from hicp_lib.simulation.world.scenes import annotate, render_scene, worker_pool
from hicp_lib.simulation.world.staging import random_stage

SEED = 20220


def measure(index: int) -> dict[str, float]:
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--json")
    options = parser.parse_args()
    with worker_pool(options.workers) as pool:
        # Workers keep the textures and patterns of clothes they have made.
        pool.map(_whole, range(1000, 1000 + 12 * options.workers), chunksize=1)
        start = time.perf_counter()
        cpu_s = pool.map(_whole, range(options.frames), chunksize=1)
        wall_s = time.perf_counter() - start
        steps = pool.map(measure, range(options.frames), chunksize=1)
    means = {name: float(np.mean([step[name] for step in steps])) for name in steps[0]}
    result = {
        "frames": options.frames,
        "workers": options.workers,
        "frames_per_second": options.frames / wall_s,
        "cpu_s_per_frame": float(np.mean(cpu_s)),
        "cpu_s_by_step": means,
        "ratio_to_bare_rays": float(np.mean(cpu_s)) / means["bare_rays"],
    }
    print(f"{result['frames_per_second']:.2f} frames/s with {options.workers} workers; floor 8 with 2")
    print(f"{result['cpu_s_per_frame'] * 1e3:.0f} ms of processor time per frame:")
    for name, value in means.items():
        print(f"  {name:10} {value * 1e3:6.1f} ms")
    print(f"{result['ratio_to_bare_rays']:.1f} times the baseline: the bare ray casting, one ray per pixel")
    if options.json:
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump(result, file, indent=2)


if __name__ == "__main__":
    main()

"""What the depth camera's model costs beside the render it is simulated for.

    python benchmarks/depth_camera.py [--frames 12] [--json OUT]

Frames are scenes as `hicp scenes render` makes them, at 640 x 480, one after the other in one
process. Two baselines in the same run: the bare render of the frame (no scene staged, no image
developed), and the bare ray casting of the left imager's whole view, one ray per pixel, which alone
is what a model without any error would cost. Processor time, since it tells more than wall time on a
machine that is busy otherwise; every depth image is measured three times and the least counts.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable

import cv2
import numpy as np

from hicp_lib.simulation.rendering.camera import pixel_rays
from hicp_lib.simulation.rendering.render import render
from hicp_lib.simulation.sensors.depth_camera import (
    D435,
    left_imager,
    simulate_depth,
    simulate_raw_depth,
    without_errors,
)
from hicp_lib.simulation.world.staging import random_stage

SEED = 20220
REPEATS = 3


def measure(index: int) -> dict[str, float]:
    """Processor seconds of one frame: render, ray casting, and the depth camera in several forms."""
    rng = np.random.default_rng(np.random.SeedSequence([SEED, index]))
    stage = random_stage(rng)
    start = time.process_time()
    frame = render(stage.world, stage.camera, rng)
    rendered_s = time.process_time() - start
    scene, camera = frame.rays, stage.camera
    rays = pixel_rays(left_imager(camera, D435))
    return {
        "render": rendered_s,
        "bare_rays": least_s(lambda: scene.trace(rays)),
        "aligned": least_s(lambda: simulate_depth(scene, camera, D435, rng)),
        "aligned_without_errors": least_s(lambda: simulate_depth(scene, camera, without_errors(D435), rng)),
        "whole_left_image": least_s(lambda: simulate_raw_depth(scene, camera, D435, rng)),
    }


def least_s(run: Callable[[], object]) -> float:
    """The least processor time of a few runs."""
    times_s = []
    for _ in range(REPEATS):
        start = time.process_time()
        run()
        times_s.append(time.process_time() - start)
    return min(times_s)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--json")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    measure(1000)  # textures and patterns of clothes are made once
    steps = [measure(index) for index in range(options.frames)]
    means = {name: float(np.mean([step[name] for step in steps])) for name in steps[0]}
    result = {
        "frames": options.frames,
        "cpu_s": means,
        "ratio_to_render": means["aligned"] / means["render"],
        "ratio_to_bare_rays": means["aligned"] / means["bare_rays"],
    }
    for name, value in means.items():
        print(f"{name:24} {value * 1e3:6.1f} ms")
    print(f"the aligned depth image costs {result['ratio_to_render']:.2f} of the baseline, the bare render,")
    print(f"and {result['ratio_to_bare_rays']:.2f} of casting one ray for each pixel of the left imager")
    if options.json:
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump(result, file, indent=2)


if __name__ == "__main__":
    main()

"""What one cycle from image to joint velocities costs, stage by stage.

    python benchmarks/avoidance.py [--detector mediapipe] [--frames 8] [--cycles 200] [--json OUT]

Rendered people in front of the robot's camera (colour, and depth by the sensor's model) go through the
detector, the lifting, the tracking, the skin's activation and the controller. Without the detector's
weights that stage is left out, and keypoints are the true ones. Two baselines in the same run: activations
one keypoint at a time in plain numpy (double precision), and the controller's period of 20 ms. The
project's floors: activation and controller 2 ms together, the whole cycle 50 ms (median) and 80 ms (95th
percentile) on two cores. Wall time, and processor time of the calling thread (a detector's own threads are
not in it), which tells more on a machine that is busy otherwise.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from hicp_lib.core.camera import Camera, transform
from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.detectors.registry import make_detector
from hicp_lib.lifting.paper import lift
from hicp_lib.robot.controller import Controller
from hicp_lib.robot.home import HOME_M, home_posture
from hicp_lib.robot.kinematics import load_icub
from hicp_lib.robot.loop import AvoidanceLoop, Perception
from hicp_lib.robot.peripersonal_space import ReceptiveField, gains, response
from hicp_lib.simulation.rendering.camera import project_world
from hicp_lib.simulation.rendering.colour_sensor import expose
from hicp_lib.simulation.rendering.render import render
from hicp_lib.simulation.sensors.depth_camera import D435, simulate_depth
from hicp_lib.simulation.world.staging import random_stage

SEED = 20220
PERIOD_S = 0.02
N_SKIN = 300  # taxels of the benchmark of activations, more than the robot's


class Clock:
    """Collects wall and processor times of stages by their name."""

    def __init__(self) -> None:
        self.times_s: dict[str, list[tuple[float, float]]] = {}

    def measure(self, stage: str, work: Callable, *arguments):
        wall, cpu = time.perf_counter(), time.thread_time()
        result = work(*arguments)
        passed = (time.perf_counter() - wall, time.thread_time() - cpu)
        self.times_s.setdefault(stage, []).append(passed)
        return result

    def summary(self) -> dict[str, dict[str, float]]:
        """Milliseconds by stage: median and 95th percentile of wall time, median of processor time."""
        return {
            stage: {
                "median_ms": 1e3 * float(np.median([wall for wall, _ in times])),
                "p95_ms": 1e3 * float(np.percentile([wall for wall, _ in times], 95)),
                "cpu_median_ms": 1e3 * float(np.median([cpu for _, cpu in times])),
            }
            for stage, times in self.times_s.items()
        }


def make_frames(n: int) -> list[tuple[np.ndarray, np.ndarray, Camera, Detections]]:
    """Colour image, depth, camera and true keypoints of rendered scenes."""
    frames = []
    for index in range(n):
        rng = np.random.default_rng(np.random.SeedSequence([SEED, index]))
        stage = random_stage(rng)
        camera, frame = stage.camera, render(stage.world, stage.camera, rng)
        image = expose(frame.radiance, stage.sensor, rng, frame.person >= 0)
        depth = simulate_depth(frame.rays, camera, D435, rng)
        pixels = np.stack([project_world(camera, person.keypoints_m)[0] for person in stage.people])
        true = Detections(pixels, np.ones(pixels.shape[:2]), np.ones(len(pixels)))
        intrinsics = Camera(
            camera.width_px, camera.height_px, camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px
        )
        frames.append((image, depth, intrinsics, true))
    return frames


def run_cycles(detector, frames: list, n_cycles: int) -> Clock:
    """The loop of `hicp_lib.robot.loop`, taken apart; frames come again and again."""
    icub, clock = load_icub(), Clock()
    home = posture = home_posture(icub)
    loop = AvoidanceLoop(Controller(icub, np.array(HOME_M["left"]), home.angles("left")))
    for k in range(n_cycles):
        image, depth, intrinsics, true = frames[k // 4 % len(frames)]
        found = clock.measure("detector", detector.detect, image) if detector else true
        lifted = clock.measure("lifting", lift, found.keypoints_px, depth, intrinsics)
        T = clock.measure("camera pose", icub.T_root_camera, posture.angles("head"))
        points = transform(T, lifted.points_m)
        seen = Perception(k * PERIOD_S, points, found.scores)
        clock.measure("tracking", loop.tracker.see, seen.time_s, points, seen.scores, k * PERIOD_S)
        threat = clock.measure("activation", loop.threat, k * PERIOD_S, posture)
        velocities = clock.measure("controller", loop.controller.velocities, posture, threat.obstacles)
        posture = posture.moved("left", posture.angles("left") + PERIOD_S * velocities)
    return clock


def near_cycles(n_cycles: int, n_people: int) -> Clock:
    """Activation and controller with people all about the robot's arm: every keypoint counts."""
    icub, clock, rng = load_icub(), Clock(), np.random.default_rng(SEED)
    home = posture = home_posture(icub)
    loop = AvoidanceLoop(Controller(icub, np.array(HOME_M["left"]), home.angles("left")))
    points = rng.uniform(-0.15, 0.15, (n_people, 136, 3)) + HOME_M["left"]
    for k in range(n_cycles):
        seen = Perception(k * PERIOD_S, points, np.ones(points.shape[:2]))
        command, _ = clock.measure("cycle", loop.cycle, k * PERIOD_S, posture, seen)
        posture = posture.moved("left", posture.angles("left") + PERIOD_S * command.velocities_rad_s)
    return clock


def one_keypoint_at_a_time(field: ReceptiveField, positions, normals, points, factors) -> np.ndarray:
    """The baseline: activations as one would first write them."""
    highest = np.zeros(len(positions))
    for point, factor in zip(points, factors, strict=True):
        way = point - positions
        height, square = (way * normals).sum(axis=1), (way * way).sum(axis=1)
        cone = field.skin_radius_m + np.tan(field.half_angle_rad) * np.abs(height)
        activation = factor * response(np.copysign(np.sqrt(square), height) - field.point_radius_m)
        highest = np.maximum(highest, np.where(square - height**2 <= cone**2, activation, 0))
    return highest


def compare_activations(n_people: int, repeats: int = 20) -> dict[str, float]:
    """Activations of `N_SKIN` taxels by everyone's keypoints, ours and the baseline's; the best times."""
    rng, field, clock = np.random.default_rng(SEED), ReceptiveField(), Clock()
    positions, normals = rng.uniform(-0.2, 0.2, (N_SKIN, 3)), rng.normal(size=(N_SKIN, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points, factors = rng.uniform(-0.4, 0.4, (136 * n_people, 3)), gains(np.ones(136 * n_people))
    for _ in range(repeats):
        ours = clock.measure("ours", field.activations, positions, normals, points, factors)
        plain = clock.measure("plain", one_keypoint_at_a_time, field, positions, normals, points, factors)
    if np.mean(np.abs(ours - plain) < 5e-3) < 0.99:
        raise SystemExit("activations differ from the baseline's")
    best = {name: 1e3 * min(cpu for _, cpu in times) for name, times in clock.times_s.items()}
    return {
        "people": n_people,
        **{f"{name}_ms": ms for name, ms in best.items()},
        "ratio": best["plain"] / best["ours"],
    }


def detector_or_none(name: str):
    try:
        return make_detector(name, **({"side_by_side": True} if name == "mediapipe" else {}))
    except InputError as error:
        print(f"without the detector: {error}")
        return None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--detector", default="mediapipe")
    parser.add_argument("--frames", type=int, default=8)
    parser.add_argument("--cycles", type=int, default=200)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    detector = detector_or_none(arguments.detector)
    clock = run_cycles(detector, make_frames(arguments.frames), arguments.cycles)
    whole = np.sum([times for times in clock.times_s.values()], axis=0)
    clock.times_s["whole cycle"] = [tuple(row) for row in whole]
    result = {
        "detector": arguments.detector if detector else None,
        "cycles": arguments.cycles,
        "stages": clock.summary(),
        "everyone_near": {n: near_cycles(arguments.cycles, n).summary()["cycle"] for n in (1, 2, 5)},
        "activations": [compare_activations(n) for n in (1, 3)],
    }
    report(result)
    if arguments.json:
        arguments.json.write_text(json.dumps(result, indent=1))


def report(result: dict) -> None:
    """Print what was measured."""
    print(f"{'stage':14}{'median':>10}{'95th':>10}{'processor':>11}{'of 20 ms':>10}")
    for stage, times in result["stages"].items():
        share = times["cpu_median_ms"] / (1e3 * PERIOD_S)
        print(
            f"{stage:14}{times['median_ms']:8.2f}ms{times['p95_ms']:8.2f}ms"
            f"{times['cpu_median_ms']:9.2f}ms{share:10.2f}"
        )
    for people, times in result["everyone_near"].items():
        print(
            f"all but detector and lifting, {people} people about the arm: {times['median_ms']:.2f} ms, "
            f"processor {times['cpu_median_ms']:.2f} ms"
        )
    for row in result["activations"]:
        print(
            f"{N_SKIN} taxels, {row['people']} people: {row['ours_ms']:.2f} ms, one keypoint at a time "
            f"{row['plain_ms']:.1f} ms: {row['ratio']:.0f} times faster"
        )


if __name__ == "__main__":
    main()

"""What one cycle from image to joint velocities costs, stage by stage.

Rendered people in front of the robot's camera (colour, and depth by the sensor's model) go through the
detector, the lifting, the tracking, the skin's activation and the controller; once with the true keypoints,
then with a detector's. Two baselines: activations one keypoint at a time in plain numpy (double precision),
and the controller's period of 20 ms. The project's floors: activation and controller 2 ms together, from
perception to command 33 ms (median) with the fast pair of detectors on two cores, by either way of lifting;
the 99th percentile is told beside it. Processor time of the calling thread, which tells more on a machine
that is busy otherwise; wall time where a detector's own threads work, too.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
from timing import Comparison, run

from hicp_lib.core.camera import Camera, transform
from hicp_lib.core.detections import Detections
from hicp_lib.detectors.registry import make_detector
from hicp_lib.lifting.robust import METHODS, lift_robust
from hicp_lib.robot.controller import Controller
from hicp_lib.robot.home import HOME_M, home_posture
from hicp_lib.robot.kinematics import load_icub
from hicp_lib.robot.loop import AvoidanceLoop, Perception
from hicp_lib.robot.peripersonal_space import ReceptiveField, response
from hicp_lib.simulation.rendering.camera import project_world
from hicp_lib.simulation.rendering.colour_sensor import expose
from hicp_lib.simulation.rendering.render import render
from hicp_lib.simulation.sensors.depth_camera import simulate_depth
from hicp_lib.simulation.sensors.stereo_camera import D435
from hicp_lib.simulation.world.staging import random_stage

SEED = 20220
PERIOD, PERIOD_S = "the period of the controller", 0.02
FAST = "combined:movenet-lightning+mediapipe-hands"
FAST_OPTIONS = {"looks": "image", "side_by_side": True, "hands_tracking_hz": 30.0, "hands_num_hands": 2}
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

    def median_s(self, stage: str) -> float:
        """Of the processor time."""
        return float(np.median([cpu for _, cpu in self.times_s[stage]]))


def make_frames(n: int) -> list[tuple[np.ndarray, np.ndarray, Camera, Detections]]:
    """Colour image, depth, camera and true keypoints of rendered scenes."""
    frames = []
    for index in range(n):
        rng = np.random.default_rng(np.random.SeedSequence([SEED, index]))
        stage = random_stage(rng)
        camera, frame = stage.camera, render(stage.world, stage.camera)
        image = expose(frame.radiance, stage.sensor, rng, frame.person >= 0)
        depth = simulate_depth(frame.rays, camera, D435, rng)
        pixels = np.stack([project_world(camera, person.keypoints_m)[0] for person in stage.people])
        true = Detections(pixels, np.ones(pixels.shape[:2]), np.ones(len(pixels)))
        intrinsics = Camera(
            camera.width_px, camera.height_px, camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px
        )
        frames.append((image, depth, intrinsics, true))
    return frames


def run_cycles(detector, frames: list, n_cycles: int, method: str = "robust") -> Clock:
    """The loop of `hicp_lib.robot.loop`, taken apart; frames come again and again."""
    icub, clock = load_icub(), Clock()
    home = posture = home_posture(icub)
    loop = AvoidanceLoop(Controller(icub, np.array(HOME_M["left"]), home.angles("left")))
    for k in range(n_cycles):
        image, depth, intrinsics, true = frames[k // 4 % len(frames)]
        found = clock.measure("detector", detector.detect, image) if detector else true
        arguments = found.keypoints_px, depth, intrinsics, METHODS[method]
        lifted = clock.measure("lifting", lift_robust, *arguments)
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


def compare_activations(n_people: int, repeats: int) -> Comparison:
    """Activations of `N_SKIN` taxels by everyone's keypoints, ours and the baseline's; the best times."""
    rng, field, clock = np.random.default_rng(SEED), ReceptiveField(), Clock()
    positions, normals = rng.uniform(-0.2, 0.2, (N_SKIN, 3)), rng.normal(size=(N_SKIN, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points, factors = rng.uniform(-0.4, 0.4, (136 * n_people, 3)), np.ones(136 * n_people)
    for _ in range(repeats):
        ours = clock.measure("ours", field.activations, positions, normals, points, factors)
        plain = clock.measure("plain", one_keypoint_at_a_time, field, positions, normals, points, factors)
    if np.mean(np.abs(ours - plain) < 5e-3) < 0.99:
        raise SystemExit("activations differ from the baseline's")
    ours_s, plain_s = (min(cpu for _, cpu in clock.times_s[name]) for name in ("ours", "plain"))
    return Comparison(
        f"activation of {N_SKIN} taxels, people: {n_people}", ours_s, "one keypoint at a time", plain_s
    )


def compare_detector(detector, frames: list, n_cycles: int) -> Iterator[Comparison]:
    """Wall times of the detector, and from image to command by either way of lifting."""
    for method in METHODS:
        times_s = run_cycles(detector, frames, n_cycles, method).times_s
        found_s, *others_s = (np.array([wall for wall, _ in times]) for times in times_s.values())
        whole_s = found_s + np.sum(others_s, axis=0)
        yield Comparison("the detector, median wall time", float(np.median(found_s)), PERIOD, PERIOD_S)
        for name, percent, most_s in (("median", 50, 0.033), ("99th percentile", 99, None)):
            passed_s = float(np.percentile(whole_s, percent))
            title = f"perception to command, {method} lifting, {name}, wall time"
            yield Comparison(title, passed_s, PERIOD, PERIOD_S, most_s=most_s)


def measure(options) -> Iterator[Comparison]:
    for n in (1, 3):
        yield compare_activations(n, options.repeats)
    for n in (1, 2, 5):
        near_s = near_cycles(options.cycles, n).median_s("cycle")
        yield Comparison(f"tracking to controller, people about the arm: {n}", near_s, PERIOD, PERIOD_S)
    frames = make_frames(options.frames)
    clock = run_cycles(None, frames, options.cycles)
    for stage in clock.times_s:
        yield Comparison(stage, clock.median_s(stage), PERIOD, PERIOD_S)
    both_s = clock.median_s("activation") + clock.median_s("controller")
    yield Comparison("activation and controller", both_s, PERIOD, PERIOD_S, most_s=0.002)
    fast = FAST_OPTIONS if options.detector == FAST else {}
    yield from compare_detector(make_detector(options.detector, **fast), frames, options.cycles)


if __name__ == "__main__":
    run(
        measure, __doc__,
        frames=(8, 1), cycles=(200, 2), repeats=(20, 1), detector=(FAST, FAST),
    )  # fmt: skip

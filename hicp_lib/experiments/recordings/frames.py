"""One frame of a simulated recording: colour, depth as it is measured and as it is, where the person is."""

import numpy as np

from hicp_lib.experiments.laboratory import colour_and_depth, in_root, robot_camera
from hicp_lib.experiments.recordings.scenarios import Scenario, scenario
from hicp_lib.robot.kinematics import load_icub
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.rendering.camera import PlacedCamera
from hicp_lib.simulation.rendering.render import render
from hicp_lib.simulation.world.visibility import keypoint_visibility


def record_frame(name: str, subject: Subject, k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, dict]:
    """One frame of a scenario.

    Parameters
    ----------
    name : str
        Of the scenario; with another depth camera the colour image is the same.
    subject : Subject
    k : int
        The frame's number is `k`.

    Returns
    -------
    rgb : array, shape (480, 640, 3), dtype uint8
    depth_m, exact_m : array, shape (480, 640), dtype float32
        As the depth camera measures it, and as it is.
    truth : dict of str to list
        `keypoints_m` (136, 3) in the base frame and `visible` (136,).
    """
    plan, rng = scenario(name, subject.number), subject.stream(name.partition("@")[0], k)
    world, person = plan.stage(subject, float(plan.times_s(k + 1)[k]))
    camera = camera_at(plan, k)
    frame = render(world, camera, rng)
    rgb, depth_m = colour_and_depth(frame, camera, rng, plan.depth_camera)
    _, visible = keypoint_visibility(frame.rays, camera, person.keypoints_m, 0)
    truth = {"keypoints_m": in_root(person.keypoints_m).round(6).tolist(), "visible": visible.tolist()}
    return rgb, depth_m, frame.depth_m, truth


def camera_at(plan: Scenario, k: int) -> PlacedCamera:
    """The colour camera as frame `k` is taken."""
    (T_root_camera,) = load_icub().T_root_camera(plan.head_rad(k + 1)[k:], plan.mount)
    return robot_camera(T_root_camera)


def camera_poses(plan: Scenario, n: int) -> np.ndarray:
    """T_base_cam (n, 4, 4) of the first `n` frames."""
    return load_icub().T_root_camera(plan.head_rad(n), plan.mount)

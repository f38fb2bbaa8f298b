"""An onlooker sees the robot and the person, and not the room."""

import numpy as np
import pytest

from hicp_lib.core.camera import transform
from hicp_lib.experiments.avoidance.closed_loop import start_posture
from hicp_lib.experiments.avoidance.head_camera import CAMERA, onlooker_view, robot_surfaces
from hicp_lib.experiments.avoidance.reaching import NEAR_S, Moment
from hicp_lib.experiments.laboratory import T_WORLD_ROOT
from hicp_lib.robot.home import HOME_M
from hicp_lib.robot.kinematics import load_icub
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.rendering.camera import project_world


@pytest.fixture(scope="module")
def moment():
    moment = Moment("sitting, hand", Subject(), NEAR_S)
    return moment.world([]), moment.person


def seen_px(points_m: np.ndarray) -> np.ndarray:
    return project_world(CAMERA, points_m)[0].round().astype(int)


def test_the_robot_is_where_its_hand_is(moment):
    world, _ = moment
    robot = robot_surfaces(load_icub(), start_posture(), whole=True)
    differs = np.abs(onlooker_view(world, robot).astype(int) - onlooker_view(world, [])).max(axis=-1) > 40
    hands_m = transform(T_WORLD_ROOT, np.array([HOME_M["left"], [-0.05, 0, 0.35]]))
    for u, v in seen_px(hands_m):  # its hand and its head
        assert differs[v - 12 : v + 13, u - 12 : u + 13].mean() > 0.2
    assert differs[:, :100].mean() < 0.05


def test_the_person_is_seen_and_walls_are_not(moment):
    world, person = moment
    view = onlooker_view(world, [])
    u, v = seen_px(person.keypoints_m[0])
    corner, nose = view[5, 5].astype(int), view[v, u].astype(int)
    assert np.abs(nose - corner).max() > 30
    assert np.ptp(view[:5].reshape(-1, 3), axis=0).max() < 12  # nothing hangs behind them

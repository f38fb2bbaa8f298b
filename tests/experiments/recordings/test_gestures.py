"""What people do before the robot: parts of the body leave the image, and none runs through table or self."""

from itertools import islice, pairwise

import numpy as np
import pytest

from hicp_lib.core.camera import project, transform
from hicp_lib.core.keypoints import INDEX
from hicp_lib.experiments.laboratory import posed
from hicp_lib.experiments.minimum_jerk import between
from hicp_lib.experiments.recordings.frames import camera_at
from hicp_lib.experiments.recordings.gestures import DISTANCE_M, TABLE_M, Gestures
from hicp_lib.experiments.recordings.scenarios import scenario
from hicp_lib.simulation.appearance.people import appearance_of
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.body.joints import pose_from_joints, within_limits
from hicp_lib.simulation.body.self_collision import self_collision_distance_m

N_MOVES = 65  # more than a round


@pytest.fixture(scope="module", params=[0, 1, 2])
def shape(request):
    return appearance_of(Subject(7, request.param, "development").identity).shape


@pytest.fixture(scope="module", params=[True, False], ids=["at a table", "free to come close"])
def gestures(request, shape) -> Gestures:
    return Gestures(np.random.default_rng(3), shape, request.param)


@pytest.fixture(scope="module")
def postures(gestures) -> list:
    return [gestures.now, *(move.to for move in islice(gestures.moves(), N_MOVES))]


def test_nobody_runs_through_the_table(gestures, postures):
    nearest_m = min(posture.place_m[1] for posture in postures)
    if gestures.at_table:
        assert nearest_m > TABLE_M[1][1] + 0.2
    else:
        assert 0.7 < nearest_m < 1.1
    assert postures[-1].place_m[1] > 0.7 and max(abs(posture.place_m[0]) for posture in postures) > 0.45
    away = [abs(p.place_m[0]) > 0.45 or p.place_m[1] < DISTANCE_M - 0.3 for p in postures]
    assert np.mean(away) < 0.6  # they come back


def test_postures_and_the_ways_between_them_are_possible(gestures, postures):
    assert all(within_limits(posture.joints) for posture in postures)
    gaps_m = [
        self_collision_distance_m(gestures.body, gestures.collision_model, pose_from_joints(way.joints))
        for pair in pairwise(postures)
        for way in (between(*pair, share) for share in (0.25, 0.5, 0.75, 1))
    ]
    assert np.quantile(gaps_m, 0.01) > -0.06


def test_parts_of_the_body_leave_the_image_at_times(gestures, postures):
    camera = camera_at(scenario("mocap"), 0)
    T_camera_world, shown = np.linalg.inv(camera.T_world_camera), []
    for posture in postures:
        keypoints_m = posed(gestures.shape, posture).keypoints_m
        shown.append(camera.contains(project(camera, transform(T_camera_world, keypoints_m))))
    share = np.mean(shown, axis=0)
    for name in ("left_wrist", "right_wrist", "left_elbow", "right_elbow"):
        assert 0.6 < share[INDEX[name]] <= 1
    assert share[[INDEX["left_wrist"], INDEX["right_wrist"]]].mean() < 0.97
    assert share[INDEX["left_shoulder"]] + share[INDEX["right_shoulder"]] > 1.5

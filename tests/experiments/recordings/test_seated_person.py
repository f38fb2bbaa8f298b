"""The seated person: hands on the table, well framed in all the poses listed in data/."""

from __future__ import annotations

import numpy as np
import pytest

from hicp_lib.core.camera import project, transform
from hicp_lib.core.keypoints import INDEX
from hicp_lib.experiments.laboratory import COLOUR, T_WORLD_ROOT
from hicp_lib.experiments.recordings.scenarios import SCENARIOS, relative_poses_rad
from hicp_lib.experiments.recordings.seated_person import TABLE_HEIGHT_M, seated_person
from hicp_lib.robot.kinematics import load_icub
from hicp_lib.simulation.body.identities import Subject


@pytest.mark.parametrize("number", range(6))
def test_hands_lie_on_the_table(number):
    person = seated_person(Subject(number=number))[1]
    for side in ("left", "right"):
        wrist = person.keypoints_m[INDEX[f"{side}_wrist"]]
        assert TABLE_HEIGHT_M + 0.01 < wrist[2] < TABLE_HEIGHT_M + 0.11
    fingers = person.keypoints_m[94:136]
    assert (fingers[:, 2] > TABLE_HEIGHT_M).all() and fingers[:, 2].min() < TABLE_HEIGHT_M + 0.03
    feet = person.keypoints_m[[INDEX["left_heel"], INDEX["right_heel"]], 2]
    assert (feet < 0.12).all()


def test_a_subject_is_always_the_same_person():
    kept, made_anew = seated_person(Subject(3))[1], seated_person.__wrapped__(Subject(3))[1]
    np.testing.assert_array_equal(kept.vertices_m, made_anew.vertices_m)


@pytest.mark.parametrize("view", ["upper", "lower"])
def test_the_listed_poses_are_possible_and_frame_the_person(view):
    icub, poses_rad = load_icub(limits="software"), relative_poses_rad(view)
    low, high = icub.chains["head"].limits_rad.T
    assert poses_rad.shape == (100, 6) and len(np.unique(poses_rad, axis=0)) == 100
    assert (poses_rad >= low).all() and (poses_rad <= high).all()
    T_root_camera = icub.T_root_camera(poses_rad, SCENARIOS[f"relative-{view}"].mount)
    T_camera_world = np.linalg.inv(T_WORLD_ROOT @ T_root_camera)
    pixels_px = project(
        COLOUR, transform(T_camera_world, seated_person(Subject(split="development"))[1].keypoints_m)
    )
    inside = ((pixels_px > 0) & (pixels_px < [639, 479])).all(axis=2).mean(axis=0)
    seen = dict(zip(INDEX, inside, strict=True))
    assert seen["left_wrist"] == seen["right_elbow"] == 1
    assert seen["nose"] == (1 if view == "upper" else 0)
    assert seen["left_shoulder"] == 1 or view == "lower"


def test_the_robot_faces_along_y_with_its_right_along_x():
    forward, right = -T_WORLD_ROOT[:3, 0], T_WORLD_ROOT[:3, 1]
    np.testing.assert_array_equal(forward, [0, 1, 0])
    np.testing.assert_array_equal(right, [1, 0, 0])
    assert np.linalg.det(T_WORLD_ROOT[:3, :3]) == 1

"""The seated person: hands on the table, well framed in all the poses listed in data/."""

from __future__ import annotations

import numpy as np
import pytest

from hicp_lib.core.camera import project, transform
from hicp_lib.core.keypoints import INDEX
from hicp_lib.evaluation.space.sightings import similar_pairs
from hicp_lib.experiments.laboratory import COLOUR, T_WORLD_ROOT
from hicp_lib.experiments.recordings.scenarios import SCENARIOS, relative_poses_rad, scenario
from hicp_lib.experiments.recordings.seated_person import TABLE_HEIGHT_M, VIEWS, seated_person
from hicp_lib.robot.kinematics import load_icub
from hicp_lib.simulation.body.identities import Subject


@pytest.mark.parametrize("number", range(6))
def test_hands_lie_on_the_table(number):
    person = seated_person(Subject(number=number))[1]
    for side in ("left", "right"):
        wrist = person.keypoints_m[INDEX[f"{side}_wrist"]]
        assert TABLE_HEIGHT_M + 0.01 < wrist[2] < TABLE_HEIGHT_M + 0.12
    fingers = person.keypoints_m[94:136]
    assert (fingers[:, 2] > TABLE_HEIGHT_M).all() and fingers[:, 2].min() < TABLE_HEIGHT_M + 0.03
    feet = person.keypoints_m[[INDEX["left_heel"], INDEX["right_heel"]], 2]
    assert (feet < 0.12).all()


def test_a_subject_is_always_the_same_person():
    kept, made_anew = seated_person(Subject(3))[1], seated_person.__wrapped__(Subject(3))[1]
    np.testing.assert_array_equal(kept.vertices_m, made_anew.vertices_m)


@pytest.mark.parametrize("view", ["upper", "lower"])
def test_the_listed_poses_are_possible_and_frame_whoever_sits_there(view):
    icub, poses_rad = load_icub(limits="software"), relative_poses_rad(view)
    low, high = icub.chains["head"].limits_rad.T
    assert poses_rad.shape == (100, 6) and len(np.unique(poses_rad, axis=0)) == 100
    assert (poses_rad >= low).all() and (poses_rad <= high).all()
    T_root_camera = icub.T_root_camera(poses_rad, SCENARIOS[f"relative-{view}"].mount)
    T_camera_world = np.linalg.inv(T_WORLD_ROOT @ T_root_camera)
    for number in range(3):
        points_m = seated_person(Subject(number=number, split="development"))[1].keypoints_m
        inside = COLOUR.contains(project(COLOUR, transform(T_camera_world, points_m))).mean(axis=0)
        seen = dict(zip(INDEX, inside, strict=True))
        assert seen["nose"] > 0.4 if view == "upper" else seen["nose"] < 0.1  # the tallest lean out
        assert seen["left_shoulder"] == 1 if view == "upper" else seen["left_hip"] > 0.9
        assert seen["left_wrist"] > 0.7 and seen["right_wrist"] > 0.7
    hands = [share for name, share in seen.items() if "_hand" in name or name.endswith(("_1", "_4"))]
    assert min(hands) < 1  # not even the lower view holds them whole in all poses


def test_people_are_seen_from_poses_of_their_own_nearly_equal_ones_among_them():
    poses_rad = relative_poses_rad("upper")
    first, second, last = (scenario("relative-upper", number).head_rad(8) for number in (0, 1, 12))
    assert (first == poses_rad[:8]).all() and (second == poses_rad[8:16]).all()
    assert (last == poses_rad[[96, 97, 98, 99, 0, 1, 2, 3]]).all()  # the list begins anew
    assert len(scenario("relative-upper", 7).head_rad(100)) == 100
    icub = load_icub()
    pairs = [
        len(similar_pairs(icub.T_root_camera(scenario(f"relative-{view}", k).head_rad(8), mount)))
        for view, mount in VIEWS.items() for k in range(12)
    ]  # fmt: skip
    assert np.mean(pairs) > 3


def test_nobody_sits_as_anybody_else():
    people = [seated_person(Subject(number=number))[1].keypoints_m for number in range(4)]
    for name in ("left_wrist", "nose"):
        places_m = np.array([person[INDEX[name]] for person in people])
        apart_m = np.linalg.norm(places_m[:, None] - places_m, axis=-1)[np.triu_indices(4, 1)]
        assert apart_m.min() > 0.003


def test_the_robot_faces_along_y_with_its_right_along_x():
    forward, right = -T_WORLD_ROOT[:3, 0], T_WORLD_ROOT[:3, 1]
    np.testing.assert_array_equal(forward, [0, 1, 0])
    np.testing.assert_array_equal(right, [1, 0, 0])
    assert np.linalg.det(T_WORLD_ROOT[:3, :3]) == 1

"""People from near: who they are, and where the camera stands."""

import numpy as np
import pytest

from hicp_lib.experiments.laboratory import COLOUR
from hicp_lib.experiments.near import DISTANCE_M, near_stage
from hicp_lib.simulation.body.identities import HELD_OUT
from hicp_lib.simulation.rendering.camera import project_world
from hicp_lib.simulation.world.staging import random_stage


@pytest.fixture(scope="module", params=range(4))
def stages(request):
    """A scene as it is, and from near."""
    return [staged(np.random.default_rng(request.param)) for staged in (random_stage, near_stage)]


def test_the_first_person_of_the_scene_is_there_alone(stages):
    scene, near = stages
    assert near.identities == scene.identities[:1] and near.identities[0].split == HELD_OUT
    assert np.array_equal(near.people[0].vertices_m, scene.people[0].vertices_m) and len(near.people) == 1
    shown, there = ([surface.person for surface in stage.world.surfaces] for stage in (near, scene))
    assert shown == [person for person in there if person < 1] and 0 in shown
    assert len(near.world.lights) == len(scene.world.lights)


def test_the_camera_is_the_robots_and_within_reach(stages):
    camera, person = stages[1].camera, stages[1].people[0]
    assert {name: getattr(camera, name) for name in vars(COLOUR)} == vars(COLOUR)
    assert 1.0 <= camera.centre_m[2] <= 1.1
    away_m = np.linalg.norm((person.vertices_m - camera.centre_m)[:, :2], axis=1)
    assert DISTANCE_M[0] <= away_m.min() < DISTANCE_M[1] + 0.3  # the foremost may stand aside
    pixels_px, _ = project_world(camera, person.keypoints_m)
    assert camera.contains(pixels_px).sum() > 5

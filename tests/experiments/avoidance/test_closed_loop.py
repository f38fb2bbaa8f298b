"""The loop closed in simulation, with keypoints that are true: no images are rendered."""

from dataclasses import dataclass

import numpy as np
import pytest

from hicp_lib.experiments.avoidance import closed_loop
from hicp_lib.experiments.avoidance.closed_loop import Trial, TrueKeypoints, next_image_s, simulate
from hicp_lib.experiments.avoidance.reaching import CONTACT_M, LEAVES_S, NEAR_S, SCRIPTS, script
from hicp_lib.experiments.avoidance.robot_surfaces import robot_surfaces
from hicp_lib.experiments.avoidance.skin_distance import FAR_M, robot_spheres, skin_distance_m
from hicp_lib.experiments.laboratory import in_root
from hicp_lib.robot.home import HOME_M, home_posture
from hicp_lib.robot.kinematics import load_icub
from hicp_lib.robot.loop import Perception
from hicp_lib.robot.skin import read_skin
from hicp_lib.simulation.body.joints import within_limits


@pytest.fixture(scope="module")
def spheres():
    icub = load_icub()
    return robot_spheres(icub, read_skin(), home_posture(icub))


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_brings_the_person_to_the_hand_and_away_again(name, spheres):
    scene = script(name)
    person_m = {t: in_root(scene.person_at(t).vertices_m) for t in (0.0, NEAR_S, LEAVES_S[1])}
    far, near, left = (skin_distance_m(spheres, vertices) for vertices in person_m.values())
    assert near == pytest.approx(CONTACT_M, abs=0.005)
    assert far == pytest.approx(left) and far > 0.2
    nearest = np.linalg.norm(person_m[NEAR_S] - HOME_M["left"], axis=1).min()
    assert nearest < 0.1


@pytest.mark.parametrize("name", SCRIPTS)
def test_joints_of_a_script_stay_within_their_limits(name):
    scene = script(name)
    for t in np.arange(0, LEAVES_S[1], 0.5):
        joints = dict(scene.motion.at(t).joints)
        joints.pop("pelvis_flexion", None)
        assert within_limits(joints)


def test_distance_is_that_to_a_single_vertex(spheres):
    taxels, _ = read_skin().in_root(load_icub(), home_posture(load_icub()))
    outward = np.array([[-0.30 - 0.1, -0.2, 0.05]])
    places, radii = spheres
    exact = (np.linalg.norm(places - outward, axis=1) - radii).min()
    assert skin_distance_m(spheres, outward) == pytest.approx(exact, abs=1e-6)
    assert skin_distance_m(spheres, taxels[:1]) == 0
    assert skin_distance_m(spheres, np.full((1, 3), 5.0)) == FAR_M


def test_the_robot_is_drawn_where_it_is():
    icub = load_icub()
    posture = home_posture(icub)
    (surface,) = robot_surfaces(icub, posture)
    vertices = in_root(surface.mesh.vertices_m[surface.mesh.triangles].reshape(-1, 3))
    for side in ("left", "right"):
        hand_m = icub.chains[side].T_root_link("hand", posture.angles(side))[:3, 3]
        assert np.linalg.norm(vertices - hand_m, axis=1).min() < 0.012  # the link's origin lies on the palm
    assert vertices[:, 2].max() < icub.chains["head"].T_root_link("torso", posture.angles("head"))[2, 3]


@dataclass
class SlowPerceiver:
    """True keypoints that come late; remembers when it looked, and when the loop heard."""

    delay_s: float

    def __post_init__(self):
        self.looked_s = []

    def perceive(self, script, time_s, posture) -> Perception:
        self.looked_s.append(time_s)
        return TrueKeypoints().perceive(script, time_s, posture)


def test_slow_eyes_skip_images_and_none_of_theirs_is_lost(monkeypatch):
    monkeypatch.setattr(closed_loop, "person_skin_m", lambda trial, time_s: np.full((1, 3), 9.0))
    perceiver = SlowPerceiver(0.2)
    run = simulate(Trial("sitting, hand", 1.2), perceiver)
    np.testing.assert_allclose(perceiver.looked_s, np.arange(0, 1.2, 0.2), atol=1e-9)
    heard = run.dropna().drop_duplicates("seen_s")
    np.testing.assert_allclose(heard["t_s"] - heard["seen_s"], 0.2, atol=1e-9)
    assert len(heard) == 5
    assert next_image_s(1.0, 0.05, 10.0) == pytest.approx(1.1)
    assert next_image_s(1.0, 0.11, 10.0) == pytest.approx(1.2)


def test_with_true_keypoints_the_hand_gives_way_and_without_avoidance_it_stays():
    trial = Trial("standing, hand", 2.8)
    stays, gives_way = (simulate(trial, TrueKeypoints(), avoids) for avoids in (False, True))
    assert stays["hand_error_m"].max() < 0.002 and stays["distance_m"].min() < 0.02
    assert gives_way["distance_m"].min() > 0.03
    assert gives_way["activation"].max() < stays["activation"].max()

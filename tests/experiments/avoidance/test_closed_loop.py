"""The loop closed in simulation, with keypoints that are true: no images are rendered."""

import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.experiments.avoidance.closed_loop import (
    STARTS_S,
    Follower,
    Latency,
    Trial,
    between_s,
    simulate,
    true_keypoints,
)
from hicp_lib.experiments.avoidance.head_camera import robot_surfaces
from hicp_lib.experiments.avoidance.reaching import (
    BYSTAND_M,
    BYSTANDERS,
    CONTACT_M,
    LEAVES_S,
    NEAR_S,
    REACTION_S,
    SCRIPTS,
    Moment,
    script,
)
from hicp_lib.experiments.avoidance.skin_distance import FAR_M, robot_spheres, skin_distance_m
from hicp_lib.experiments.laboratory import in_root
from hicp_lib.robot.home import HOME_M, home_posture
from hicp_lib.robot.kinematics import load_icub
from hicp_lib.robot.skin import read_skin
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.body.joints import within_limits

HOME = np.array(HOME_M["left"])


@pytest.fixture(scope="module")
def spheres():
    icub = load_icub()
    return robot_spheres(icub, home_posture(icub))


def distance_m(spheres, name: str, time_s: float, hand_m=HOME) -> float:
    return skin_distance_m(spheres, in_root(Moment(name, Subject(), time_s, tuple(hand_m)).person.vertices_m))


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_brings_the_person_to_the_hand_and_away_again(name, spheres):
    far, near, left = (distance_m(spheres, name, t) for t in (0.0, NEAR_S, LEAVES_S[1]))
    assert near == pytest.approx(CONTACT_M, abs=0.005)
    assert far == pytest.approx(left) and far > 0.15
    person = Moment(name, Subject(), NEAR_S).person
    assert np.linalg.norm(in_root(person.vertices_m) - HOME, axis=1).min() < 0.1


@pytest.mark.parametrize("name", BYSTANDERS)
def test_a_bystander_moves_before_the_robot_and_comes_no_nearer(name, spheres):
    times_s = np.arange(0, LEAVES_S[1], 0.1)
    least_m = min(distance_m(spheres, name, float(t), HOME + [-0.1, 0, 0]) for t in times_s)
    assert BYSTAND_M - 0.08 < least_m < BYSTAND_M + 0.02
    wrists = [Moment(name, Subject(), float(t)).person.keypoints_m[10] for t in times_s]
    assert np.ptp(wrists, axis=0).max() > 0.2


@pytest.mark.parametrize("name", SCRIPTS)
def test_joints_of_a_script_stay_within_their_limits(name):
    for t in np.arange(0, LEAVES_S[1], 0.5):
        joints = dict(script(name).posture_at(t, HOME + [0.1, -0.05, -0.05]).joints)
        joints.pop("pelvis_flexion", None)
        assert within_limits(joints)


@pytest.mark.parametrize(
    ("name", "away_m"), [("standing, hand", [0.04, -0.02, 0.05]), ("sitting, hand", [0.06, -0.04, -0.04])]
)
def test_a_hand_follows_the_robots_wherever_it_can_reach(name, away_m):
    places = [
        in_root(Moment(name, Subject(), 3.0, tuple(hand_m)).person.keypoints_m[10])
        for hand_m in (HOME, HOME + np.array(away_m))
    ]
    np.testing.assert_allclose(places[1] - places[0], away_m, atol=0.012)
    far = Moment(name, Subject(), 3.0, (3.0, 0.0, 0.5)).person
    assert np.linalg.norm(in_root(far.keypoints_m[10]) - [3.0, 0.0, 0.5]) > 1.5


def test_a_head_follows_as_its_bow_allows():
    nose = [
        in_root(Moment("sitting, head", Subject(), 3.0, tuple(HOME + off)).person.keypoints_m[0])
        for off in ([0, 0, 0], [0.05, 0, -0.06])
    ]
    assert nose[1][2] < nose[0][2] - 0.02


def test_a_follower_is_late_and_no_faster_than_told():
    follower = Follower(Trial("sitting, hand", follow_m_s=0.5))
    for k in range(100):
        time_s = 0.02 * k
        follower.see(time_s, HOME + [0.2 * (time_s >= 0.5), 0, 0])
    moved_m = np.array([follower.moment(0.1 * k).hand_m[0] - HOME[0] for k in range(16)])
    times_s = 0.1 * np.arange(16)
    assert (moved_m[times_s < 0.5 + REACTION_S - 1e-9] == 0).all()
    assert moved_m[-1] == pytest.approx(0.2, abs=1e-3)
    assert np.diff(moved_m).max() == pytest.approx(0.05, abs=1e-3)


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


@pytest.mark.parametrize("latency", [Latency(inference_s=0.2), Latency(transport_s=0.25, inference_s=0.15)])
def test_images_wait_for_the_detector_only_and_none_is_lost(monkeypatch, latency):
    monkeypatch.setattr(Follower, "skin_m", lambda self, time_s: np.full((1, 3), 9.0))
    looked_s = []

    def perceive(moment, posture, read):
        looked_s.append(moment.time_s)
        return true_keypoints(moment, posture, read)

    run = simulate(Trial("sitting, hand", STARTS_S + 1.2, camera_hz=10.0), perceive, latency)
    np.testing.assert_allclose(looked_s, STARTS_S + np.arange(0, 1.2, 0.2), atol=1e-9)
    heard = run.dropna().drop_duplicates("seen_s")
    np.testing.assert_allclose(heard["t_s"] - heard["seen_s"], latency.total_s, atol=0.02)
    assert len(heard) == (5 if latency.total_s < 0.4 - 1e-9 else 4)
    assert between_s(Trial("sitting, hand", camera_hz=10.0), latency) == pytest.approx(0.2)


@pytest.mark.parametrize("value_s", [-0.1, float("nan"), float("inf"), "0.1", None])
def test_a_latency_that_is_none_is_refused(value_s):
    with pytest.raises(InputError, match="queue_s is .*; expected seconds, 0 or more"):
        Latency(queue_s=value_s)


def test_with_true_keypoints_the_hand_gives_way_and_without_avoidance_it_stays():
    trial = Trial("standing, hand", 2.8, follow_m_s=0.0)
    stays, gives_way = (simulate(trial, true_keypoints, avoids=avoids) for avoids in (False, True))
    assert stays["hand_error_m"].max() < 0.002 and stays["distance_m"].min() < 0.02
    assert gives_way["distance_m"].min() > 0.03
    assert gives_way["activation"].max() < stays["activation"].max()


def test_noisy_joints_make_the_hand_tremble_and_not_wander():
    runs = [
        simulate(Trial("standing, hand", STARTS_S + 0.2, joint_noise_rad=n), true_keypoints)
        for n in (0, 0.01)
    ]
    still, trembling = (run["hand_error_m"] for run in runs)
    assert still.max() < 1e-4 < trembling.max() < 0.01

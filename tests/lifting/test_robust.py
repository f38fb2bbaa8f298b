"""Lifting beyond the paper: the choice of depths against trying all, and people of known shape."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hicp_lib.core.camera import Camera, deproject
from hicp_lib.core.keypoints import HANDS, INDEX
from hicp_lib.lifting.body_measures import load_measures
from hicp_lib.lifting.limb_lengths import choose_along_limbs, limbs_outwards
from hicp_lib.lifting.paper import GUESSED, LIFTED, NO_DEPTH, NOT_DETECTED, OUTSIDE_IMAGE, lift
from hicp_lib.lifting.robust import STEPS, lift_robust
from hicp_lib.simulation.body.model import load_body, pose_body
from hicp_lib.simulation.body.poses import sample_pose
from hicp_lib.simulation.rendering.camera import PlacedCamera, look_at, pixel_rays, project_world
from hicp_lib.simulation.sensors.markers import body_scene

CAMERA = Camera(320, 240, 300.0, 300.0, 160.0, 120.0)
ARM = ("left_shoulder", "left_elbow", "left_wrist")


def keypoints(**places_px) -> np.ndarray:
    points = np.full((1, 136, 2), np.nan)
    for name, place in places_px.items():
        points[0, INDEX[name]] = place
    return points


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_no_other_choice_of_depths_costs_less(seed):
    rng = np.random.default_rng(seed)
    found = np.sort([INDEX[name] for name in (*ARM, "nose")])
    grid_m = np.linspace(0.8, rng.uniform(1.1, 2.5), 5)
    costs = rng.uniform(0, 10, (4, 5))
    rays = np.column_stack([rng.uniform(-0.5, 0.5, (4, 2)), np.ones(4)])
    measures = load_measures()
    chosen, _ = choose_along_limbs(costs, limbs_outwards(grid_m, rays, found, measures))

    def total(depths) -> float:
        limbs = [(1, 2), (2, 3)]  # shoulder to elbow to wrist; the nose hangs on a shoulder not found
        return sum(costs[k, d] for k, d in enumerate(depths)) + sum(
            length_cost(*(grid_m[depths[k]] * rays[k] for k in limb), found[list(limb)], measures)
            for limb in limbs
        )

    assert total(chosen) == pytest.approx(min(map(total, itertools.product(range(5), repeat=4))), rel=1e-5)


def length_cost(begin_m, end_m, pair, measures) -> float:
    """Of a limb of the body: as the head of `limb_lengths` says."""
    length_m, least_m, most_m = (
        np.linalg.norm(begin_m - end_m), measures.closest_m[*pair], measures.farthest_m[*pair]
    )  # fmt: skip
    sigma_m = 0.02 * most_m + 0.005
    if length_m > most_m:
        return min(((length_m - most_m) / sigma_m) ** 2, 40.0)
    return min((max(least_m - length_m, 0) / sigma_m) ** 2, 4.0)


def test_before_a_wall_a_keypoint_is_as_deep_as_below_the_skin():
    depth_m = np.full((240, 320), 1.5)
    for n_steps in (1, 2, len(STEPS)):
        lifted = lift_robust(keypoints(left_wrist=(210.3, 80.7)), depth_m, CAMERA, n_steps)
        point = lifted.points_m[0, INDEX["left_wrist"]]
        skin = lift(keypoints(left_wrist=(210.3, 80.7)), depth_m, CAMERA).points_m[0, INDEX["left_wrist"]]
        below_m = load_measures().below_skin_m[INDEX["left_wrist"]]
        assert np.linalg.norm(point) - np.linalg.norm(skin) == pytest.approx(below_m, abs=2e-3)
        assert lifted.reason[0, INDEX["left_wrist"]] == LIFTED


def test_a_wrist_found_beside_the_arm_is_not_on_the_wall():
    depth_m = np.full((240, 320), 2.5)
    depth_m[40:200, 150:170] = 1.0  # an upright arm, 20 pixels or 7 cm wide
    # Shoulder to elbow to wrist 0.26 and 0.23 m; the wrist is 5 pixels beside the arm.
    arm = keypoints(left_shoulder=(160, 45), left_elbow=(160, 123), left_wrist=(175, 190))
    wrist, elbow = INDEX["left_wrist"], INDEX["left_elbow"]
    assert lift(arm, depth_m, CAMERA).points_m[0, wrist, 2] == 2.5
    z = lift_robust(arm, depth_m, CAMERA).points_m[0, :, 2]
    assert z[wrist] == pytest.approx(1.0 + load_measures().below_skin_m[wrist], abs=0.01)
    assert z[elbow] == pytest.approx(1.0 + load_measures().below_skin_m[elbow], abs=0.01)


def test_an_elbow_behind_something_is_put_behind_it():
    depth_m = np.full((240, 320), 1.5)
    depth_m[110:140, 140:180] = 0.7  # something nearer hides the elbow
    arm = keypoints(left_shoulder=(160, 75), left_elbow=(160, 125), left_wrist=(160, 170))
    elbow = INDEX["left_elbow"]
    assert lift(arm, depth_m, CAMERA).points_m[0, elbow, 2] == 0.7
    lifted, wrist = lift_robust(arm, depth_m, CAMERA), INDEX["left_wrist"]
    assert 1.3 < lifted.points_m[0, elbow, 2] < 1.75
    assert lifted.reason[0, [elbow, wrist]].tolist() == [GUESSED, LIFTED]
    assert lifted.sigma_m[0, wrist] < 0.03 < lifted.sigma_m[0, elbow] < 0.3


def test_a_joint_whose_limb_comes_towards_the_camera_lies_deeper():
    depth_m, elbow = np.full((240, 320), 1.2), INDEX["left_elbow"]
    depth_m[116:, :] = 0.97
    beside, ahead = (
        lift_robust(keypoints(left_elbow=(160, 105), left_wrist=wrist_px), depth_m, CAMERA).points_m[
            0, elbow, 2
        ]
        for wrist_px in ((220, 105), (160, 125))
    )
    assert 0.3 < (ahead - beside) / load_measures().below_skin_m[elbow] < 0.5


def test_reasons_are_the_papers():
    depth_m = np.full((240, 320), 1.5)
    depth_m[:, :100] = np.nan
    points = keypoints(left_wrist=(20, 100), left_elbow=(200, 100), right_wrist=(400, 100))
    reason = lift_robust(points, depth_m, CAMERA).reason[0]
    names = ("left_wrist", "left_elbow", "right_wrist", "nose")
    assert [reason[INDEX[n]] for n in names] == [NO_DEPTH, LIFTED, OUTSIDE_IMAGE, NOT_DETECTED]
    empty = lift_robust(points, np.zeros((240, 320), np.uint16), CAMERA)
    assert np.isnan(empty.points_m).all() and empty.reason[0, INDEX["left_elbow"]] == NO_DEPTH
    assert lift_robust(np.empty((0, 136, 2)), depth_m, CAMERA).points_m.shape == (0, 136, 3)


def test_every_step_changes_what_the_ones_before_it_give():
    rng = np.random.default_rng(4)
    depth_m = 1.2 + 0.3 * rng.random((240, 320))
    people_px = rng.uniform(20, 220, (2, 136, 2))
    people_px[1, HANDS[:21]] = np.nan
    by_steps = [lift_robust(people_px, depth_m, CAMERA, n) for n in range(len(STEPS) + 1)]
    np.testing.assert_array_equal(by_steps[0].points_m, lift(people_px, depth_m, CAMERA).points_m)
    np.testing.assert_array_equal(by_steps[-1].points_m, lift_robust(people_px, depth_m, CAMERA).points_m)
    assert [np.isfinite(lifted.sigma_m).any() for lifted in by_steps] == [False, False, True, True, True]
    for before, after in itertools.pairwise(by_steps):
        assert not np.array_equal(before.points_m, after.points_m, equal_nan=True)


def test_joints_of_people_are_found_closer_than_by_the_paper():
    """Depth of the body model alone, 1 m away before a wall; keypoints where they truly appear."""
    body, rng = load_body(), np.random.default_rng(3)
    methods = {"paper": lift, "robust": lift_robust}
    errors = {name: [] for name in methods}
    for shape, kind in ((3, "reaching"), (9, "pointing"), (5, "reaching_both"), (1, "face")):
        person = pose_body(body, shape, sample_pose(rng, body, kind, shape))
        middle = person.keypoints_m[INDEX["neck"]] - [0, 0, 0.25]
        pose = look_at(middle + [1.0, 0.1, 0.1], middle)
        camera = PlacedCamera(320, 240, 300.0, 300.0, 160.0, 120.0, pose)
        depth_m = body_scene(person).trace(pixel_rays(camera)).depth_m.reshape(240, 320)
        depth_m = np.where(np.isfinite(depth_m), depth_m, 2.5)
        pixels_px, z = project_world(camera, person.keypoints_m)
        truth_m = deproject(CAMERA, pixels_px, z)
        joints = [*(INDEX[f"{s}_{j}"] for s in ("left", "right") for j in ("elbow", "wrist")), *HANDS]
        for name, method in methods.items():
            lifted = method(pixels_px[None], depth_m, CAMERA).points_m[0]
            errors[name].append(np.linalg.norm(lifted - truth_m, axis=1)[joints])
    both = np.isfinite(np.array([np.concatenate(errors[name]) for name in methods])).all(axis=0)
    paper_m, robust_m = (np.concatenate(errors[name])[both] for name in ("paper", "robust"))
    assert np.median(robust_m) < 0.7 * np.median(paper_m)
    assert np.quantile(robust_m, 0.95) < 0.7 * np.quantile(paper_m, 0.95)

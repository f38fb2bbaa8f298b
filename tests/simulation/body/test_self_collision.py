import numpy as np
import pytest

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.files import sha256_file
from hicp_lib.simulation.body.joints import pose_from_joints
from hicp_lib.simulation.body.model import REGIONS, load_body, pose_body
from hicp_lib.simulation.body.reach import reach
from hicp_lib.simulation.body.self_collision import collision_model, self_collision_distance_m
from tools import measure_sizes

BODY = load_body()


def gap(shape, joints) -> float:
    return self_collision_distance_m(BODY, collision_model(BODY, shape), pose_from_joints(joints))


def both(**joints) -> dict[str, float]:
    return {f"{side}_{name}": angle for side in ("left", "right") for name, angle in joints.items()}


@pytest.mark.parametrize("shape", BODY.shape_names)
def test_arms_held_out_are_clear_and_arms_through_the_body_are_not(shape):
    assert gap(shape, both(shoulder_abduction=1.2)) > 0.03
    person = collision_model(BODY, shape)
    centre, half = person.trunk_at(0.5)
    through = reach(BODY, shape, {}, "left", centre + [half[0] * 0.3, 0, 0])
    assert through is None or gap(shape, through) < -0.03


def test_hand_in_head_thigh_and_other_hand():
    head = collision_model(BODY, 0).centres_m[-1]
    assert gap(0, reach(BODY, 0, {}, "right", head + [0.03, -0.02, -0.05])) < -0.03
    assert gap(0, both(shoulder_abduction=-0.25)) < -0.02
    meet = np.array([0.35, 0.0, 0.3])
    joints = reach(BODY, 0, reach(BODY, 0, {}, "left", meet), "right", meet)
    assert gap(0, joints) < -0.03


def test_the_gap_does_not_depend_on_side():
    for joints in (
        {"left_elbow_flexion": 2.0},
        {"left_shoulder_flexion": 0.6, "left_shoulder_rotation": 1.0},
    ):
        mirrored = {name.replace("left", "right"): angle for name, angle in joints.items()}
        assert gap(3, joints) == pytest.approx(gap(3, mirrored), abs=2e-3)


def test_the_outline_is_that_of_the_body():
    for shape in BODY.shape_names:
        person = collision_model(BODY, shape)
        rest = BODY.vertices_m[BODY.shape_names.index(shape)]
        trunk = np.isin(BODY.regions, [REGIONS.index(name) for name in ("hips", "torso")])
        assert person.half_axes_m[:-1, 1].max() <= np.ptp(rest[trunk, 1]) / 2
        assert 0.05 < person.radii_m["thigh"] < 0.12 and 0.01 < person.radii_m["hand"] < 0.03
        low, high = person.trunk_at(0)[0], person.trunk_at(1)[0]
        assert low[2] < 0 < 0.25 < high[2]


def test_bending_forward_takes_the_trunk_along():
    joints = both(shoulder_abduction=1.2) | {"spine_flexion": 1.0}
    assert gap(9, joints) > 0.03
    posed = pose_body(BODY, 9, pose_from_joints(joints))
    assert posed.keypoints_m[17, 0] > 0.3


def test_sizes_are_those_of_the_body_model():
    kept = np.load(DATA_DIR / "body_sizes.npz")
    for number in (0, 41):
        shape = BODY.shape_names[number]
        found = measure_sizes.sizes(BODY, shape) | {"markers": measure_sizes.markers(BODY, shape)}
        for name, values in found.items():
            assert np.allclose(kept[name][number], values, atol=1e-6), name
    assert np.array_equal(kept["thinned"], measure_sizes.thinned(BODY))


def test_the_data_page_names_the_sizes_by_their_hash():
    page = (DATA_DIR / "README.md").read_text()
    assert sha256_file(DATA_DIR / "body_sizes.npz") in page

"""The tree of limbs, and measures of people against the body model itself."""

import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import INDEX, N_KEYPOINTS, NAMES
from hicp_lib.lifting.body_measures import LEVELS, PARENTS, found_parents, load_measures
from hicp_lib.simulation.body.model import load_body, pose_body
from hicp_lib.simulation.body.poses import sample_pose


def test_everything_hangs_on_the_right_shoulder():
    assert np.flatnonzero(PARENTS < 0).tolist() == [INDEX["right_shoulder"]]
    for keypoint in range(N_KEYPOINTS):
        steps, above = 0, keypoint
        while PARENTS[above] >= 0:
            above, steps = PARENTS[above], steps + 1
        assert above == INDEX["right_shoulder"] and steps == LEVELS[keypoint]
    assert NAMES[PARENTS[INDEX["left_index_1"]]] == "left_hand_root"
    assert NAMES[PARENTS[INDEX["right_index_4"]]] == "right_index_3"
    assert NAMES[PARENTS[INDEX["right_elbow"]]] == "right_shoulder"


def test_what_is_not_found_is_skipped():
    found = np.sort([INDEX[name] for name in ("left_shoulder", "left_wrist", "left_index_2", "right_wrist")])
    above = found_parents(found)
    names = {NAMES[k]: NAMES[found[a]] if a >= 0 else None for k, a in zip(found, above, strict=True)}
    assert names == {
        "left_shoulder": None, "right_wrist": None,
        "left_wrist": "left_shoulder", "left_index_2": "left_wrist",
    }  # fmt: skip
    assert len(found_parents(np.array([], int))) == 0


def test_people_in_new_poses_have_these_measures():
    body, measures, rng = load_body(), load_measures(), np.random.default_rng(7)
    pairs = np.flatnonzero(PARENTS >= 0), PARENTS[PARENTS >= 0]
    for shape in ("woman_54_01", "man_74_04", "woman_79_31", "man_29_13"):  # the last two are held out
        points = pose_body(body, shape, sample_pose(rng, body, "reaching", shape)).keypoints_m
        lengths_m = np.linalg.norm(points[pairs[0]] - points[pairs[1]], axis=1)
        assert (lengths_m < measures.farthest_m[pairs] * 1.05 + 0.005).all()
        assert (lengths_m > measures.closest_m[pairs] * 0.95 - 0.005).all()


def test_joints_lie_deeper_the_thicker_the_limb():
    deep = {name: load_measures().below_skin_m[INDEX[name]] for name in NAMES}
    order = ("left_index_4", "left_index_2", "left_wrist", "left_elbow", "left_shoulder")
    assert sorted(order, key=deep.get) == list(order)
    assert deep["left_index_4"] < 0.005 and 0.03 < deep["left_elbow"] < 0.06


def test_another_file_is_refused(tmp_path):
    path = tmp_path / "measures.npz"
    np.savez(path, below_skin_mm=np.zeros(136))
    for name in (path, tmp_path / "none.npz"):
        with pytest.raises(InputError, match="measure_body"):
            load_measures(name)

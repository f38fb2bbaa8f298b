"""What the robot looks like agrees with its skin, its links, and what it takes for itself."""

import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.robot import shape
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.segments import MARGIN_M, self_distance_m
from hicp_lib.robot.shape import SHAPE_FILE, robot_shape
from hicp_lib.robot.skin import read_skin
from tools.bake_robot import bake


def test_the_file_is_what_the_tool_makes():
    arrays = bake()
    with np.load(SHAPE_FILE) as stored:
        assert set(stored.files) == set(arrays)
        for name, array in arrays.items():
            close = np.allclose(stored[name], array, atol=1) if name == "vertices_20um" else None
            assert close if close is not None else np.array_equal(stored[name], array)


@pytest.mark.parametrize("turned", [0.0, 0.4])
def test_all_that_the_camera_may_see_is_taken_for_the_robot(icub, home, turned):
    """A keypoint on what is drawn is left out, whatever the posture."""
    posture = home.moved(
        "left", home.angles("left") + turned * np.array([0.3, 0, 0.5, 0, 1, 1, 0.5, 1, -0.5, 0.5])
    )
    with np.load(SHAPE_FILE) as stored:
        links = stored["links"][stored["vertex_link"]]
    robot = robot_shape(icub, posture)
    seen = np.unique(robot.triangles[~robot.unseen])
    assert set(links[seen]) == set(links) - {"root", "head head", "head neck_roll", "camera"}
    gaps_m = self_distance_m(icub, posture, robot.vertices_m[seen].astype(float))
    assert gaps_m.max() < MARGIN_M


def test_taxels_lie_on_the_covers(icub, home):
    robot = robot_shape(icub, home)
    corners_m = robot.vertices_m[robot.triangles].astype(float)
    middles_m = corners_m.mean(axis=1)
    normals = np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    taxels_m, outward = read_skin().in_root(icub, home)
    nearest = np.linalg.norm(taxels_m[:, None] - middles_m, axis=-1).argmin(axis=1)
    above_m = np.einsum("ij,ij->i", taxels_m - middles_m[nearest], normals[nearest])
    assert (
        np.einsum("ij,ij->i", outward, normals[nearest]) > 0.5
    ).mean() > 0.9  # beside a pad, its edge is as near
    assert np.abs(above_m).max() < 0.008 and np.median(np.abs(above_m)) < 0.003


def test_both_sides_are_alike_and_solid(icub):
    robot = robot_shape(icub, Posture())
    body = robot.vertices_m[np.unique(robot.triangles[~robot.unseen])]
    mirrored = body * [1, -1, 1]
    nearest = np.array([np.abs(body - point).sum(axis=1).min() for point in mirrored[::7]])
    assert nearest.max() < 1e-3
    a, b, c = robot.vertices_m[robot.triangles].astype(float).transpose(1, 0, 2)
    litres = 1000 * np.einsum("ij,ij->", a, np.cross(b, c)) / 6
    assert 8 < litres < 25  # outward triangles; inward ones would be negative


def test_a_limb_turns_with_its_link_and_the_rest_stays(icub):
    still, bent = Posture(), Posture(left_rad=np.array([0, 0, 0, 1.0, 0, 0, 0]))
    moved = (
        np.linalg.norm(robot_shape(icub, still).vertices_m - robot_shape(icub, bent).vertices_m, axis=1)
        > 1e-5
    )
    before = robot_shape(icub, still).vertices_m
    assert moved.any() and (before[moved][:, 1] < -0.05).all() and (before[moved][:, 2] < 0.06).all()


def test_a_file_that_is_none_is_told(tmp_path):
    (tmp_path / "icub_shape.npz").write_bytes(b"PK no")
    with pytest.raises(InputError, match="not the robot's shape.*bake_robot"):
        shape._stored(tmp_path / "icub_shape.npz")

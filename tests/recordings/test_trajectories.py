"""Trajectories of other tools: read by what the file shows, never one for another."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hicp_lib.core.errors import InputError
from hicp_lib.recordings.trajectories import read_pose_source, read_trajectory

N = 5
TIMES_S = 1403636580.0 + np.arange(N) / 20
T = np.tile(np.eye(4), (N, 1, 1))
T[:, :3, :3] = Rotation.random(N, random_state=0).as_matrix()
T[:, :3, 3] = np.random.default_rng(0).uniform(-2, 2, (N, 3))
QUATERNIONS = Rotation.from_matrix(T[:, :3, :3]).as_quat()  # scalar last


def _lines(rows, separator=" "):
    return "".join(separator.join(f"{x:.9f}" for x in row) + "\n" for row in rows)


def _log(poses=T, first=0):
    return "".join(f"{first + k} {first + k} {first + k + 1}\n{_lines(pose)}" for k, pose in enumerate(poses))


def _euroc(header, order, velocity=0.25):
    """EuRoC's ground truth: nanoseconds, position, quaternion in some order, velocity."""
    rows = [
        ",".join([f"{round(1e9 * t)}", *(f"{x:.9f}" for x in (*p, *q[order], velocity, 0, 0))])
        for t, p, q in zip(TIMES_S, T[:, :3, 3], QUATERNIONS, strict=True)
    ]
    return "\n".join([header, *rows]) + "\n"


EUROC = (
    "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], "
    "v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1]"
)
TUM = np.column_stack([TIMES_S, T[:, :3, 3], QUATERNIONS])
W_FIRST = TUM[:, [0, 1, 2, 3, 7, 4, 5, 6]]


@pytest.mark.parametrize(
    ("name", "text", "has_times"),
    [
        ("euroc.csv", _euroc(EUROC, [3, 0, 1, 2]), True),
        ("euroc.csv", _euroc(EUROC.replace("#timestamp", "#timestamp [ns]"), [3, 0, 1, 2]), True),
        ("euroc.csv", _euroc("timestamp_ns,p_x,p_y,p_z,q_w,q_x,q_y,q_z,v_x,v_y,v_z", [3, 0, 1, 2]), True),
        ("euroc.csv", _euroc("#time (ns), tx, ty, tz, qx, qy, qz, qw, vx, vy, vz", [0, 1, 2, 3]), True),
        ("poses.txt", _lines(TUM), True),
        ("poses.txt", "# timestamp tx ty tz qx qy qz qw\n" + _lines(TUM), True),
        ("poses.txt", "# timestamp tx ty tz qw qx qy qz\n" + _lines(W_FIRST), True),
        ("poses.txt", "# my robot\n# timestamp x y z qw qx qy qz\n" + _lines(W_FIRST), True),
        ("kitti.txt", _lines(T[:, :3].reshape(N, 12)), False),
        ("trajectory.log", _log(), False),
        ("trajectory.log", _log(first=1), False),
    ],
)
def test_every_layout_is_read_by_what_it_shows(tmp_path, name, text, has_times):
    path = tmp_path / name
    path.write_text(text)
    times_s, found = read_pose_source(path)
    np.testing.assert_allclose(found, T, atol=1e-7)
    np.testing.assert_allclose(times_s, TIMES_S if has_times else [], atol=1e-5)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("poses.txt", _lines(TUM * [1e9, *[1] * 7]), "looks like nanoseconds; expected seconds"),
        ("euroc.csv", _euroc(EUROC, [3, 0, 1, 2]).partition("\n")[2], "has no column 't_s'"),
        ("poses.txt", _lines(TUM, ", "), "is not a finite number"),
        (
            "poses.txt",
            _lines(TUM * [1e3, *[1] * 7]),
            "line 1: timestamp 1403636580000.000000000 looks like milli",
        ),
        ("poses.txt", _lines(T.reshape(N, 16)), "has 16 fields"),
        ("kitti.txt", _lines(np.column_stack([TIMES_S, T[:, :3].reshape(N, 12)])), "has 13 fields"),
        ("kitti.txt", _lines(2 * T[:, :3].reshape(N, 12)), "pose 1 is no rotation and translation"),
        ("kitti.txt", _lines((T * [[-1], [-1], [-1], [1]])[:, :3].reshape(N, 12)), "pose 1 is no rotation"),
        (
            "kitti.txt",
            _lines(T[:, :3].reshape(N, 12)).replace(".", ",", 1),
            "expected 12 numbers in every line",
        ),
        ("gt.log", _log()[:-20], "expected 'k k k+1'"),
        (
            "gt.log",
            _log().replace("1 1 2\n", "0 1 2\n"),
            "pose 2 is no rotation and translation, or not of the next",
        ),
        ("gt.log", _log(np.swapaxes(T, 1, 2)), "pose 1 is no rotation and translation"),
        ("poses.txt", "", "holds no lines"),
    ],
)
def test_what_is_no_trajectory_is_told_in_one_line(tmp_path, name, text, said):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError) as told:
        read_pose_source(path)
    message = str(told.value)
    assert said in message and message.startswith(str(path)) and "\n" not in message


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(InputError, match="give a file of camera poses"):
        read_trajectory(tmp_path / "nothing.log")

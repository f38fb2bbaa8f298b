"""Files of recordings with numbers and names that are none: each is refused in one line."""

from __future__ import annotations

import json
import os
import re
import warnings
from decimal import Decimal

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.inspection.inspect import inspect
from hicp_lib.mocap.clicking import read_clicks
from hicp_lib.mocap.registration import read_registration
from hicp_lib.recordings.c3d import write_c3d
from hicp_lib.recordings.check import check_recording
from hicp_lib.recordings.qualisys import MotionCapture, read_mocap, write_tsv
from hicp_lib.recordings.recording import open_recording, read_joints, read_truth
from hicp_lib.recordings.trajectories import read_pose_source, read_trajectory
from hicp_lib.recordings.tum import read_file_list
from hicp_lib.robot.kinematics import HEAD_JOINTS
from tests.recordings.c3d_files import make_c3d

LONG = "9" * 400
CLICKS = {
    "1e300": "1e300,a,1,1", "400 digits": f"{LONG},a,1,1", "20 digits": f"{10**20 - 1},a,1,1",
    "64 bits": f"{2**64 - 1},a,1,1", "infinite": "inf,a,1,1", "none": "nan,a,1,1", "negative": "-1,a,1,1",
    "a text below": "1,a,1,1\nx,a,1,1", "a pixel of 400 digits": f"1,a,{LONG},1", "hexadecimal": "0x1,a,1,1",
    "a pixel of 1e308": "1,a,1e308,-1e308", "a long name": f"1,{'a' * 300_000},1,1", "NUL": "1,a\0,1,1",
}  # fmt: skip
POSES = {
    "a place of 1e30": "1 1e30 0 0 0 0 0 1", "a time of 1e300": "1e300 0 0 0 0 0 0 1",
    "a quaternion of 1e19": "1 0 0 0 1e19 0 0 1", "not a number": "1 nan 0 0 0 0 0 1",
    "a time of 400 digits": f"{LONG} 0 0 0 0 0 0 1", "underscores": "1_0 0 0 0 0 0 0 1",
    "a million fields": "1 " * 10**6, "KITTI, 1e300": "1e300 0 0 0 0 1 0 0 0 0 1 0",
    "KITTI, far": "1 0 0 1e30 0 1 0 0 0 0 1 0", "log, far": "0 0 1\n1 0 0 1e30\n0 1 0 0\n0 0 1 0\n0 0 0 1",
    "log, infinite": "0 0 1\n1 0 0 inf\n0 1 0 0\n0 0 1 0\n0 0 0 1",
}  # fmt: skip
TRUTH = {
    "frame": ([2.0**63, 0], [-1, 0], [0.5, 1.0], [np.nan, 1], ["a", "b"],
              np.array([2**64 - 1, 0], np.uint64)),
    "x_m": ([1e300, 0], [np.inf, 0], ["a", "b"], [[1.0], [2.0]], [{"a": 1}, {"a": 2}], [b"a", b"b"],
            [Decimal("1e30"), Decimal(1)], [True, False], [None, None], pd.to_datetime(["2020", "2021"])),
    "keypoint": (["nose", "tail"], [1, 2], [["nose"], ["nose"]]),
}  # fmt: skip
SOUND = {"frame": [0, 1], "t_s": 0.0, "keypoint": "nose", "x_m": 0.0, "y_m": 0.0, "z_m": 0.0, "u_px": 0.0,
         "v_px": 0.0, "visible": 1}  # fmt: skip
CORNERS = np.eye(4).tolist()


def refused(path, read, *arguments):
    """One line that names the file, without a warning; `hicp inspect` neither takes it nor fails."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError) as told:
            read(*arguments)
        message = str(told.value)
        assert message.startswith(str(path)) and "\n" not in message and len(message) < 600
        try:
            assert inspect(path).problem
        except InputError:  # of no kind that is known
            pass


@pytest.mark.parametrize("case", CLICKS)
def test_clicks(small, case):
    path = small / "clicks.csv"
    path.write_text(f"frame,marker,u_px,v_px\n{CLICKS[case]}\n")
    with pytest.raises(InputError) as told:
        read_clicks(path, open_recording(small), ["a"])
    message = str(told.value)
    assert message.startswith(str(path)) and "\n" not in message and len(message) < 600


@pytest.mark.parametrize("case", POSES)
def test_poses(tmp_path, case):
    path = tmp_path / "poses.txt"
    path.write_text(POSES[case] + "\n")
    refused(path, read_trajectory, path)


@pytest.mark.parametrize("first", ["1e300,0", "1,1e300", "1,x", f"{LONG},0"])
def test_joint_angles(tmp_path, first):
    path, joints = tmp_path / "joints.csv", ",".join(f"{joint}_deg" for joint in HEAD_JOINTS)
    path.write_text(f"t_s,{joints}\n{first},0,0,0,0,0\n")
    refused(path, read_pose_source, path)


@pytest.mark.parametrize("value", [10**400, 1e300, 1e30, 10**19, float("nan"), None, True, "1", [1], {}])
@pytest.mark.parametrize("column", [0, 3])
def test_registrations(tmp_path, value, column):
    path, rows = tmp_path / "registration.json", [[*row] for row in CORNERS]
    rows[0][column] = value
    path.write_text(json.dumps({"T_base_mocap": rows}))
    refused(path, read_registration, path)


@pytest.mark.parametrize("rows", [[[1], [2, 3]], [[[[1]]]], "x", None, CORNERS[:3], [*CORNERS, [0, 0, 0, 1]]])
def test_registrations_of_another_shape(tmp_path, rows):
    path = tmp_path / "registration.json"
    path.write_text(json.dumps({"T_base_mocap": rows}))
    refused(path, read_registration, path)


@pytest.mark.parametrize(("column", "values"), [(name, of) for name, cases in TRUTH.items() for of in cases])
def test_truth(small, column, values):
    pd.DataFrame(SOUND | {column: values}).to_parquet(small / "truth.parquet")
    with pytest.raises(InputError) as told:
        read_truth(open_recording(small))
    message = str(told.value)
    assert message.startswith(f"{small}/truth.parquet") and "\n" not in message and len(message) < 600
    assert [str(finding) for finding in check_recording(small)] == [message]


@pytest.mark.parametrize("angles_rad", [["x"], [1e300], [True]])
def test_joints(small, angles_rad):
    pd.DataFrame({"frame": [0], "t_s": [0.0], "neck_rad": angles_rad}).to_parquet(small / "joints.parquet")
    with pytest.raises(InputError, match="joints.parquet: "):
        read_joints(open_recording(small))


@pytest.mark.parametrize(
    ("found", "put"),
    [
        ("1000.000", "1e30"), ("1000.000", "1e400"), ("1000.000", "inf"), ("1000.000", "abc"),
        ("1000.000", "10000001"), ("1000.000", LONG), ("FREQUENCY\t100", f"FREQUENCY\t{LONG}"),
        ("NO_OF_FRAMES\t3", f"NO_OF_FRAMES\t{LONG}"), ("0.01000", "1e300"), ("0.01000", LONG),
    ],
)  # fmt: skip
def test_motion_capture_as_text(tmp_path, found, put):
    path = tmp_path / "mocap.tsv"
    write_tsv(path, MotionCapture(np.arange(3) / 100, ("a", "b"), np.ones((3, 2, 3)), 100.0))
    path.write_text(path.read_text().replace(found, put))
    refused(path, read_mocap, path)


@pytest.mark.parametrize(
    "changed",
    [
        {"header": {"rate": np.inf}}, {"header": {"rate": np.nan}}, {"header": {"scale": np.nan}},
        {"scale": np.nan}, {"point": {"RATE": np.inf}}, {"point": {"RATE": 1e30}, "header": {"rate": 1e30}},
    ],
)  # fmt: skip
def test_rates_and_scales_of_c3d(tmp_path, changed):
    path = tmp_path / "mocap.c3d"
    path.write_bytes(make_c3d(np.full((4, 1, 3), 500.0), **changed))
    refused(path, read_mocap, path)


@pytest.mark.parametrize("far_m", [10_000.1, -1e27])
def test_markers_beyond_ten_kilometres(tmp_path, far_m):
    path, points_m = tmp_path / "mocap.c3d", np.ones((3, 2, 3))
    write_c3d(path, MotionCapture(np.arange(3) / 100, ("a", "b"), points_m, 100.0))
    assert np.allclose(read_mocap(path).points_m, 1)
    points_m[1, 1, 2] = far_m
    write_c3d(path, MotionCapture(np.arange(3) / 100, ("a", "b"), points_m, 100.0))
    with pytest.raises(InputError, match=re.escape(f"'b' in frame 2 is at {far_m:.6g} m; expected at most")):
        read_mocap(path)
    refused(path, read_mocap, path)


@pytest.mark.parametrize("name", ["../a.jpg", "/etc/a.jpg", "C:a.jpg", "a\x1b[31m.jpg", "a/../../b.jpg"])
def test_names_that_lead_out_of_a_recording(tmp_path, name):
    path = tmp_path / "rgb.txt"
    path.write_text(f"1 {name}\n")
    refused(path, read_file_list, path)


def test_an_image_of_two_times(tmp_path):
    path = tmp_path / "rgb.txt"
    path.write_text("1 a.jpg\n2 b.jpg\n3 a.jpg\n")
    refused(path, read_file_list, path)


@pytest.mark.parametrize("content", [[1], "x", None, {"intrinsic_matrix": 3, "fps": "x" * 10**6}])
def test_cameras_that_are_something_else(tmp_path, content):
    for name in ("color", "depth"):
        (tmp_path / name).mkdir()
    path = tmp_path / "camera_intrinsic.json"
    path.write_text(json.dumps(content))
    assert str(path) in inspect(tmp_path).problem and len(inspect(tmp_path).problem) < 600


def test_folders_with_what_is_no_file(tmp_path):
    os.mkfifo(tmp_path / "a.png")
    (tmp_path / "b.png").symlink_to("b.png")
    (tmp_path / "c.png").mkdir()
    for k in range(5000):
        (tmp_path / f"{k}.jpg").touch()
    facts = inspect(tmp_path)
    assert facts.kind == "folder of images" and "5003" in facts.says["images"]

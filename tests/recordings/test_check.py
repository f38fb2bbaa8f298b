"""`check_recording` names every problem of a damaged recording in a line, and none of a good one."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.recordings.check import check_recording
from hicp_lib.recordings.qualisys import MotionCapture, write_tsv
from hicp_lib.recordings.recording import open_recording
from hicp_lib.recordings.tum import read_poses, write_poses


def edit(path, change):
    path.write_text(change(path.read_text()))


def without_scale(small):
    edit(small / "camera.json", lambda text: json.dumps(json.loads(text) | {"depth_scale": None}))


def swap_lines(small):
    edit(small / "rgb.txt", lambda text: "\n".join(reversed(text.splitlines())))


def stretch_quaternion(small):
    edit(small / "groundtruth.txt", lambda text: text.replace("1.000000000", "1.200000000"))


def halve_an_image(small):
    cv2.imwrite(str(small / "rgb" / "000002.jpg"), np.zeros((12, 16, 3), np.uint8))


DAMAGES = {  # what is done, what the finding says, whether the recording is of no use
    "no poses": (lambda small: (small / "groundtruth.txt").unlink(), "groundtruth.txt: cannot be read", True),
    "no scale": (without_scale, "depth_scale", True),
    "order": (swap_lines, "is before the last one", True),
    "quaternion": (stretch_quaternion, "quaternion of length 1.2", True),
    "size": (
        halve_an_image,
        "16 x 12 pixels; its camera says 32 x 24; do not crop or bin (1 of 4 colour",
        True,
    ),
    "truth": (lambda small: (small / "truth.parquet").write_text("junk"), "cannot be read as a table", True),
    "image gone": (lambda small: (small / "depth/000001.png").unlink(), "1 of 4 listed are not", True),
    "late": (
        lambda small: edit(small / "depth.txt", lambda text: text.replace("100.1", "100.15")),
        "1 of 4 colour images have no depth image within 0.02 s",
        False,
    ),
    "clock": (
        lambda small: edit(small / "groundtruth.txt", lambda text: text.replace("100.", "1.")),
        "4 of 4 colour images have no pose",
        True,
    ),
    "units": (
        lambda small: edit(small / "camera.json", lambda text: text.replace("1000.0", "5.0")),
        "with depth_scale 5 the middle depth is 200 m",
        False,
    ),
    "millimetres": (
        lambda small: edit(small / "groundtruth.txt", lambda text: text.replace(" 0.01", " 500.")),
        "expected metres, not millimetres",
        False,
    ),
    "a repeated time": (
        lambda small: edit(small / "groundtruth.txt", lambda text: text + text.splitlines()[-1] + "\n"),
        "1 lines repeat the time before",
        False,
    ),
    "empty depth": (
        lambda small: cv2.imwrite(str(small / "depth/000000.png"), np.zeros((24, 32), np.uint16)),
        "1 of 4 depth images hold no depth",
        False,
    ),
}


def test_a_good_recording_has_no_findings(small):
    assert check_recording(small) == []


@pytest.mark.parametrize("name", DAMAGES)
def test_each_damage_is_told_in_one_line(small, name):
    damage, expected, is_fatal = DAMAGES[name]
    damage(small)
    findings = check_recording(small)
    assert len(findings) == 1 and findings[0].is_fatal == is_fatal
    assert expected in str(findings[0]) and "\n" not in str(findings[0])


def test_times_in_milliseconds_are_told(small):
    for name in ("rgb.txt", "depth.txt", "groundtruth.txt"):
        lines = [line.split(" ", 1) for line in (small / name).read_text().splitlines() if line[0] != "#"]
        (small / name).write_text("".join(f"{1e3 * (float(t) - 100):.3f} {rest}\n" for t, rest in lines))
    told = [str(finding) for finding in check_recording(small)]
    assert len(told) == 3 and all("0.01 frames per second" in line for line in told)
    assert all("these look like milliseconds" in line for line in told)


def test_several_damages_are_all_told(small):
    without_scale(small)
    (small / "groundtruth.txt").unlink()
    (small / "rgb/000000.jpg").unlink()
    assert len(check_recording(small)) == 3
    with pytest.raises(InputError):
        open_recording(small)


def write_mocap(small, start_s=99.5, duration_s=1.3):
    """Motion capture that covers the recording's images, 100.0 to 100.3 s; marker "wrist" is never seen."""
    times_s = start_s + np.arange(0, duration_s, 0.01)
    points_m = np.ones((len(times_s), 2, 3))
    points_m[:, 1] = np.nan
    write_tsv(small / "mocap.tsv", MotionCapture(times_s, ("elbow", "wrist"), points_m, 100.0))


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({}, []),
        ({"start_s": 0.0}, ["does not overlap with the images in time"]),
        ({"start_s": 100.0, "duration_s": 0.1}, ["lasts 0.09 s, the images 0.30 s"]),
    ],
)
def test_motion_capture_is_looked_at(small, arguments, expected):
    write_mocap(small, **arguments)
    *others, never = check_recording(small)
    assert "wrist never seen (1 of 2 markers)" in str(never) and not never.is_fatal
    assert len(others) == len(expected)
    assert all(
        text in str(finding) and not finding.is_fatal for text, finding in zip(expected, others, strict=True)
    )


def test_motion_capture_that_is_none_is_told(small):
    (small / "mocap.tsv").write_text("not motion capture")
    (finding,) = check_recording(small)
    assert "mocap.tsv" in str(finding) and finding.is_fatal


def test_a_folder_that_is_none(tmp_path):
    assert "is not a folder" in str(check_recording(tmp_path / "x")[0])


@pytest.mark.parametrize(
    ("scale", "is_told"), [(9900.0, False), (10100.0, True), (84.0, False), (83.0, True)]
)
def test_depth_is_plausible_from_a_decimetre_to_twelve_metres(small, scale, is_told):
    """1001.5 units are 0.101, 0.099, 11.9 and 12.07 m."""
    edit(small / "camera.json", lambda text: text.replace("1000.0", str(scale)))
    assert [finding.is_fatal for finding in check_recording(small)] == [False] * is_told


@pytest.mark.parametrize(("along_y_m", "is_told"), [(9.99, False), (10.01, True)])
def test_a_camera_is_within_ten_metres_of_the_base(small, along_y_m, is_told):
    times_s, T_base_cam = read_poses(small / "groundtruth.txt")
    T_base_cam[2, 1, 3] = along_y_m
    write_poses(small / "groundtruth.txt", times_s, T_base_cam)
    assert [finding.is_fatal for finding in check_recording(small)] == [False] * is_told


@pytest.mark.parametrize(
    ("start_s", "duration_s", "n_told"),
    [
        (99.0, 1.02, 1),
        (99.0, 0.9, 2),
        (100.31, 0.5, 2),
        (100.29, 0.5, 1),
        (100.0, 0.285, 1),
        (100.0, 0.265, 2),
    ],
)
def test_motion_capture_must_overlap_and_last_long_enough(small, start_s, duration_s, n_told):
    """The images last from 100.0 to 100.3 s; that a marker is never seen is told each time."""
    write_mocap(small, start_s, duration_s)
    assert len(check_recording(small)) == n_told


def test_depth_nowhere_is_fatal(small):
    for path in (small / "depth").iterdir():
        cv2.imwrite(str(path), np.zeros((24, 32), np.uint16))
    (finding,) = check_recording(small)
    assert "4 of 4 depth images hold no depth" in str(finding) and finding.is_fatal

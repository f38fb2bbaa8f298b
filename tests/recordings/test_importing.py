"""Imports: Open3D's folder and bag reader's frames become recordings; anything else is an InputError."""

from __future__ import annotations

import json
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from hicp_lib.core.camera import Camera
from hicp_lib.core.errors import InputError
from hicp_lib.recordings import importing as recording_import
from hicp_lib.recordings.check import check_recording
from hicp_lib.recordings.importing import import_bag, import_open3d, read_pose_source
from hicp_lib.recordings.recording import open_recording, read_depth_m, read_rgb
from hicp_lib.robot.kinematics import HEAD_JOINTS, load_icub

FILE = {"width": 32, "height": 24, "intrinsic_matrix": [30, 0, 0, 0, 31, 0, 15.5, 11.5, 1],
        "depth_scale": 5000, "fps": 20.0}  # fmt: skip
STILL = read_pose_source(None)


@pytest.fixture
def saved(tmp_path):
    """A folder as Open3D's recorder saves it: three frames, depth 1, 1.1 and 1.2 m."""
    folder = tmp_path / "saved"
    for name in ("color", "depth"):
        (folder / name).mkdir(parents=True)
    for k in range(3):
        cv2.imwrite(str(folder / f"color/{k:05d}.jpg"), np.full((24, 32, 3), (0, 0, 40 * k), np.uint8))
        cv2.imwrite(str(folder / f"depth/{k:05d}.png"), np.full((24, 32), 5000 + 500 * k, np.uint16))
    (folder / "intrinsic.json").write_text(json.dumps(FILE))
    return folder


def test_open3d_folders_become_recordings(saved, tmp_path):
    assert import_open3d(saved, tmp_path / "r", STILL) == 3
    assert check_recording(tmp_path / "r") == []
    recording = open_recording(tmp_path / "r")
    np.testing.assert_allclose(recording.times_s, [0, 0.05, 0.1])
    np.testing.assert_allclose(read_depth_m(recording, 2), 1.2, atol=1e-6)
    assert recording.rgb_paths[1].read_bytes() == (saved / "color/00001.jpg").read_bytes()
    assert recording.intrinsics.fy_px == 31 and (recording.T_base_cam == np.eye(4)).all()


def test_a_given_rate_counts(saved, tmp_path):
    import_open3d(saved, tmp_path / "r", STILL, rate_hz=5.0)
    np.testing.assert_allclose(open_recording(tmp_path / "r").times_s, [0, 0.2, 0.4])


def test_poses_of_a_text_file_keep_their_own_times(saved, tmp_path):
    (tmp_path / "poses.txt").write_text("0 0 0 0 0 0 0 1\n0.045 1 2 3 0 0 0 1\n")
    import_open3d(saved, tmp_path / "r", read_pose_source(tmp_path / "poses.txt"))
    recording = open_recording(tmp_path / "r")
    np.testing.assert_allclose(recording.times_s, [0, 0.05])
    np.testing.assert_allclose(recording.T_base_cam[1, :3, 3], [1, 2, 3])


def test_joint_angles_become_poses(tmp_path):
    angles_deg = np.array([5.0, -3, 10, -8, 2, 7])
    header = ",".join(["t_s", *(f"{joint}_deg" for joint in HEAD_JOINTS)])
    path = tmp_path / "joints.csv"
    path.write_text(f"{header}\n1.5,{','.join(map(str, angles_deg))}\n")
    times_s, T_base_cam = read_pose_source(path, "tilted")
    expected = load_icub().T_root_camera(np.radians(angles_deg), "tilted")
    np.testing.assert_allclose(T_base_cam[0], expected)
    assert times_s.tolist() == [1.5]
    path.write_text(path.read_text().replace("10.0", "ten"))
    with pytest.raises(InputError, match="row 1: expected numbers"):
        read_pose_source(path)
    path.write_text("t_s,torso_pitch_deg\n0,1\n")
    with pytest.raises(InputError, match="no column 'torso_roll_deg'"):
        read_pose_source(path)


@pytest.mark.parametrize(
    ("damage", "expected"),
    [
        (lambda d: (d / "intrinsic.json").unlink(), "intrinsic.json: cannot be read"),
        (lambda d: (d / "intrinsic.json").write_text(json.dumps({**FILE, "depth_scale": 0})), "depth_scale"),
        (lambda d: (d / "intrinsic.json").write_text(json.dumps({**FILE, "fps": 0})), "give --rate"),
        (lambda d: (d / "depth/00001.png").unlink(), "one depth image per colour"),
    ],
)
def test_folders_that_are_none_are_refused(saved, tmp_path, damage, expected):
    damage(saved)
    with pytest.raises(InputError, match=expected):
        import_open3d(saved, tmp_path / "r", STILL)
    assert not (tmp_path / "r").exists()


def test_what_is_no_bag_is_refused(tmp_path):
    with pytest.raises(InputError, match="is not there"):
        import_bag(tmp_path / "none.bag", tmp_path / "r", STILL)
    (tmp_path / "x.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(100))
    with pytest.raises(InputError, match="cannot be opened|without RealSense"):
        import_bag(tmp_path / "x.bag", tmp_path / "r", STILL)


class FakeReader:
    """Open3D's bag reader as its documentation describes it: three frames, the last one twice."""

    stamps_us = (1_000_000, 1_033_000, 1_033_000)

    def __init__(self, color_format: str):
        matrix = np.array([[30, 0, 15.5], [0, 31, 11.5], [0, 0, 1.0]])
        intrinsics = SimpleNamespace(intrinsic_matrix=matrix)
        self.metadata = SimpleNamespace(
            width=32, height=24, intrinsics=intrinsics, depth_scale=1000.0, color_format=color_format
        )
        self.k = -1

    def next_frame(self):
        self.k += 1
        color, depth = np.zeros((24, 32, 3), np.uint8), np.full((24, 32, 1), 1500 + self.k, np.uint16)
        color[..., 0] = 200
        return SimpleNamespace(color=FakeImage(color), depth=FakeImage(depth))

    def is_eof(self):
        return self.k >= len(self.stamps_us)

    def get_timestamp(self):
        return self.stamps_us[self.k]

    def close(self):
        pass


class FakeImage(SimpleNamespace):
    def __init__(self, values):
        super().__init__(as_tensor=lambda: SimpleNamespace(numpy=lambda: values))


@pytest.mark.parametrize(("color_format", "channel"), [("RGB8", 0), ("BGR8", 2)])
def test_frames_of_a_bag_become_a_recording(tmp_path, monkeypatch, color_format, channel):
    monkeypatch.setattr(recording_import, "_open_bag", lambda bag: FakeReader(color_format))
    assert import_bag(tmp_path / "x.bag", tmp_path / "r", STILL) == 2
    recording = open_recording(tmp_path / "r")
    np.testing.assert_allclose(recording.times_s, [1.0, 1.033])
    np.testing.assert_allclose(read_depth_m(recording, 1), 1.501, atol=1e-6)
    assert read_rgb(recording, 0)[10, 10].argmax() == channel
    assert recording.intrinsics == Camera(32, 24, 30, 31, 15.5, 11.5) and recording.depth_units_per_m == 1000


def test_a_bag_with_another_colour_format_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(recording_import, "_open_bag", lambda bag: FakeReader("YUYV"))
    with pytest.raises(InputError, match="colour is YUYV"):
        import_bag(tmp_path / "x.bag", tmp_path / "r", STILL)


@pytest.mark.parametrize("rate_hz", [0, -1.0, np.inf, np.nan])
def test_impossible_rates_are_refused(saved, tmp_path, rate_hz):
    with pytest.raises(InputError, match="expected frames per second"):
        import_open3d(saved, tmp_path / "r", STILL, rate_hz)


@pytest.mark.parametrize(("fps", "fits"), [(9999, True), (10_000, False), (True, False), ("20", False)])
def test_the_rate_of_a_file_is_a_number_of_frames_per_second(saved, tmp_path, fps, fits):
    (saved / "intrinsic.json").write_text(json.dumps({**FILE, "fps": fps}))
    if fits:
        assert import_open3d(saved, tmp_path / "r", STILL) == 3
    else:
        with pytest.raises(InputError, match="fps: expected frames per second"):
            import_open3d(saved, tmp_path / "r", STILL)


def test_the_times_of_joint_angles_increase(tmp_path):
    path = tmp_path / "joints.csv"
    header = ",".join(["t_s", *(f"{joint}_deg" for joint in HEAD_JOINTS)])
    path.write_text(f"{header}\n0,0,0,0,0,0,0\n0.1,0,0,0,0,0,0\n0.1,0,0,0,0,0,0\n")
    with pytest.raises(InputError, match="row 3: expected numbers, and a t_s after the one before"):
        read_pose_source(path)
    path.write_text(f"{header}\n")
    with pytest.raises(InputError, match="row 1: expected numbers"):
        read_pose_source(path)


def test_missing_and_empty_folders_are_told(saved, tmp_path):
    for path in (saved / "depth").iterdir():
        path.unlink()
    with pytest.raises(InputError, match="depth: holds no images"):
        import_open3d(saved, tmp_path / "r", STILL)
    (saved / "depth").rmdir()
    with pytest.raises(InputError, match="depth: is not a folder"):
        import_open3d(saved, tmp_path / "r", STILL)


def test_a_bag_without_frames_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(FakeReader, "stamps_us", ())
    monkeypatch.setattr(recording_import, "_open_bag", lambda bag: FakeReader("RGB8"))
    with pytest.raises(InputError, match="holds no frames"):
        import_bag(tmp_path / "x.bag", tmp_path / "r", STILL)

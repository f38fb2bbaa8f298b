"""Imports: Open3D's folders become recordings; anything else is an InputError."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.recordings.check import check_recording
from hicp_lib.recordings.importing import import_open3d
from hicp_lib.recordings.recording import open_recording, read_depth_m
from hicp_lib.recordings.trajectories import read_pose_source
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
    assert import_open3d(saved, tmp_path / "r", STILL) == (3, [])
    assert check_recording(tmp_path / "r") == []
    recording = open_recording(tmp_path / "r")
    np.testing.assert_allclose(recording.times_s, [0, 0.05, 0.1])
    np.testing.assert_allclose(read_depth_m(recording, 2), 1.2, atol=1e-6)
    assert recording.rgb_paths[1].read_bytes() == (saved / "color/00001.jpg").read_bytes()
    assert recording.intrinsics.fy_px == 31 and (recording.T_base_cam == np.eye(4)).all()


def test_a_given_rate_counts(saved, tmp_path):
    _, notes = import_open3d(saved, tmp_path / "r", STILL, rate_hz=5.0)
    assert notes == [f"{saved / 'intrinsic.json'}: fps is 20.0; 5 was given and counts"]
    np.testing.assert_allclose(open_recording(tmp_path / "r").times_s, [0, 0.2, 0.4])


def test_poses_of_a_text_file_keep_their_own_times(saved, tmp_path):
    (tmp_path / "poses.txt").write_text("0 0 0 0 0 0 0 1\n0.045 1 2 3 0 0 0 1\n")
    import_open3d(saved, tmp_path / "r", read_pose_source(tmp_path / "poses.txt"))
    recording = open_recording(tmp_path / "r")
    np.testing.assert_allclose(recording.times_s, [0, 0.05])
    np.testing.assert_allclose(recording.T_base_cam[1, :3, 3], [1, 2, 3])


def test_poses_without_times_are_those_of_the_frames(saved, tmp_path):
    T_base_cam = np.tile(np.eye(4), (3, 1, 1))
    T_base_cam[:, 0, 3] = [0, 1, 2]
    import_open3d(saved, tmp_path / "r", (np.zeros(0), T_base_cam))
    np.testing.assert_allclose(open_recording(tmp_path / "r").T_base_cam, T_base_cam)
    with pytest.raises(InputError, match="2 poses without times for 3 frames"):
        import_open3d(saved, tmp_path / "s", (np.zeros(0), T_base_cam[:2]))


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
    with pytest.raises(InputError, match="row 2: torso_yaw_deg is 'ten'; expected a number"):
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
        (lambda d: (d / "depth/00001.png").unlink(), "color/ holds 3 images, depth/ 2, not all"),
    ],
)
def test_folders_that_are_none_are_refused(saved, tmp_path, damage, expected):
    damage(saved)
    with pytest.raises(InputError, match=expected):
        import_open3d(saved, tmp_path / "r", STILL)
    assert not (tmp_path / "r").exists()


@pytest.mark.parametrize("rate_hz", [0, -1.0, np.inf, np.nan])
def test_impossible_rates_are_refused(saved, tmp_path, rate_hz):
    with pytest.raises(InputError, match="expected frames per second"):
        import_open3d(saved, tmp_path / "r", STILL, rate_hz)


@pytest.mark.parametrize(
    ("fps", "fits"), [(10_000, True), (10_001, False), (0, False), (True, False), ("20", False)]
)
def test_the_rate_of_a_file_is_a_number_of_frames_per_second(saved, tmp_path, fps, fits):
    (saved / "intrinsic.json").write_text(json.dumps({**FILE, "fps": fps}))
    if fits:
        assert import_open3d(saved, tmp_path / "r", STILL)[0] == 3
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


def renamed(folder, names):
    for kind, suffix in (("color", ".jpg"), ("depth", ".png")):
        for path, name in zip(sorted((folder / kind).iterdir()), names, strict=True):
            path.rename(folder / kind / f"{name}{suffix}")


@pytest.mark.parametrize("names", [("8", "9", "10"), ("frame9", "frame10", "frame11"), ("08", "9", "10")])
def test_names_sort_as_numbers(saved, tmp_path, names):
    renamed(saved, names)
    assert import_open3d(saved, tmp_path / "r", STILL) == (3, [])
    recording = open_recording(tmp_path / "r")
    assert [path.stem for path in recording.depth_paths] == list(names)
    np.testing.assert_allclose([read_depth_m(recording, k)[0, 0] for k in range(3)], [1, 1.1, 1.2], atol=1e-6)


@pytest.mark.parametrize(
    ("names", "times_s", "note"),
    [
        (("8", "9", "11"), [0, 0.05, 0.15], "1 numbers are missing among 3; times go by number"),
        (("1000", "2000", "3000"), [0, 0.05, 0.1], "names do not count frames"),
        (("a", "b", "c"), [0, 0.05, 0.1], None),
    ],
)
def test_missing_numbers_are_missing_times(saved, tmp_path, names, times_s, note):
    renamed(saved, names)
    _, notes = import_open3d(saved, tmp_path / "r", STILL)
    np.testing.assert_allclose(open_recording(tmp_path / "r").times_s, times_s)
    assert len(notes) == (note is not None) and (note is None or note in notes[0])


def test_a_number_is_there_once(saved, tmp_path):
    renamed(saved, ("1", "01", "2"))
    with pytest.raises(InputError, match="two images have the same number"):
        import_open3d(saved, tmp_path / "r", STILL)


def test_the_python_recorder_s_file_needs_rate_and_scale(saved, tmp_path):
    """As realsense_recorder.py writes it: another name, and neither fps nor depth_scale."""
    (saved / "intrinsic.json").rename(saved / "camera_intrinsic.json")
    sparse = {key: FILE[key] for key in ("width", "height", "intrinsic_matrix")}
    (saved / "camera_intrinsic.json").write_text(json.dumps(sparse))
    with pytest.raises(InputError, match="camera_intrinsic.json: depth_scale.*--depth-scale"):
        import_open3d(saved, tmp_path / "r", STILL)
    with pytest.raises(InputError, match="camera_intrinsic.json: fps.*--rate"):
        import_open3d(saved, tmp_path / "r", STILL, None, 5000.0)
    assert import_open3d(saved, tmp_path / "r", STILL, 20.0, 5000.0) == (3, [])
    np.testing.assert_allclose(read_depth_m(open_recording(tmp_path / "r"), 2), 1.2, atol=1e-6)
    (saved / "intrinsic.json").write_text(json.dumps(FILE))
    with pytest.raises(InputError, match="keep the one of these images"):
        import_open3d(saved, tmp_path / "s", STILL)


@pytest.mark.parametrize(
    ("changes", "scale", "note"),
    [
        ({"stream_length_usec": 150_000}, None, None),
        ({"stream_length_usec": 600_000}, None, "stream_length_usec is 0.60 s, 3 frames are 0.15 s"),
        ({"depth_scale": 1000}, 5000.0, "depth_scale is 1000; 5000 was given and counts"),
        ({"depth_scale": 1000}, 1000.0, None),
    ],
)
def test_what_is_said_twice_is_compared(saved, tmp_path, changes, scale, note):
    (saved / "intrinsic.json").write_text(json.dumps({**FILE, **changes}))
    _, notes = import_open3d(saved, tmp_path / "r", STILL, depth_units_per_m=scale)
    assert len(notes) == (note is not None) and (note is None or note in notes[0])


@pytest.mark.parametrize("kind", ["color/00001.jpg", "depth/00001.png"])
def test_images_of_another_size_and_damaged_ones_are_refused(saved, tmp_path, kind):
    cv2.imwrite(str(saved / kind), np.zeros((12, 32), np.uint16 if "depth" in kind else np.uint8))
    with pytest.raises(InputError, match=rf"{kind}: is 32 x 12 pixels; its camera says 32 x 24"):
        import_open3d(saved, tmp_path / "r", STILL)
    for content in (b"", b"no image"):
        (saved / kind).write_bytes(content)
        with pytest.raises(InputError, match=f"{kind}: is not an image"):
            import_open3d(saved, tmp_path / f"s{len(content)}", STILL)


COEFFICIENTS = [-0.3, 0.1, 0.001, -0.002, 0.0]


@pytest.mark.parametrize(
    "model", ["inverse_brown_conrady", "Brown Conrady", "distortion.brown_conrady", "plumb_bob"]
)
def test_distortion_is_undone(saved, tmp_path, model):
    """Depth of a slope seen through the lens: what an ideal camera sees is the slope where the ray goes."""
    column, row = np.meshgrid(np.arange(32.0), np.arange(24.0))
    matrix = np.array([[30, 0, 15.5], [0, 31, 11.5], [0, 0, 1]])
    seen = np.stack([column, row], -1).reshape(-1, 1, 2)
    ideal = cv2.undistortPoints(seen, matrix, np.array(COEFFICIENTS), P=matrix).reshape(24, 32, 2)
    cv2.imwrite(str(saved / "depth/00000.png"), np.rint(5000 + 100 * ideal[..., 0]).astype(np.uint16))
    said = {**FILE, "distortion_model": model, "coeffs": COEFFICIENTS}
    (saved / "intrinsic.json").write_text(json.dumps(said))
    _, notes = import_open3d(saved, tmp_path / "r", STILL)
    assert notes == [f"{saved / 'intrinsic.json'}: distortion undone"]
    depth_m = read_depth_m(open_recording(tmp_path / "r"), 0)
    error_m = np.abs(depth_m - (1 + column / 50))[np.isfinite(depth_m)]
    assert error_m.max() < 0.75 / 50 and np.isfinite(depth_m).mean() > 0.8  # half a pixel, and its neighbour
    raw = cv2.imread(str(saved / "depth/00000.png"), cv2.IMREAD_UNCHANGED) / 5000
    assert np.abs(raw - (1 + column / 50)).max() > 1 / 50


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ({"coeffs": [0.1, 0, 0, 0, 0]}, "distortion without a model"),
        ({"distortion_model": "kannala_brandt4", "coeffs": [0.1, 0, 0, 0]}, "distortion kannala_brandt4"),
        ({"distortion_model": "plumb_bob", "D": [0.1, 0]}, "4, 5 or 8 numbers"),
        ({"k1": 0.1, "k2": 0.0}, "expected a distortion_model and one list"),
        (
            {"dist_coeffs": [0.1, 0, 0, 0], "coeffs": [0.2, 0, 0, 0]},
            "expected a distortion_model and one list",
        ),
        ({"distortion": {"model": "x"}}, "expected a distortion_model and one list"),
        ({"coeffs": [0.1, "a"]}, "expected a distortion_model and one list"),
    ],
)
def test_distortion_that_cannot_be_undone_is_refused(saved, tmp_path, said, expected):
    (saved / "intrinsic.json").write_text(json.dumps({**FILE, **said}))
    with pytest.raises(InputError, match=f"intrinsic.json: .*{expected}"):
        import_open3d(saved, tmp_path / "r", STILL)


def test_a_recording_s_camera_has_no_distortion(saved, tmp_path):
    import_open3d(saved, tmp_path / "r", STILL)
    path = tmp_path / "r/camera.json"
    said = json.loads(path.read_text())
    path.write_text(json.dumps({**said, "coeffs": [0.0] * 5, "distortion_model": "none"}))
    assert check_recording(tmp_path / "r") == []
    path.write_text(json.dumps({**said, "coeffs": [0.1, 0, 0, 0], "distortion_model": "plumb_bob"}))
    assert "says that images are distorted" in str(check_recording(tmp_path / "r")[0])


@pytest.mark.parametrize(
    "name", ["my frame {}", "#{}", "a\n{}", "-{}", "bild-ä{}", "a\u2028{}", "a;{}", "a'\"{}"]
)
def test_whatever_images_are_called_the_recording_can_be_used(saved, tmp_path, name):
    renamed(saved, [name.format(k) for k in range(3)])
    assert import_open3d(saved, tmp_path / "r", STILL)[0] == 3
    assert check_recording(tmp_path / "r") == []
    recording = open_recording(tmp_path / "r")
    assert [round(float(np.nanmedian(read_depth_m(recording, k))), 3) for k in range(3)] == [1, 1.1, 1.2]


def test_images_larger_than_their_camera_are_refused(saved, tmp_path):
    cv2.imwrite(str(saved / "depth/00001.png"), np.zeros((11_000, 10_000), np.uint16))
    with pytest.raises(InputError, match=r"00001.png: 10000 x 11000 pixels"):
        import_open3d(saved, tmp_path / "r", STILL)
    assert not (tmp_path / "r/rgb.txt").exists()

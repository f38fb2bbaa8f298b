"""Bags of ROS become recordings, whatever writes and compresses them; what is not understood is refused."""

from __future__ import annotations

import os

import cv2
import numpy as np
import pytest

pytest.importorskip("rosbags")

from hicp_lib.cli import main as cli
from hicp_lib.core.camera import Camera
from hicp_lib.core.errors import InputError
from hicp_lib.recordings.bags import import_bag
from hicp_lib.recordings.check import check_recording
from hicp_lib.recordings.recording import open_recording, read_depth_m, read_rgb
from hicp_lib.robot.kinematics import HEAD_JOINTS, load_icub
from tests.recordings.ros_bags import (
    COLOR,
    DEPTH,
    HEIGHT,
    KINDS,
    OPTICAL,
    WIDTH,
    K,
    depth_mm,
    png,
    rgb,
    write_bag,
)


def imported(tmp_path, bag, **options):
    n, notes = import_bag(bag, tmp_path / "r", **options)
    recording = open_recording(tmp_path / "r")
    assert len(recording) <= n
    return recording, notes


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_becomes_a_recording(tmp_path, kind):
    recording, notes = imported(tmp_path, write_bag(tmp_path, kind))
    assert notes == [] and check_recording(tmp_path / "r") == []
    np.testing.assert_allclose(recording.times_s, [100, 100.1, 100.2, 100.3])  # headers', not of recording
    for k in range(4):
        np.testing.assert_allclose(read_depth_m(recording, k), 1.5 + k / 1000, atol=1e-6)
        np.testing.assert_allclose(read_rgb(recording, k)[10, 10].astype(int), rgb(k)[0, 0], atol=4)
    assert recording.intrinsics == Camera(WIDTH, HEIGHT, 30, 31, 15.5, 11.5)
    assert recording.depth_units_per_m == 1000


def test_a_single_file_of_a_ros2_bag_is_read(tmp_path):
    folder = write_bag(tmp_path, "mcap")
    assert import_bag(next(folder.glob("*.mcap")), tmp_path / "r")[0] == 4


def compressed_depth(m, t, k, header=bytes(12), form="16UC1; compressedDepth png"):
    return m.compressed(t, OPTICAL, form, header + png(depth_mm(k)))


def quantised_depth(m, t, k):
    """1.5 m + k mm as floats: 100 / (value - 2)."""
    depth_m = depth_mm(k) / 1000
    values = np.rint(100 / depth_m + 2).astype(np.uint16)
    header = bytes(4) + np.array([100, 2], "<f4").tobytes()
    return m.compressed(t, OPTICAL, "32FC1; compressedDepth", header + png(values))


def in_metres(m, t, k):
    return m.image(t, OPTICAL, "32FC1", depth_mm(k).astype(np.float32) / 1000)


def of_png(form):
    return lambda m, t, k: m.compressed(t, OPTICAL, form, png(rgb(k)[..., ::-1]))


@pytest.mark.parametrize(
    ("changes", "tolerance_m"),
    [
        ({"color": lambda m, t, k: m.image(t, OPTICAL, "bgr8", rgb(k)[..., ::-1].copy(), padding=5)}, 1e-6),
        ({"color": lambda m, t, k: m.image(t, OPTICAL, "rgba8", np.dstack([rgb(k), rgb(k)[..., 0]]))}, 1e-6),
        ({"color": of_png("rgb8; png compressed bgr8")}, 1e-6),
        ({"color": of_png("png")}, 1e-6),
        ({"depth": lambda m, t, k: m.image(t, OPTICAL, "16UC1", depth_mm(k), padding=6)}, 1e-6),
        ({"depth": lambda m, t, k: m.image(t, OPTICAL, "mono16", depth_mm(k), big=True)}, 1e-6),
        ({"depth": in_metres}, 1e-6),
        ({"depth": compressed_depth, "depth_topic": DEPTH + "/compressedDepth"}, 1e-6),
        ({"depth": quantised_depth, "depth_topic": DEPTH + "/compressedDepth"}, 0.012),
    ],
)  # fmt: skip
@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_encodings(tmp_path, kind, changes, tolerance_m):
    recording, _ = imported(tmp_path, write_bag(tmp_path, kind, **changes))
    assert len(recording) == 4
    for k in range(4):
        np.testing.assert_allclose(read_depth_m(recording, k), 1.5 + k / 1000, atol=tolerance_m)
        np.testing.assert_allclose(read_rgb(recording, k)[10, 10].astype(int), rgb(k)[0, 0], atol=4)


def test_no_depth_is_none(tmp_path):
    def holes(m, t, k):
        depth_m = depth_mm(k).astype(np.float32) / 1000
        depth_m[:3], depth_m[3:6] = np.nan, np.inf
        return m.image(t, OPTICAL, "32FC1", depth_m)

    recording, _ = imported(tmp_path, write_bag(tmp_path, depth=holes))
    depth_m = read_depth_m(recording, 0)
    assert np.isnan(depth_m[:6]).all() and np.isfinite(depth_m[6:]).all()


def twin(write, m):
    for k in range(4):
        write(COLOR + "/compressed", m.compressed(100 + k / 10, OPTICAL, "jpeg", png(rgb(9)[..., ::-1])), 102)
        write(
            "/camera/infra1/image_rect_raw", m.image(100 + k / 10, "ir", "mono8", rgb(k)[..., 0].copy()), 102
        )
        write("/camera/depth/image_rect_raw", m.image(100 + k / 10, "depth", "16UC1", depth_mm(k) + 9), 102)


def test_of_several_topics_the_raw_and_the_aligned_one_are_taken(tmp_path):
    recording, _ = imported(tmp_path, write_bag(tmp_path, more=twin))
    assert read_rgb(recording, 0)[0, 0, 2] < 5 and read_depth_m(recording, 0)[0, 0] == pytest.approx(1.5)


def second(write, m):
    write("/other/camera_info", m.info(OPTICAL), 102)
    for k in range(4):
        write("/other/image_raw", m.image(100 + k / 10, OPTICAL, "rgb8", rgb(9)), 102)
        write("/other/depth", m.image(100 + k / 10, OPTICAL, "16UC1", depth_mm(9)), 102)


def test_what_is_there_twice_is_asked_for(tmp_path):
    bag = write_bag(tmp_path, more=second)
    with pytest.raises(
        InputError, match=f"2 topics are of color; give one by --color-topic.*{COLOR} .rgb8.*/other"
    ):
        import_bag(bag, tmp_path / "r")
    with pytest.raises(InputError, match="2 topics are of depth; give one by --depth-topic"):
        import_bag(bag, tmp_path / "r", topics=(COLOR, None))
    with pytest.raises(InputError, match="/no is no topic of color"):
        import_bag(bag, tmp_path / "r", topics=("/no", None))
    assert not (tmp_path / "r").exists()
    recording, _ = imported(tmp_path, bag, topics=("/other/image_raw", "/other/depth"))
    assert read_depth_m(recording, 0)[0, 0] == pytest.approx(1.509)


unframed = {
    "color": lambda m, t, k: m.image(t, "", "rgb8", rgb(k)),
    "depth": lambda m, t, k: m.image(t, "", "16UC1", depth_mm(k)),
    "info": {"frame": ""},
    "depth_info": {"frame": "", "matrix": [9.0, *K[1:]]},
}


def test_depth_further_than_a_recording_allows_is_told(tmp_path):
    bag = write_bag(tmp_path, depth=lambda m, t, k: m.image(t + 0.03, OPTICAL, "16UC1", depth_mm(k)))
    recording, notes = imported(tmp_path, bag)
    assert len(recording) == 4 and ["up to 0.034 s from its colour" in note for note in notes] == [True]


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"info": None, "depth_info": None}, "has no CameraInfo beside it"),
        ({"info": {"frame": OPTICAL, "matrix": [0.0] * 9}}, "focal lengths 0 and 0; expected"),
        ({"info": {"frame": OPTICAL, "matrix": [1e7, *K[1:]]}}, "focal lengths 1e.07 and 31; expected"),
        ({"info": {"frame": OPTICAL, "size": (2**32 - 1, HEIGHT)}}, "4294967295 x 24 pixels; expected up to"),
        ({"info": {"frame": OPTICAL, "size": (64, 48)}}, "is 32 x 24 pixels; its camera says 64 x 48"),
        ({"info": {"frame": OPTICAL, "D": [0.1, 0, 0, 0], "model": "equidistant"}}, "distortion equidistant"),
        ({"info": {"frame": OPTICAL, "D": [0.1, 0, 0, 0], "model": ""}}, "distortion without a model"),
        ({"color": lambda m, t, k: m.image(t, OPTICAL, "bayer_rggb8", rgb(k)[..., 0].copy())}, "bayer_rggb8"),
        ({"depth": lambda m, t, k: m.image(t, "depth", "16UC1", depth_mm(k))}, "is not aligned"),
        ({"depth": lambda m, t, k: m.image(t + 9, OPTICAL, "16UC1", depth_mm(k))}, "no image of depth is"),
        (unframed, "neither has a frame"),
        ({"n": 0}, "0 topics are of color"),
        ({"color": lambda m, t, k: m.compressed(t, OPTICAL, "png", b"x" if k else png(rgb(0)))}, "cut off"),
    ],
)  # fmt: skip
def test_what_cannot_be_right_is_refused(tmp_path, changes, expected):
    bag = write_bag(tmp_path, **changes)
    with pytest.raises(InputError, match=expected) as told:
        import_bag(bag, tmp_path / "r")
    assert "\n" not in str(told.value) and str(bag) in str(told.value)
    assert not (tmp_path / "r/rgb.txt").exists()


def test_unpaired_and_repeated_images_are_counted(tmp_path):
    stamps_s = [100, 100.1, 100.1, 100.2, 100.26]

    def color(m, t, k):
        return m.image(stamps_s[k], OPTICAL, "rgb8", rgb(k))

    def depth(m, t, k):
        return m.image(stamps_s[k] + (0.5 if k == 3 else 0), OPTICAL, "16UC1", depth_mm(k))

    recording, notes = imported(tmp_path, write_bag(tmp_path, n=5, color=color, depth=depth))
    assert [round(read_depth_m(recording, k)[0, 0] * 1000) for k in range(len(recording))] == [1500, 1501]
    assert [read_rgb(recording, k)[0, 0, 2] // 10 for k in range(2)] == [0, 1]
    assert any("1 of 5 images do not increase" in note for note in notes)
    assert any(f"{COLOR}: 2 of 4 images have no partner" in note for note in notes)


K1 = [-0.3, 0.1, 0.001, -0.002, 0.0]


def test_distortion_is_undone(tmp_path):
    distorted = np.tile(1000 + 50 * np.arange(WIDTH, dtype=np.uint16), (HEIGHT, 1))
    matrix = np.reshape(K, (3, 3))

    def depth(m, t, k):
        return m.image(t, OPTICAL, "16UC1", distorted)

    infos = {"frame": OPTICAL, "D": K1}
    recording, notes = imported(tmp_path, write_bag(tmp_path, depth=depth, info=infos, depth_info=infos))
    assert sum("distortion undone" in note for note in notes) == 2
    found_m = np.nan_to_num(read_depth_m(recording, 0))
    pixels = np.stack(np.meshgrid(range(WIDTH), range(HEIGHT)), -1).reshape(-1, 2).astype(float)
    rays = np.column_stack([(pixels[:, 0] - K[2]) / K[0], (pixels[:, 1] - K[5]) / K[4], np.ones(len(pixels))])
    seen = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), matrix, np.array(K1))[0].reshape(-1, 2)
    column, row = np.rint(seen).astype(int).T
    is_inside = (column >= 0) & (column < WIDTH) & (row >= 0) & (row < HEIGHT)
    expected_m = np.zeros(len(pixels))
    expected_m[is_inside] = distorted[row[is_inside], column[is_inside]] / 1000
    is_sure = np.abs(seen - np.floor(seen) - 0.5).min(axis=1) > 0.05
    np.testing.assert_allclose(found_m.ravel()[is_sure], expected_m[is_sure], atol=1e-6)
    assert (found_m != distorted / 1000).any()


def test_rectified_images_have_the_projection_matrix(tmp_path):
    P = [40.0, 0, 16, 0, 0, 41, 12, 0, 0, 0, 1, 0]
    info = {"frame": OPTICAL, "D": K1, "P": P}
    topics = {"color_topic": "/camera/color/image_rect_color", "depth_topic": "/camera/depth/image_rect"}
    recording, notes = imported(tmp_path, write_bag(tmp_path, info=info, depth_info=info, **topics))
    assert recording.intrinsics == Camera(WIDTH, HEIGHT, 40, 41, 16, 12) and notes == []


def in_depth_frame(m, t, k):
    return m.image(t, "depth_optical", "16UC1", depth_mm(k))


def raw_depth(tmp_path, topic, times_s, step_m=0.0):
    """A bag with depth of another camera, and the transforms between both on a topic."""

    def more(write, m):
        for k, t in enumerate(times_s):
            write(topic, m.tf(t, "link", OPTICAL, (0.1, 0, 0)), 102)
            write(topic, m.tf(t, "link", "depth_optical", (0.5 + step_m * k, 0, -0.3)), 102)

    changes = {"depth": in_depth_frame, "depth_topic": "/camera/depth/image_raw", "more": more}
    return write_bag(tmp_path, depth_info={"frame": "depth_optical"}, **changes)


@pytest.mark.parametrize(("topic", "times_s"), [("/tf_static", [0]), ("/tf", [100.1, 100.3])])
def test_depth_of_another_camera_is_aligned_by_the_transforms(tmp_path, topic, times_s):
    recording, notes = imported(tmp_path, raw_depth(tmp_path, topic, times_s))
    assert any("aligned to" in note for note in notes)
    depth_m = read_depth_m(recording, 0)
    np.testing.assert_allclose(depth_m[np.isfinite(depth_m)], 1.2, atol=1e-6)
    left = 15.5 + 30 * ((0 - 0.5 - 15.5) / 30 * 1.5 + 0.4) / 1.2  # of the depth image, in colour
    assert np.isnan(depth_m[12, : int(left)]).all() and np.isfinite(depth_m[12, int(left) + 1 :]).all()


@pytest.mark.parametrize(
    ("times_s", "step_m", "expected"),
    [
        ([0], 0, "'depth_optical' is not known within 0.02 s of any image relative to 'color_optical'"),
        ([100.1, 100.2], 0.01, "'depth_optical' moves relative to 'color_optical'; .* is not aligned to"),
    ],
)
def test_depth_that_transforms_cannot_align_is_refused(tmp_path, times_s, step_m, expected):
    with pytest.raises(InputError, match=expected):
        import_bag(raw_depth(tmp_path, "/tf", times_s, step_m), tmp_path / "r")


TOPICS = ("/tf_static", "/tf")


def moving(write, m):
    """The camera 3 m above the base, and a body that goes 1 cm a frame and is turned by 90 degrees."""
    write("/tf_static", m.tf(0, "/body", OPTICAL, (0, 0, 3), (0, 0, np.sqrt(0.5), np.sqrt(0.5))), 102)
    for k in range(3):
        write("/tf", m.tf(100 + k / 10 + 0.005, "/base", "/body", (k / 100, 0, 0)), 102 + k)


def test_poses_are_those_of_the_transforms(tmp_path):
    recording, notes = imported(tmp_path, write_bag(tmp_path, "ros1", more=moving), base_frame="base")
    assert len(recording) == 3 and any("1 of 4 images have no pose" in note for note in notes)
    np.testing.assert_allclose(recording.T_base_cam[2, :3, 3], [0.02, 0, 3], atol=1e-9)
    np.testing.assert_allclose(recording.T_base_cam[2, :3, 0], [0, 1, 0], atol=1e-9)


def test_one_known_pose_is_that_of_its_image_only(tmp_path):
    def more(write, m):
        write("/tf", m.tf(100.1, "base", OPTICAL, (1, 2, 3)), 102)

    recording, notes = imported(tmp_path, write_bag(tmp_path, more=more), base_frame="base")
    assert recording.times_s.tolist() == [100.1] and any("3 of 4 images have no pose" in of for of in notes)
    np.testing.assert_allclose(recording.T_base_cam[:, :3, 3], [[1, 2, 3]], atol=1e-9)


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        (
            moving,
            "no transforms lead from 'color_optical' to 'odom'; frames there are: base, body, color_optical",
        ),
        (lambda write, m: [write("/tf", m.tf(1, p, "b", (0, 0, 0)), 1) for p in "ac"], "b is in a and in c"),
        (lambda write, m: write("/tf", m.tf(1, "odom", OPTICAL, (0, 0, 0)), 1), "no pose is within 0.02 s"),
        (
            lambda write, m: [write(t, m.tf(100, "odom", OPTICAL, (0, 0, 0)), 1) for t in TOPICS],
            "color_optical is static and moves in odom; keep one",
        ),
        (
            lambda write, m: [write(t, m.tf(100, "odom", OPTICAL, (0, 0, 0)), 1) for t in TOPICS[::-1]],
            "color_optical is static and moves in odom; keep one",
        ),
        *(
            (
                lambda write, m, xyz=xyz, xyzw=xyzw: write("/tf", m.tf(100, "odom", OPTICAL, xyz, xyzw), 1),
                "a transform of 'color_optical' to 'odom' is no rotation and translation",
            )
            for xyz, xyzw in (((0, 0, 0), (0, 0, 0, 0)), ((0, 0, np.nan), (0, 0, 0, 1)))
        ),
    ],
)
def test_transforms_that_lead_nowhere_are_refused(tmp_path, more, expected):
    with pytest.raises(InputError, match=expected):
        import_bag(write_bag(tmp_path, more=more), tmp_path / "r", base_frame="odom")


def test_poses_by_joint_angles(tmp_path):
    angles_rad = np.radians([5.0, -3, 10, -8, 2, 7])
    parts = {name: float(angle) for name, angle in zip(HEAD_JOINTS, angles_rad, strict=True)}

    def more(write, m):
        for k in range(4):
            t = 100 + k / 10
            write("/torso", m.joints(t, {n: a + k for n, a in list(parts.items())[:3]}), t + 2)
            write("/head", m.joints(t + 0.01, dict(list(parts.items())[3:])), t + 2)

    bag = write_bag(tmp_path, "ros1", more=more)
    recording, _ = imported(tmp_path, bag, joints_mount="tilted")
    expected = load_icub().T_root_camera(angles_rad + [1, 1, 1, 0, 0, 0], "tilted")
    np.testing.assert_allclose(recording.T_base_cam[1], expected, atol=1e-6)
    with pytest.raises(InputError, match="has no joint 'torso_pitch'; joints there are: none"):
        import_bag(write_bag(tmp_path, "mcap"), tmp_path / "s", joints_mount="level")


def test_joint_angles_in_degrees_are_refused(tmp_path):
    def more(write, m):
        write("/joints", m.joints(100, {name: 10.0 * k for k, name in enumerate(HEAD_JOINTS)}), 102)

    with pytest.raises(InputError, match=f"joint '{HEAD_JOINTS[1]}' is at 10; expected radians"):
        import_bag(write_bag(tmp_path, more=more), tmp_path / "r", joints_mount="level")


@pytest.mark.parametrize("kind", KINDS)
def test_damaged_bags_are_told_with_the_reason(tmp_path, capsys, kind):
    bag = write_bag(tmp_path, kind)
    path = bag if bag.is_file() else next(p for p in bag.iterdir() if p.suffix in (".db3", ".mcap"))
    whole = path.read_bytes()
    for n in (0, 40, len(whole) // 2):
        path.write_bytes(whole[:n])
        assert cli.run(["record", "import", "--bag", str(bag), str(tmp_path / "r")]) == 2
        captured = capsys.readouterr()
        assert captured.err.count("\n") == 1
        assert (
            f"{bag}: {'does not begin as' if kind == 'ros1' and not n else 'its reader gave up'}"
            in captured.err
        )
        assert not (tmp_path / "r/rgb.txt").exists()


def test_without_rosbags_the_extra_is_told(tmp_path, monkeypatch):
    (tmp_path / "rosbags").mkdir()
    (tmp_path / "rosbags" / "__init__.py").touch()
    (tmp_path / "x.bag").touch()
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    with pytest.raises(InputError, match=r"pip install '.\[bags\]'"):
        import_bag(tmp_path / "x.bag", tmp_path / "r")

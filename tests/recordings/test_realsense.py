"""What librealsense records from its software device: its older bags, its newer ones, and `record camera`."""

from __future__ import annotations

import lzma
from pathlib import Path
from threading import Event, Thread

import numpy as np
import pytest

pytest.importorskip("rosbags")

from hicp_lib.core.camera import Camera, deproject
from hicp_lib.core.errors import InputError
from hicp_lib.recordings import realsense
from hicp_lib.recordings.bags import import_bag
from hicp_lib.recordings.check import check_recording
from hicp_lib.recordings.realsense import read_joints_line, record_camera
from hicp_lib.recordings.recording import open_recording, read_depth_m, read_rgb
from hicp_lib.robot.kinematics import load_icub

OLDER = Path(__file__).with_name("data") / "librealsense-2.56.bag.xz"


@pytest.fixture
def camera():
    pytest.importorskip("pyrealsense2")
    from tests.recordings.software_camera import COEFFICIENTS, SoftwareCamera

    return SoftwareCamera(COEFFICIENTS)


def check_wall(folder: Path, n: int) -> None:
    """The wall is where the depth camera sees it, 1.5 m before it; times are the camera's."""
    R = np.array([[0.98106026, -0.17790219, -0.07662635], [0.17298739, 0.98266573, -0.06665532],
                  [0.08715574, 0.05213680, 0.99482930]])  # fmt: skip
    recording = open_recording(folder)
    assert check_recording(folder) == [] and recording.depth_units_per_m == 2000
    assert recording.intrinsics == Camera(40, 30, 35, 36, 19.5, 15)
    np.testing.assert_allclose(recording.times_s, 1_700_000_000 + np.arange(n) / 30, atol=2e-6)
    for k in range(n):
        depth_m = read_depth_m(recording, k)
        v, u = np.nonzero(np.isfinite(depth_m))
        points_m = deproject(recording.intrinsics, np.column_stack([u, v]), depth_m[v, u])
        wall_m = (points_m - [0.15, 0.02, -0.05]) @ R  # in the depth camera's frame
        assert len(u) > 500
        np.testing.assert_allclose(wall_m[:, 2], 1.5, atol=0.012)  # a pixel is 5 cm there, and turned
        assert abs(wall_m[:, 2].mean() - 1.5) < 0.002
        assert read_rgb(recording, k)[15, 20, 2] // 10 == k


def test_a_bag_of_older_releases_is_imported_and_aligned(tmp_path):
    (tmp_path / "x.bag").write_bytes(lzma.decompress(OLDER.read_bytes()))
    n, notes = import_bag(tmp_path / "x.bag", tmp_path / "r")
    assert n == 3 and len(notes) == 1 and "aligned to" in notes[0]  # the last frame, too
    check_wall(tmp_path / "r", 3)


def test_a_recording_is_made_of_what_the_camera_gives(tmp_path, camera):
    n, notes = record(tmp_path, camera, Thread(target=camera.feed, args=(5,)))
    assert n == 5 and [note.rpartition(": ")[2].split(" to ")[0] for note in notes] == [
        "aligned",
        "distortion undone",
    ]
    check_wall(tmp_path / "r", 5)
    (tmp_path / "r").rename(tmp_path / "moved")
    with pytest.raises(InputError, match="r.db3: is there already"):
        record_camera(tmp_path / "r", device=camera.device)


def test_lost_frames_are_counted(tmp_path, camera):
    feeder = Thread(target=camera.feed, args=(6,), kwargs={"lost": (2, 3)})
    _, notes = record(tmp_path, camera, feeder)
    assert sum("2 of 6 frames were lost while recording" in note for note in notes) == 2
    assert len(open_recording(tmp_path / "r")) == 4


def record(tmp_path, camera, feeder, lines=None, wait=None):
    """Recording with the software device, which is fed once both sensors run."""
    original = realsense.Event

    class Started(original):
        def wait(self, timeout=None):
            feeder.start()
            feeder.join()
            if wait is not None:
                wait()
            return super().wait(0.3)

    realsense.Event = Started
    try:
        return record_camera(
            tmp_path / "r", None, lines, "level", (40, 30), (32, 24), 30, device=camera.device
        )
    finally:
        realsense.Event = original


def test_ctrl_c_ends_a_recording_that_is_whole(tmp_path, camera):
    def interrupt():
        raise KeyboardInterrupt

    assert record(tmp_path, camera, Thread(target=camera.feed, args=(3,)), wait=interrupt)[0] == 3
    check_wall(tmp_path / "r", 3)


def test_joints_that_stream_in_are_poses(tmp_path, camera):
    block = Event()

    def lines():
        for k in range(4):
            yield f"{k} {1_700_000_000 + k / 30 + 0.002:.6f} (1 2 3 4 5 {k})\n"
        block.wait(20)

    record(tmp_path, camera, Thread(target=camera.feed, args=(4,)), lines())
    block.set()
    recording = open_recording(tmp_path / "r")
    expected = load_icub().T_root_camera(np.radians([1, 2, 3, 4, 5, 2]))
    np.testing.assert_allclose(recording.T_base_cam[2], expected, atol=1e-6)


def test_a_line_of_joints_that_is_none_is_told_and_the_bag_is_kept(tmp_path, camera):
    with pytest.raises(
        InputError, match="joints: expected lines of six.*'1 2 x'.*what was recorded is in .*r.db3"
    ):
        record(tmp_path, camera, Thread(target=camera.feed, args=(2,)), ["1 2 x\n"])
    assert import_bag(tmp_path / "r.db3", tmp_path / "r")[0] == 2


def test_joints_of_one_time_only_are_no_stream(tmp_path, camera):
    with pytest.raises(InputError, match="joints: lines of only one time arrived.*give --poses FILE"):
        record(tmp_path, camera, Thread(target=camera.feed, args=(2,)), ["7 5.0 1 2 3 4 5 6\n"] * 2)


@pytest.mark.parametrize("line", ["", "1 2 3 4 5", "1 2 3 4 5 nan", "1 2 3 4 5 6 7", "a b c d e f"])
def test_lines_that_are_none_are_refused(line):
    with pytest.raises(InputError, match="expected lines of six angles"):
        read_joints_line(line, 0.0)


def test_lines_without_a_time_have_that_of_their_arrival():
    assert read_joints_line("1, 2, 3, 4, 5, 6", 12.5) == (12.5, [1, 2, 3, 4, 5, 6])


def test_sizes_that_a_camera_lacks_and_no_camera_are_told(tmp_path, camera):
    with pytest.raises(InputError, match="no color of 640x480 at 30 Hz; it has 40x30 at 30 Hz"):
        record_camera(tmp_path / "r", device=camera.device)
    with pytest.raises(InputError, match="no RealSense is connected"):
        record_camera(tmp_path / "s")

"""Recordings: written, opened, read; frames without a partner are left out."""

from __future__ import annotations

import cv2
import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.recordings.recording import (
    first_frames,
    open_recording,
    read_depth_m,
    read_exact_depth_m,
    read_joints,
    read_rgb,
    read_simulation,
    read_truth,
)
from hicp_lib.recordings.writer import depth_name, rgb_name, write_rgb
from tests.recordings.conftest import SMALL, write_small
from tests.recordings.writing import RecordingWriter


def test_what_was_written_is_read(small):
    recording = open_recording(small)
    assert len(recording) == 4 and recording.intrinsics == SMALL and recording.depth_units_per_m == 1000
    np.testing.assert_allclose(recording.times_s, 100 + np.arange(4) / 10)
    np.testing.assert_allclose(recording.T_base_cam[:, 0, 3], np.arange(4) / 100)
    rgb, depth_m = read_rgb(recording, 2), read_depth_m(recording, 2)
    assert rgb.shape == (24, 32, 3) and abs(int(rgb[5, 5, 0]) - 20) <= 1
    assert depth_m.dtype == np.float32 and np.isnan(depth_m[0, 0])
    np.testing.assert_allclose(depth_m[1:], 1.002, atol=1e-6)


def test_a_real_recording_has_no_truth(small):
    recording = open_recording(small)
    assert recording.mocap_path is None
    assert read_truth(recording) is None and read_joints(recording) is None
    assert read_exact_depth_m(recording, 0) is None and read_simulation(recording) is None


def test_depth_too_far_for_the_file_or_not_finite_is_no_depth(tmp_path):
    writer = RecordingWriter(tmp_path / "r", SMALL, depth_units_per_m=5000)
    depth_m = np.full((24, 32), 13.0)  # 65535 / 5000 is 13.1
    depth_m[0, :4] = [13.2, np.inf, np.nan, -1]
    writer.add(0.0, np.zeros((24, 32, 3), np.uint8), depth_m, np.eye(4))
    writer.finish()
    read_m = read_depth_m(open_recording(tmp_path / "r"), 0)
    assert np.isnan(read_m[0, :4]).all() and np.isnan(read_m).sum() == 4


def test_frames_without_depth_or_pose_are_left_out(small):
    lines = (small / "depth.txt").read_text().splitlines()
    (small / "depth.txt").write_text("\n".join([lines[1], *lines[3:]]))  # no depth for frame 1
    poses = (small / "groundtruth.txt").read_text().splitlines()
    poses[3] = poses[3].replace("100.2", "100.219")
    (small / "groundtruth.txt").write_text("\n".join(poses[:-1]))  # no pose for frame 3
    recording = open_recording(small)
    np.testing.assert_allclose(recording.times_s, [100.0, 100.2])
    assert [path.stem for path in recording.depth_paths] == ["000000", "000002"]
    np.testing.assert_allclose(recording.T_base_cam[:, 0, 3], [0.0, 0.02])


def test_clocks_without_overlap_are_refused(small):
    poses = (small / "groundtruth.txt").read_text().replace("100.", "900.")
    (small / "groundtruth.txt").write_text(poses)
    with pytest.raises(InputError, match="no frame has colour, depth and pose"):
        open_recording(small)


@pytest.mark.parametrize("name", ["camera.json", "rgb.txt", "depth.txt", "groundtruth.txt"])
def test_a_missing_file_is_named(small, name):
    (small / name).unlink()
    with pytest.raises(InputError, match=name):
        open_recording(small)


def test_images_of_another_size_or_kind_are_refused(small):
    recording = open_recording(small)
    cv2.imwrite(str(recording.rgb_paths[0]), np.zeros((10, 32, 3), np.uint8))
    with pytest.raises(InputError, match="is 32 x 10 pixels; its camera says 32 x 24"):
        read_rgb(recording, 0)
    cv2.imwrite(str(recording.depth_paths[0]), np.zeros((24, 32), np.uint8))
    with pytest.raises(InputError, match="16-bit"):
        read_depth_m(recording, 0)
    recording.depth_paths[1].write_bytes(recording.depth_paths[1].read_bytes()[:60])
    with pytest.raises(InputError, match="000001.png"):
        read_depth_m(recording, 1)


def test_a_table_that_is_none_is_refused(small):
    (small / "truth.parquet").write_bytes(b"not parquet")
    with pytest.raises(InputError, match="truth.parquet: cannot be read as a table"):
        read_truth(open_recording(small))


def test_the_writer_refuses_what_would_not_be_a_recording(tmp_path):
    write_small(tmp_path / "r")
    with pytest.raises(InputError, match="is there already"):
        write_small(tmp_path / "r")
    writer = RecordingWriter(tmp_path / "other", SMALL)
    with pytest.raises(InputError, match="no frames"):
        writer.finish()
    assert not (tmp_path / "other" / "rgb.txt").exists()


def test_the_first_frames_are_a_recording(small):
    recording = open_recording(small)
    two = first_frames(recording, 2)
    assert len(two) == len(two.rgb_paths) == len(two.depth_paths) == len(two.T_base_cam) == 2
    assert len(first_frames(recording, 99)) == 4 and len(first_frames(recording, 1)) == 1
    with pytest.raises(InputError, match="0 frames were asked for"):
        first_frames(recording, 0)


def test_all_that_fits_16_bits_is_depth(tmp_path):
    writer = RecordingWriter(tmp_path / "r", SMALL)
    depth_m = np.full((24, 32), 65.535)
    depth_m[0, :3] = 65.5356, 0.0006, 0.0004
    writer.add(0.0, np.zeros((24, 32, 3), np.uint8), depth_m, np.eye(4))
    writer.finish()
    read_m = read_depth_m(open_recording(tmp_path / "r"), 0)
    np.testing.assert_allclose(read_m[1:], 65.535, rtol=1e-6)
    assert np.isnan(read_m[0, [0, 2]]).all() and read_m[0, 1] == pytest.approx(0.001)


def test_a_table_without_a_column_is_told(small):
    pd.DataFrame({"frame": [0], "t_s": [0.0]}).to_parquet(small / "truth.parquet")
    with pytest.raises(
        InputError, match="truth.parquet: has no column 'keypoint'; expected a table with frame"
    ):
        read_truth(open_recording(small))


def test_tables_end_with_the_frames(small):
    pd.DataFrame({"frame": [0, 3, 4], "t_s": [0.0, 0.3, 0.4]}).to_parquet(small / "joints.parquet")
    assert read_joints(open_recording(small))["frame"].tolist() == [0, 3]


def test_colour_is_stored_as_jpeg_of_quality_95(tmp_path):
    rgb = np.random.default_rng(0).integers(0, 255, (24, 32, 3), dtype=np.uint8)
    write_rgb(tmp_path / "0.jpg", rgb)
    _, expected = cv2.imencode(".jpg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 95])
    assert (tmp_path / "0.jpg").read_bytes() == expected.tobytes()


def test_frames_are_numbered_from_nothing_with_six_digits(small):
    assert (rgb_name(7), depth_name(1_234_567)) == ("rgb/000007.jpg", "depth/1234567.png")
    assert sorted(path.name for path in (small / "rgb").iterdir()) == [f"{k:06d}.jpg" for k in range(4)]

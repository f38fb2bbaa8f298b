"""Videos: every frame, in its order, with its time."""

import os

import cv2
import numpy as np
import pytest

from hicp_lib.core import video
from hicp_lib.core.errors import InputError
from hicp_lib.core.video import open_video

CODECS = {".avi": "MJPG", ".mp4": "mp4v", ".mov": "mp4v"}


def write_video(path, n: int = 6, rate_hz: float = 12.5) -> None:
    """Frames that get brighter, blue above red."""
    codec = cv2.VideoWriter_fourcc(*CODECS[path.suffix])
    writer = cv2.VideoWriter(str(path), codec, rate_hz, (64, 48))
    for i in range(n):
        frame = np.full((48, 64, 3), 40 * i, np.uint8)
        frame[:24, :, 0] = 255
        writer.write(frame)
    writer.release()


@pytest.mark.parametrize("suffix", CODECS)
def test_frames_come_in_order_with_their_times(tmp_path, suffix):
    path = tmp_path / f"clip{suffix}"
    write_video(path)
    n_frames, read = open_video(path)
    assert n_frames == 6
    times_s, frames = zip(*read, strict=True)
    assert times_s == pytest.approx(np.arange(6) / 12.5)
    for i, frame in enumerate(frames):
        assert frame.shape == (48, 64, 3)
        assert abs(frame[40, 32].astype(int) - 40 * i).max() < 12
        assert frame[8, 32, 2] > 200  # the third channel of RGB is blue


def test_what_is_no_video_is_refused(tmp_path):
    path = tmp_path / "clip.mp4"
    path.write_bytes(b"no video")
    with pytest.raises(InputError, match=r"clip\.mp4: is not a video"):
        open_video(path)


def test_a_decoder_that_crashes_is_told_in_one_line_after_the_frames_before(tmp_path, monkeypatch):
    path = tmp_path / "clip.avi"
    write_video(path)
    monkeypatch.setattr(video, "_decode", decode_and_crash)
    _, frames = open_video(path)
    assert next(frames)[1].shape == (48, 64, 3)
    with pytest.raises(InputError, match=r"clip\.avi: its reader gave up .SIGABRT."):
        next(frames)


def decode_and_crash(path):
    parts = video._decode(path)
    yield next(parts)
    yield next(parts)
    os.abort()

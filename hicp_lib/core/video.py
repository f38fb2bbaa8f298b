"""Reading videos frame by frame, decoded in a separate process, which a damaged file may end."""

import struct
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import regular_file
from hicp_lib.core.images import refuse_too_large
from hicp_lib.core.limited import limited_parts

SUFFIXES = (".avi", ".m4v", ".mkv", ".mov", ".mp4", ".webm")
_HEAD = struct.Struct("<d3q")  # time in seconds, height, width, channels


def open_video(path: str | Path) -> tuple[int, Iterator[tuple[float, np.ndarray]]]:
    """The frames of a video, rotated as players show them.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    n_frames : int
        Number of frames according to the file; 0 if unknown.
    frames : iterator of (float, array of shape (height, width, 3))
        Time in seconds, as the file gives it, and the image, RGB, uint8.

    Raises
    ------
    InputError
        If it cannot be read, or its frames have too many pixels; from the iterator, where decoding ends its
        process or takes too long.
    """
    parts = limited_parts(regular_file(path, "give a video"), _decode)
    n_frames = int(next(parts))

    def frames() -> Iterator[tuple[float, np.ndarray]]:
        for part in parts:
            time_s, *shape = _HEAD.unpack_from(part)
            bgr = np.frombuffer(part, np.uint8, offset=_HEAD.size).reshape(shape)
            yield time_s, cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB)

    return n_frames, frames()


def _decode(path: str) -> Iterator[bytes]:
    """How many frames a video says it has, then each with its time and shape."""
    capture = cv2.VideoCapture(path)
    if not capture.isOpened():
        raise InputError(f"{path}: is not a video that OpenCV can read; give .mp4, .avi or .mov, or images")
    sides_px = [int(capture.get(of)) for of in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)]
    refuse_too_large(path, *sides_px)
    yield b"%d" % max(0, int(capture.get(cv2.CAP_PROP_FRAME_COUNT)))
    while capture.grab():
        time_s = capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
        decoded, bgr = capture.retrieve()
        if not decoded:
            return
        yield _HEAD.pack(time_s, *bgr.shape) + bgr.tobytes()

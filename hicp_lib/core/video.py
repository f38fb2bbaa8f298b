"""Reading videos frame by frame."""

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import regular_file
from hicp_lib.core.images import refuse_too_large

SUFFIXES = (".avi", ".m4v", ".mkv", ".mov", ".mp4", ".webm")


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
        If it cannot be read, or its frames have too many pixels.
    """
    capture = cv2.VideoCapture(str(regular_file(path, "give a video")))
    if not capture.isOpened():
        raise InputError(f"{path}: is not a video that OpenCV can read; give .mp4, .avi or .mov, or images")

    sides_px = [int(capture.get(of)) for of in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)]
    refuse_too_large(path, *sides_px)

    def frames() -> Iterator[tuple[float, np.ndarray]]:
        while capture.grab():
            time_s = capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
            decoded, bgr = capture.retrieve()
            if not decoded:
                return
            yield time_s, cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB)

    return max(0, int(capture.get(cv2.CAP_PROP_FRAME_COUNT))), frames()

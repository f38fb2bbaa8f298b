"""Recordings written by tests frame by frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hicp_lib.core.camera import Camera
from hicp_lib.recordings.writer import write_recording


class RecordingWriter:
    """Collects frames; the folder is written by `finish`."""

    def __init__(self, folder: str | Path, intrinsics: Camera, depth_units_per_m: float = 1000.0):
        self.folder = folder
        self._to = folder, intrinsics, depth_units_per_m
        self._frames: list[tuple] = []
        self._poses: list[np.ndarray] = []

    def add(self, time_s, rgb, depth_m, T_base_cam) -> None:
        """Add a frame."""
        self._frames.append((time_s, rgb.copy(), depth_m.copy()))
        self._poses.append(np.array(T_base_cam, float))

    def finish(self) -> None:
        """Write all of them."""
        times_s = np.array([time_s for time_s, _, _ in self._frames])
        write_recording(*self._to, self._frames, (times_s, np.array(self._poses).reshape(-1, 4, 4)))

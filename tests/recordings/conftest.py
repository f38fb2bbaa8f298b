"""A small recording with known content."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hicp_lib.core.camera import Camera
from tests.recordings.writing import RecordingWriter

SMALL = Camera(width_px=32, height_px=24, fx_px=30.0, fy_px=31.0, cx_px=15.5, cy_px=11.5)


def write_small(folder: Path, n: int = 4) -> Path:
    """`n` frames at 10 Hz: uniform grey 10 k, depth 1 m + k mm with a hole, camera k cm along x."""
    writer = RecordingWriter(folder, SMALL)
    for k in range(n):
        depth_m = np.full((24, 32), 1 + k / 1000)
        depth_m[0, 0] = np.nan
        T_base_cam = np.eye(4)
        T_base_cam[0, 3] = k / 100
        writer.add(100 + k / 10, np.full((24, 32, 3), 10 * k, np.uint8), depth_m, T_base_cam)
    writer.finish()
    return folder


@pytest.fixture
def small(tmp_path) -> Path:
    """Folder of a small recording that may be damaged."""
    return write_small(tmp_path / "small")

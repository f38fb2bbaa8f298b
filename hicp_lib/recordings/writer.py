"""Writing recordings: images one by one, then the lists that make them a recording."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from hicp_lib.core.camera import Camera
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import write_bytes
from hicp_lib.core.images import write_png
from hicp_lib.recordings.camera_file import write_camera
from hicp_lib.recordings.recording import CAMERA_FILE, DEPTH_LIST, POSES_FILE, RGB_LIST
from hicp_lib.recordings.tum import write_file_list, write_poses

JPEG_QUALITY = 95
_MOST_UNITS = np.iinfo(np.uint16).max


class RecordingWriter:
    """Writes a recording frame by frame; the folder is one only after `finish`.

    Parameters
    ----------
    folder : new or empty
    depth_units_per_m : 1000 stores millimetres, up to 65 m

    Raises
    ------
    InputError
        If the folder holds files.
    """

    def __init__(self, folder: str | Path, intrinsics: Camera, depth_units_per_m: float = 1000.0):
        self.folder = Path(folder)
        refuse_used_folder(self.folder)
        self.intrinsics, self.depth_units_per_m = intrinsics, depth_units_per_m
        self._times_s: list[float] = []
        self._poses: list[np.ndarray] = []

    def add(self, time_s: float, rgb: np.ndarray, depth_m: np.ndarray, T_base_cam: np.ndarray) -> None:
        """Write a frame: RGB uint8 (height, width, 3), depth in metres (height, width), the pose (4, 4).

        Raises
        ------
        InputError
            If the time is not after the frame before, or a size is not that of the intrinsics.
        """
        if self._times_s and not time_s > self._times_s[-1]:
            raise InputError(f"{self.folder}: time {time_s} s is not after the frame before; sort frames")
        expected = (self.intrinsics.height_px, self.intrinsics.width_px)
        if rgb.shape[:2] != expected or depth_m.shape != expected:
            raise InputError(
                f"{self.folder}: colour {rgb.shape[:2]} and depth {depth_m.shape} (height, width) must both "
                f"be {expected}, as the intrinsics say"
            )
        index = len(self._times_s)
        write_rgb(self.folder / rgb_name(index), rgb)
        write_depth(self.folder / depth_name(index), depth_m, self.depth_units_per_m)
        self._times_s.append(float(time_s))
        self._poses.append(np.asarray(T_base_cam, float))

    def finish(self) -> None:
        """Write intrinsics, poses and the lists of images.

        Raises
        ------
        InputError
            If there are no frames.
        """
        if not self._times_s:
            raise InputError(f"{self.folder}: no frames were added; a recording has at least one")
        write_index(
            self.folder,
            self.intrinsics,
            self.depth_units_per_m,
            np.array(self._times_s),
            np.array(self._poses),
        )


def write_index(
    folder: str | Path,
    intrinsics: Camera,
    depth_units_per_m: float,
    times_s: np.ndarray,
    T_base_cam: np.ndarray,
) -> None:
    """Make numbered images of a folder a recording; `rgb.txt`, without which it is none, comes last.

    Parameters
    ----------
    times_s : array, shape (n,), of images 0 to n - 1, named by `rgb_name` and `depth_name`
    T_base_cam : array, shape (n, 4, 4)
    """
    folder, numbers = Path(folder), range(len(times_s))
    write_camera(folder / CAMERA_FILE, intrinsics, depth_units_per_m)
    write_poses(folder / POSES_FILE, times_s, T_base_cam)
    write_file_list(folder / DEPTH_LIST, times_s, [depth_name(k) for k in numbers])
    write_file_list(folder / RGB_LIST, times_s, [rgb_name(k) for k in numbers])


def rgb_name(index: int) -> str:
    """Name of colour image `index` in a recording's folder."""
    return f"rgb/{index:06d}.jpg"


def depth_name(index: int) -> str:
    """Name of depth image `index` in a recording's folder."""
    return f"depth/{index:06d}.png"


def write_rgb(path: str | Path, rgb: np.ndarray) -> None:
    """Write RGB uint8 (height, width, 3) as JPEG of high quality, whole or not at all."""
    bgr = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
    _, encoded = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    write_bytes(path, encoded.tobytes())


def write_depth(path: str | Path, depth_m: np.ndarray, depth_units_per_m: float) -> None:
    """Write depth in metres (height, width) as 16-bit PNG; 0 where it is not finite or does not fit."""
    units = np.rint(depth_m * depth_units_per_m)
    fits = (units >= 0) & (units <= _MOST_UNITS)  # what is not a number fits nowhere
    write_png(path, np.where(fits, units, 0).astype(np.uint16))


def refuse_used_folder(folder: Path) -> None:
    """Nothing is written over what is there.

    Raises
    ------
    InputError
        If `folder` is a file, or holds anything.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder}: is there already; give a new or empty folder")

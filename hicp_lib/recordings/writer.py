"""Write recordings: images one by one, then the lists that complete the recording."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import cv2
import numpy as np

from hicp_lib.core.camera import Camera
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import write_bytes
from hicp_lib.core.folders import refuse_used_folder
from hicp_lib.core.images import write_png
from hicp_lib.recordings.camera_file import write_camera
from hicp_lib.recordings.recording import CAMERA_FILE, DEPTH_LIST, POSES_FILE, RGB_LIST
from hicp_lib.recordings.tum import write_file_list, write_poses

JPEG_QUALITY = 95
_MOST_UNITS = np.iinfo(np.uint16).max

Poses = tuple[np.ndarray, np.ndarray]
"""Times (m,) in seconds and T_base_cam (m, 4, 4); one pose is for all, m without times for m frames, NaN
is an unknown one."""


def write_recording(
    folder: str | Path, intrinsics: Camera, depth_units_per_m: float,
    frames: Iterable[tuple[float, np.ndarray, np.ndarray]], poses: Poses,
) -> None:  # fmt: skip
    """Write a recording frame by frame; the folder becomes a valid recording only at the end.

    Parameters
    ----------
    folder : str or Path
        New or empty.
    intrinsics : Camera
        Of colour and of depth, which is aligned to it.
    depth_units_per_m : float
        1000 stores millimetres, up to 65 m.
    frames : iterable of (float, array, array)
        Time, colour of shape (height, width, 3) and depth in metres; non-finite depth is stored as missing.
    poses : tuple of array
        As of `write_index`.

    Raises
    ------
    InputError
        If the folder holds files, or there are no frames.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from hicp_lib.recordings.recording import open_recording
    >>> frame, camera = (0.0, np.zeros((24, 32, 3), np.uint8), np.ones((24, 32))), (30.0, 30.0, 15.5, 11.5)
    >>> with TemporaryDirectory() as folder:
    ...     write_recording(folder, Camera(32, 24, *camera), 1000, [frame], (np.zeros(1), np.eye(4)[None]))
    ...     len(open_recording(folder))
    1
    """
    folder = Path(folder)
    times_s: list[float] = []
    refuse_used_folder(folder)
    for k, (time_s, rgb, depth_m) in enumerate(frames):
        write_frame(folder, k, rgb, depth_m, depth_units_per_m)
        times_s.append(float(time_s))
    if not times_s:
        raise InputError(f"{folder}: no frames were added; a recording has at least one")
    write_index(folder, intrinsics, depth_units_per_m, np.array(times_s), poses)


def write_index(
    folder: str | Path,
    intrinsics: Camera,
    depth_units_per_m: float,
    times_s: np.ndarray,
    poses: Poses,
    names: tuple[Sequence[str], Sequence[str]] | None = None,
) -> None:
    """Write the lists and poses for images in a folder; `rgb.txt`, which completes the recording, comes last.

    Parameters
    ----------
    folder : str or Path
    intrinsics : Camera
    depth_units_per_m : float
    times_s : array, shape (n,)
        Of the images.
    poses : tuple of array
        Times (m,) and transforms from camera coordinates to the robot's base frame (m, 4, 4); a single one
        applies to all images, those with NaN are left out.
    names : (sequence of str, sequence of str), optional
        Files of colour and depth in the folder; by default named by `rgb_name` and `depth_name`.
    """
    folder, numbers = Path(folder), range(len(times_s))
    rgb, depth = names or ([rgb_name(k) for k in numbers], [depth_name(k) for k in numbers])
    write_camera(folder / CAMERA_FILE, intrinsics, depth_units_per_m)
    pose_s, T_base_cam = poses
    if len(pose_s) == 0 and len(T_base_cam) != len(times_s):
        wrong = f"{len(T_base_cam)} poses without times for {len(times_s)} frames"
        raise InputError(f"{folder}: {wrong}; expected one for each, or a file with times")
    if len(pose_s) < 2:
        pose_s, T_base_cam = times_s, np.broadcast_to(T_base_cam, (len(times_s), 4, 4))
    is_known = np.isfinite(T_base_cam).all(axis=(1, 2))
    write_poses(folder / POSES_FILE, pose_s[is_known], T_base_cam[is_known])
    write_file_list(folder / DEPTH_LIST, times_s, depth)
    write_file_list(folder / RGB_LIST, times_s, rgb)


def write_frame(
    folder: Path, index: int, rgb: np.ndarray, depth_m: np.ndarray, depth_units_per_m: float
) -> None:
    """Write the images of a frame, by `rgb_name` and `depth_name`.

    Parameters
    ----------
    folder : Path
        Of the recording.
    index : int
        The frame's number, from 0.
    rgb : array, shape (height, width, 3), dtype uint8
    depth_m : array, shape (height, width)
    depth_units_per_m : float
    """
    write_rgb(folder / rgb_name(index), rgb)
    write_depth(folder / depth_name(index), depth_m, depth_units_per_m)


def rgb_name(index: int) -> str:
    """Name of a colour image in a recording's folder.

    Parameters
    ----------
    index : int

    Returns
    -------
    str

    Examples
    --------
    >>> rgb_name(12), depth_name(12)
    ('rgb/000012.jpg', 'depth/000012.png')
    """
    return f"rgb/{index:06d}.jpg"


def depth_name(index: int) -> str:
    """Name of a depth image in a recording's folder.

    Parameters
    ----------
    index : int

    Returns
    -------
    str
    """
    return f"depth/{index:06d}.png"


def write_rgb(path: str | Path, rgb: np.ndarray) -> None:
    """Write colour as JPEG of high quality, whole or not at all.

    Parameters
    ----------
    path : str or Path
    rgb : array, shape (height, width, 3), dtype uint8
    """
    bgr = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
    _, encoded = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    write_bytes(path, encoded.tobytes())


def write_depth(path: str | Path, depth_m: np.ndarray, depth_units_per_m: float) -> None:
    """Write depth as 16-bit PNG; 0 where it is not finite or does not fit.

    Parameters
    ----------
    path : str or Path
    depth_m : array, shape (height, width)
    depth_units_per_m : float
    """
    units = np.rint(depth_m * depth_units_per_m)
    fits = (units >= 0) & (units <= _MOST_UNITS)  # NaN does not fit either
    write_png(path, np.where(fits, units, 0).astype(np.uint16))

"""Writing recordings: images one by one, then the lists that make them a recording."""

from collections.abc import Sequence
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

Poses = tuple[np.ndarray, np.ndarray]
"""Times (m,) in seconds and T_base_cam (m, 4, 4); one pose is for all, m without times in order."""


class RecordingWriter:
    """Writes a recording frame by frame; the folder is one only after `finish`.

    Parameters
    ----------
    folder : str or Path
        New or empty.
    intrinsics : Camera
        Of colour and of depth, which is aligned to it.
    depth_units_per_m : float, optional
        1000 stores millimetres, up to 65 m.

    Raises
    ------
    InputError
        If the folder holds files.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from hicp_lib.recordings.recording import open_recording
    >>> with TemporaryDirectory() as folder:
    ...     writer = RecordingWriter(folder, Camera(32, 24, 30.0, 30.0, 15.5, 11.5))
    ...     writer.add(0.0, np.zeros((24, 32, 3), np.uint8), np.ones((24, 32)), np.eye(4))
    ...     writer.finish()
    ...     len(open_recording(folder))
    1
    """

    def __init__(self, folder: str | Path, intrinsics: Camera, depth_units_per_m: float = 1000.0):
        self.folder = Path(folder)
        refuse_used_folder(self.folder)
        self.intrinsics, self.depth_units_per_m = intrinsics, depth_units_per_m
        self._times_s: list[float] = []
        self._poses: list[np.ndarray] = []

    def add(
        self, time_s: float, rgb: np.ndarray, depth_m: np.ndarray, T_base_cam: np.ndarray | None = None
    ) -> None:
        """Write a frame.

        Parameters
        ----------
        time_s : float
            After the frame before.
        rgb : array, shape (height, width, 3), dtype uint8
        depth_m : array, shape (height, width)
            Along the camera's axis; what is not finite is stored as no depth.
        T_base_cam : array, shape (4, 4), optional
            Camera coordinates to the robot's base frame; the camera's own when left out.
        """
        write_frame(self.folder, len(self._times_s), rgb, depth_m, self.depth_units_per_m)
        self._times_s.append(float(time_s))
        self._poses.append(np.eye(4) if T_base_cam is None else np.asarray(T_base_cam, float))

    def finish(self, poses: Poses | None = None) -> None:
        """Write intrinsics, poses and the lists of images.

        Parameters
        ----------
        poses : tuple of array, optional
            In place of those given with the frames.

        Raises
        ------
        InputError
            If there are no frames.
        """
        if not self._times_s:
            raise InputError(f"{self.folder}: no frames were added; a recording has at least one")
        times_s = np.array(self._times_s)
        poses = (times_s, np.array(self._poses)) if poses is None else poses
        write_index(self.folder, self.intrinsics, self.depth_units_per_m, times_s, poses)


def write_index(
    folder: str | Path,
    intrinsics: Camera,
    depth_units_per_m: float,
    times_s: np.ndarray,
    poses: Poses,
    names: tuple[Sequence[str], Sequence[str]] | None = None,
) -> None:
    """Make images of a folder a recording; `rgb.txt`, without which it is none, comes last.

    Parameters
    ----------
    folder : str or Path
    intrinsics : Camera
    depth_units_per_m : float
    times_s : array, shape (n,)
        Of the images.
    poses : tuple of array
        Times (m,) and camera coordinates to the robot's base frame (m, 4, 4); one is for all images.
    names : (sequence of str, sequence of str), optional
        Files of colour and of depth within the folder; by `rgb_name` and `depth_name` when left out.
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
    write_poses(folder / POSES_FILE, pose_s, T_base_cam)
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
    fits = (units >= 0) & (units <= _MOST_UNITS)  # what is not a number fits nowhere
    write_png(path, np.where(fits, units, 0).astype(np.uint16))


def refuse_used_folder(folder: Path) -> None:
    """Nothing is written over what is there.

    Parameters
    ----------
    folder : Path

    Raises
    ------
    InputError
        If `folder` is a file, or holds anything.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder}: is there already; give a new or empty folder")

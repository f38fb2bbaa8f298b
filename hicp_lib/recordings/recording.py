"""Recordings of an RGB-D camera on a robot, in the TUM RGB-D layout.

    rgb/ depth/                       images: colour as JPEG or PNG, depth as 16-bit PNG, 0 = none
    rgb.txt depth.txt                 timestamp and name of each image
    groundtruth.txt                   camera pose in the robot's base frame
    camera.json                       intrinsics, and `depth_scale`: units per metre
    mocap.tsv                         optional: motion capture as Qualisys exports it

Depth is aligned to colour: both images have the size and the intrinsics of `camera.json`. A
simulated recording holds more, as parquet and images: what is true (`read_truth`), the joints
(`read_joints`), depth without the sensor's errors (`read_exact_depth_m`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from hicp_lib.core.camera import Camera
from hicp_lib.core.errors import InputError
from hicp_lib.core.extras import needs
from hicp_lib.core.files import read_json
from hicp_lib.core.images import read_image
from hicp_lib.recordings.camera_file import read_camera
from hicp_lib.recordings.tum import MAX_DIFFERENCE_S, associate, read_file_list, read_poses

CAMERA_FILE, RGB_LIST, DEPTH_LIST, POSES_FILE = "camera.json", "rgb.txt", "depth.txt", "groundtruth.txt"
MOCAP_FILE = "mocap.tsv"
TRUTH_FILE, JOINTS_FILE, SIMULATION_FILE = "truth.parquet", "joints.parquet", "simulation.json"
EXACT_DEPTH_DIR = "exact_depth"
_TRUTH_COLUMNS = ("frame", "t_s", "keypoint", "x_m", "y_m", "z_m", "u_px", "v_px", "visible")


@dataclass(frozen=True)
class Recording:
    """The frames of a recording that have colour, depth and pose within 0.02 s.

    Attributes
    ----------
    folder : where it lies
    intrinsics : of colour and of depth, which is aligned to it
    depth_units_per_m : of the depth images
    times_s : array, shape (n,), the colour images' times, increasing
    rgb_paths, depth_paths : n paths each
    T_base_cam : array, shape (n, 4, 4), camera coordinates to the robot's base frame
    mocap_path : motion capture as exported, None where there is none
    """

    folder: Path
    intrinsics: Camera
    depth_units_per_m: float
    times_s: np.ndarray
    rgb_paths: list[Path]
    depth_paths: list[Path]
    T_base_cam: np.ndarray
    mocap_path: Path | None

    def __len__(self) -> int:
        return len(self.times_s)


def open_recording(folder: str | Path) -> Recording:
    """Open a recording; images are read later, one by one.

    Raises
    ------
    InputError
        If a file is missing or malformed, or no frame has colour, depth and pose.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: is not a folder; give the folder of a recording")
    intrinsics, units = read_camera(folder / CAMERA_FILE)
    rgb_s, rgb_names = read_file_list(folder / RGB_LIST)
    depth_s, depth_names = read_file_list(folder / DEPTH_LIST)
    pose_s, T_base_cam = read_poses(folder / POSES_FILE)
    rgb, depth, pose = associate_frames(rgb_s, depth_s, pose_s)
    if len(rgb) == 0:
        raise InputError(
            f"{folder}: no frame has colour, depth and pose within {MAX_DIFFERENCE_S:g} s; "
            "bring their clocks together"
        )
    mocap = folder / MOCAP_FILE
    return Recording(
        folder=folder,
        intrinsics=intrinsics,
        depth_units_per_m=units,
        times_s=rgb_s[rgb],
        rgb_paths=[folder / rgb_names[k] for k in rgb],
        depth_paths=[folder / depth_names[k] for k in depth],
        T_base_cam=T_base_cam[pose],
        mocap_path=mocap if mocap.is_file() else None,
    )


def first_frames(recording: Recording, n: int) -> Recording:
    """The first `n` frames of a recording, all if it has fewer.

    Raises
    ------
    InputError
        If `n` is not at least 1.
    """
    if n < 1:
        raise InputError(f"{recording.folder}: {n} frames were asked for; expected at least 1")
    return replace(
        recording,
        times_s=recording.times_s[:n],
        rgb_paths=recording.rgb_paths[:n],
        depth_paths=recording.depth_paths[:n],
        T_base_cam=recording.T_base_cam[:n],
    )


def associate_frames(
    rgb_s: np.ndarray, depth_s: np.ndarray, pose_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows of colour, depth and poses that belong together, three arrays of shape (n,)."""
    rgb, depth = associate(rgb_s, depth_s)
    with_pose, pose = associate(rgb_s[rgb], pose_s)
    return rgb[with_pose], depth[with_pose], pose


def read_rgb(recording: Recording, k: int) -> np.ndarray:
    """Colour image of frame `k`: RGB uint8, shape (height, width, 3).

    Raises
    ------
    InputError
        If it cannot be read, or its size is not that of `camera.json`.
    """
    image = read_image(recording.rgb_paths[k])
    _check_size(recording.rgb_paths[k], image, recording.intrinsics)
    return image


def read_depth_m(recording: Recording, k: int) -> np.ndarray:
    """Depth along the camera's axis of frame `k`: float32, shape (height, width), NaN where there is none.

    Raises
    ------
    InputError
        If it cannot be read, is not a 16-bit image of one channel, or has another size than `camera.json`.
    """
    return _read_depth_m(recording, recording.depth_paths[k])


def read_exact_depth_m(recording: Recording, k: int) -> np.ndarray | None:
    """Depth as `read_depth_m`, without the sensor's errors; None in a recording that is not simulated."""
    path = recording.folder / EXACT_DEPTH_DIR / recording.depth_paths[k].name
    return _read_depth_m(recording, path) if path.is_file() else None


def read_truth(recording: Recording) -> pd.DataFrame | None:
    """Where the keypoints truly are; None in a recording that is not simulated.

    Columns: frame (row of the recording), t_s, keypoint (Halpe name), x_m, y_m, z_m (base frame),
    u_px, v_px, visible (0 outside the image, 1 occluded, 2 visible).

    Raises
    ------
    InputError
        If the file is there but is not such a table.
    """
    return _read_table(recording, TRUTH_FILE, _TRUTH_COLUMNS)


def read_joints(recording: Recording) -> pd.DataFrame | None:
    """Joint angles of the robot: frame, t_s, and one column `<joint>_rad` each; None where not recorded.

    Raises
    ------
    InputError
        If the file is there but is not such a table.
    """
    return _read_table(recording, JOINTS_FILE, ("frame", "t_s"))


def read_simulation(recording: Recording) -> dict | None:
    """What a simulated recording was made with; None where it was not simulated."""
    path = recording.folder / SIMULATION_FILE
    return read_json(path) if path.is_file() else None


def _read_depth_m(recording: Recording, path: Path) -> np.ndarray:
    try:
        content = np.fromfile(path, np.uint8)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); expected a depth image") from None
    units = cv2.imdecode(content, cv2.IMREAD_UNCHANGED) if content.size else None
    if units is None or units.dtype != np.uint16 or units.ndim != 2:
        raise InputError(f"{path}: is not a whole 16-bit image of one channel; write depth as 16-bit PNG")
    _check_size(path, units, recording.intrinsics)
    depth_m = units * np.float32(1 / recording.depth_units_per_m)
    depth_m[units == 0] = np.nan
    return depth_m


def _check_size(path: Path, image: np.ndarray, intrinsics: Camera) -> None:
    height, width = image.shape[:2]
    if (width, height) != (intrinsics.width_px, intrinsics.height_px):
        expected = f"{intrinsics.width_px} x {intrinsics.height_px}"
        raise InputError(f"{path}: is {width} x {height} pixels; {CAMERA_FILE} says {expected}")


def _read_table(recording: Recording, name: str, columns: tuple[str, ...]) -> pd.DataFrame | None:
    path = recording.folder / name
    if not path.is_file():
        return None
    with needs("analysis"):
        import pyarrow as pa
        import pyarrow.parquet as pq
    try:
        table = pq.read_table(path).to_pandas()
    except (OSError, pa.ArrowException) as error:
        raise InputError(f"{path}: is not a Parquet table ({str(error).splitlines()[0]})") from None
    missing = [name for name in columns if name not in table.columns]
    if missing:
        raise InputError(f"{path}: has no column {missing[0]!r}; expected {', '.join(columns)}")
    return table[table["frame"] < len(recording)].reset_index(drop=True)

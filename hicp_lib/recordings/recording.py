"""Recordings of an RGB-D camera on a robot, in the TUM RGB-D layout.

    rgb/ depth/                       images: colour as JPEG or PNG, depth as 16-bit PNG, 0 = none
    rgb.txt depth.txt                 timestamp and name of each image
    groundtruth.txt                   camera pose in the robot's base frame
    camera.json                       intrinsics, and `depth_scale`: units per metre
    mocap.tsv                         optional: motion capture as Qualisys exports it

Depth is aligned to colour: both images have the size and the intrinsics of `camera.json`. A simulated
recording also contains, as Parquet and images, the ground truth (`read_truth`), the joints (`read_joints`),
and depth without the sensor's errors (`read_exact_depth_m`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from hicp_lib.core.camera import Camera
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_bytes, read_json
from hicp_lib.core.images import decode, image_header, read_image
from hicp_lib.core.keypoints import NAMES
from hicp_lib.core.tables import read_table
from hicp_lib.recordings.camera_file import read_camera
from hicp_lib.recordings.tum import MAX_DIFFERENCE_S, associate, read_file_list, read_poses

CAMERA_FILE, RGB_LIST, DEPTH_LIST, POSES_FILE = "camera.json", "rgb.txt", "depth.txt", "groundtruth.txt"
MOCAP_FILE = "mocap.tsv"
TRUTH_FILE, JOINTS_FILE, SIMULATION_FILE = "truth.parquet", "joints.parquet", "simulation.json"
EXACT_DEPTH_DIR = "exact_depth"
PER_FRAME = ("times_s", "rgb_paths", "depth_paths", "T_base_cam")
"""Attributes of a recording with an entry for each frame."""
_MOST = 1e9  # of numbers in tables
_TRUTH_COLUMNS = ("frame", "t_s", "keypoint", "x_m", "y_m", "z_m", "u_px", "v_px", "visible")


@dataclass(frozen=True)
class Recording:
    """The frames of a recording that have colour, depth and pose within 0.02 s.

    Attributes
    ----------
    folder : Path
        Its folder.
    intrinsics : Camera
        Of colour and of depth, which is aligned to it.
    depth_units_per_m : float
        Of the depth images.
    times_s : array, shape (n,)
        The colour images' times, increasing.
    rgb_paths, depth_paths : list of Path
        n of them each.
    T_base_cam : array, shape (n, 4, 4)
        Camera coordinates to the robot's base frame.
    mocap_path : Path or None
        Exported motion capture, None if there is none.
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

    Parameters
    ----------
    folder : str or Path

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        If a file is missing or malformed, or no frame has colour, depth and pose.

    Examples
    --------
    >>> open_recording("nowhere")
    Traceback (most recent call last):
    hicp_lib.core.errors.InputError: nowhere: is not a folder; give the folder of a recording
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: is not a folder; give the folder of a recording")
    intrinsics, depth_units_per_m = read_camera(folder / CAMERA_FILE)
    rgb_s, rgb_names = read_file_list(folder / RGB_LIST)
    depth_s, depth_names = read_file_list(folder / DEPTH_LIST)
    pose_s, T_base_cam = read_poses(folder / POSES_FILE)
    rgb, depth, pose = associate_frames(rgb_s, depth_s, pose_s)
    if len(rgb) == 0:
        none = f"no frame has colour, depth and pose within {MAX_DIFFERENCE_S:g} s"
        raise InputError(f"{folder}: {none}; bring their clocks together")
    rgb_paths, depth_paths = [folder / rgb_names[k] for k in rgb], [folder / depth_names[k] for k in depth]
    mocap = (folder / MOCAP_FILE, (folder / MOCAP_FILE).with_suffix(".c3d"))
    return Recording(
        folder, intrinsics, depth_units_per_m, rgb_s[rgb], rgb_paths, depth_paths, T_base_cam[pose],
        mocap_path=next(filter(Path.is_file, mocap), None),
    )  # fmt: skip


def first_frames(recording: Recording, n: int) -> Recording:
    """The first frames of a recording, all if it has fewer.

    Parameters
    ----------
    recording : Recording
    n : int
        At least 1.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        If `n` is not at least 1.
    """
    if n < 1:
        raise InputError(f"{recording.folder}: {n} frames were asked for; expected at least 1")
    return replace(recording, **{name: getattr(recording, name)[:n] for name in PER_FRAME})


def associate_frames(
    rgb_s: np.ndarray, depth_s: np.ndarray, pose_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Associate colour images, depth images and poses.

    Parameters
    ----------
    rgb_s, depth_s, pose_s : array
        Their times, increasing.

    Returns
    -------
    rgb, depth, pose : array of int, shape (n,)
        Rows of each, in the order of time.

    Examples
    --------
    >>> associate_frames(np.array([0.0, 0.1]), np.array([0.1, 0.2]), np.array([0.0, 0.11]))
    (array([1]), array([0]), array([1]))
    """
    rgb, depth = associate(rgb_s, depth_s)
    with_pose, pose = associate(rgb_s[rgb], pose_s)
    return rgb[with_pose], depth[with_pose], pose


def read_rgb(recording: Recording, k: int) -> np.ndarray:
    """Colour image of a frame.

    Parameters
    ----------
    recording : Recording
    k : int
        Row of the frame.

    Returns
    -------
    array, shape (height, width, 3), dtype uint8
        RGB.

    Raises
    ------
    InputError
        If it cannot be read, or its size is not that of `camera.json`.
    """
    image = read_image(recording.rgb_paths[k])
    check_size(recording.rgb_paths[k], image.shape, recording.intrinsics)
    return image


def read_depth_m(recording: Recording, k: int) -> np.ndarray:
    """Depth image of a frame.

    Parameters
    ----------
    recording : Recording
    k : int
        Row of the frame.

    Returns
    -------
    array, shape (height, width), dtype float32
        Along the camera's axis; NaN where there is none.

    Raises
    ------
    InputError
        If it cannot be read, is not a 16-bit image of one channel, or has another size than `camera.json`.
    """
    return _read_depth_m(recording, recording.depth_paths[k])


def read_exact_depth_m(recording: Recording, k: int) -> np.ndarray | None:
    """Depth image of a frame without the sensor's errors.

    Parameters
    ----------
    recording : Recording
    k : int
        Row of the frame.

    Returns
    -------
    array or None, shape (height, width), dtype float32
        As `read_depth_m`; None in a recording that is not simulated.
    """
    path = recording.folder / EXACT_DEPTH_DIR / recording.depth_paths[k].name
    return _read_depth_m(recording, path) if path.is_file() else None


def read_truth(recording: Recording) -> pd.DataFrame | None:
    """True positions of the keypoints.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    pd.DataFrame or None
        Columns frame (row of the recording), t_s, keypoint (Halpe name), x_m, y_m, z_m (base frame), u_px,
        v_px, visible (0 outside the image, 1 occluded, 2 visible); None in a recording that is not
        simulated.

    Raises
    ------
    InputError
        If the file is there but is not such a table.
    """
    return _read_table(recording, TRUTH_FILE, _TRUTH_COLUMNS)


def read_joints(recording: Recording) -> pd.DataFrame | None:
    """Joint angles of the robot.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    pd.DataFrame or None
        Columns frame, t_s, and `<joint>_rad` for each joint; None where not recorded.

    Raises
    ------
    InputError
        If the file is there but is not such a table.
    """
    return _read_table(recording, JOINTS_FILE, ("frame", "t_s"))


def read_simulation(recording: Recording) -> dict | None:
    """The settings of a simulated recording.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    dict or None
        None if it was not simulated.
    """
    path = recording.folder / SIMULATION_FILE
    return read_json(path) if path.is_file() else None


def read_csv(path: str | Path, numbers: Sequence[str], texts: Sequence[str] = ()) -> pd.DataFrame:
    """Read columns of a CSV table.

    Parameters
    ----------
    path : str or Path
    numbers, texts : sequence of str
        Columns that must occur exactly once.

    Returns
    -------
    pd.DataFrame
        Of these columns; NaN for empty cells.

    Raises
    ------
    InputError
        If it cannot be read, a column is missing or duplicated, or a value is not a number; the first is
        named.
    """
    columns = [*numbers, *texts]
    table = read_table(path, columns, dtype=str)[columns]
    of_numbers = table[list(numbers)].apply(pd.to_numeric, errors="coerce")
    for row, column in np.argwhere((of_numbers.isna() & table[list(numbers)].notna()).to_numpy())[:1]:
        wrong = f"{numbers[column]} is {table[numbers[column]][row][:40]!r}"
        raise InputError(f"{path}: row {row + 2}: {wrong}; expected a number")
    return pd.concat([of_numbers, table[list(texts)]], axis=1)


def colour_files(recording: Recording) -> dict[int, Path]:
    """The colour images' files by row of the frame, for detectors; only their headers are read.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    dict of int to Path

    Raises
    ------
    InputError
        If an image's size is not that of `camera.json`.
    """
    for path in recording.rgb_paths:
        width_px, height_px, _ = image_header(path)
        if width_px:  # else reading its pixels will report what is wrong
            check_size(path, (height_px, width_px), recording.intrinsics)
    return dict(enumerate(recording.rgb_paths))


def check_size(where: str | Path, shape: tuple[int, ...], intrinsics: Camera) -> None:
    """Refuse an image of another size than its camera's.

    Parameters
    ----------
    where : str or Path
        What was read, for messages.
    shape : tuple of int
        Of the image: height, width, ...
    intrinsics : Camera

    Raises
    ------
    InputError
        If it is of another size.
    """
    height, width = shape[:2]
    if (width, height) != (intrinsics.width_px, intrinsics.height_px):
        expected = f"{intrinsics.width_px} x {intrinsics.height_px}; do not crop or bin"
        raise InputError(f"{where}: is {width} x {height} pixels; its camera says {expected}")


def _read_depth_m(recording: Recording, path: Path) -> np.ndarray:
    units = decode(read_bytes(path, "expected a depth image"), path, cv2.IMREAD_UNCHANGED)
    if units.dtype != np.uint16 or units.ndim != 2:
        raise InputError(f"{path}: is not a 16-bit image of one channel; write depth as 16-bit PNG")
    check_size(path, units.shape, recording.intrinsics)
    depth_m = units * np.float32(1 / recording.depth_units_per_m)
    depth_m[units == 0] = np.nan
    return depth_m


def _read_table(recording: Recording, name: str, columns: tuple[str, ...]) -> pd.DataFrame | None:
    path = recording.folder / name
    if not path.is_file():
        return None
    table = read_table(path, columns)
    numbers = table[[n for n in table if n != "keypoint" and (n in columns or n.endswith("_rad"))]]
    for n, kind in numbers.dtypes.items():
        if kind.kind not in "iuf":
            raise InputError(f"{path}: column {n!r} is of type {kind}; expected numbers")
    frames = numbers["frame"]
    is_good = (frames >= 0) & (frames % 1 == 0) & ~(numbers.abs() > _MOST).any(axis=1)
    if "keypoint" in columns:
        is_good &= table["keypoint"].isin(NAMES)
    if not is_good.all():
        expected = f"expected a frame from 0, a keypoint's name, numbers up to {_MOST:g}"
        raise InputError(f"{path}: row {1 + np.argmin(is_good)}: {expected}")
    return table[frames < len(recording)].reset_index(drop=True)

"""Recordings made by others' tools: a RealSense `.bag`, and the folder layout Open3D's tools write.

Images of a folder are copied as they are. Poses come from the user: a text file in the TUM layout, one
line of which is a camera that stands still, or a CSV of the robot's joint angles.
"""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from hicp_lib.core.camera import Camera
from hicp_lib.core.environment import with_variables
from hicp_lib.core.errors import InputError
from hicp_lib.core.extras import needs
from hicp_lib.core.files import atomic_path, read_json
from hicp_lib.formats.json_validation import is_number
from hicp_lib.recordings.camera_file import read_camera
from hicp_lib.recordings.recording import check_columns
from hicp_lib.recordings.trajectories import read_trajectory
from hicp_lib.recordings.tum import names_poses
from hicp_lib.recordings.writer import refuse_used_folder, write_frame, write_index

_IMAGE_KINDS = (".png", ".jpg", ".jpeg")
_MAX_RATE_HZ = 10_000


Poses = tuple[np.ndarray, np.ndarray]
"""Times (m,) in seconds and T_base_cam (m, 4, 4); one pose is for all times."""


def read_pose_source(path: str | Path | None, mount: str = "level") -> Poses:
    """Poses from a trajectory (`read_trajectory`), or a CSV of joint angles by the robot's kinematics.

    A CSV has a column `t_s` and one of degrees for every joint of torso and neck, such as
    `torso_pitch_deg`. Without a file the base frame is the camera's own.

    Parameters
    ----------
    path : str or Path or None
    mount : str, optional
        Camera holder, for joint angles: "level" or "tilted".

    Returns
    -------
    times_s : array, shape (m,)
        One time where the camera stands still, none where the poses are of frame after frame.
    T_base_cam : array, shape (m, 4, 4)
        Camera coordinates to the robot's base frame.

    Raises
    ------
    InputError
        If the file cannot be read, or a column or number is missing.

    Examples
    --------
    >>> times_s, T_base_cam = read_pose_source(None)
    >>> times_s.shape, T_base_cam.shape
    ((1,), (1, 4, 4))
    """
    if path is None:
        return np.zeros(1), np.eye(4)[None]
    path = Path(path)
    if path.suffix.lower() != ".csv" or names_poses(path):
        return read_trajectory(path)
    from hicp_lib.robot.kinematics import HEAD_JOINTS, load_icub  # not in every installation

    columns = ["t_s", *(f"{joint}_deg" for joint in HEAD_JOINTS)]
    try:
        table = pd.read_csv(path)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: is not a CSV table ({str(error).splitlines()[0]})") from None
    check_columns(path, table, columns)
    numbers = table[columns].apply(pd.to_numeric, errors="coerce").to_numpy(float)
    is_bad = ~np.isfinite(numbers).all(axis=1) | (np.diff(numbers[:, 0], prepend=-np.inf) <= 0)
    if is_bad.any() or len(numbers) == 0:
        row = 1 + int(np.argmax([*is_bad, True]))
        raise InputError(f"{path}: row {row}: expected numbers, and a t_s after the one before")
    return numbers[:, 0], load_icub().T_root_camera(np.radians(numbers[:, 1:]), mount)


def import_open3d(source: str | Path, out: str | Path, poses: Poses, rate_hz: float | None = None) -> int:
    """Import `color/`, `depth/` and `intrinsic.json` as Open3D's recorder writes them.

    Parameters
    ----------
    source : str or Path
        Folder with the three.
    out : str or Path
        Folder of the recording; new or empty.
    poses : tuple of array
        As `read_pose_source` gives them.
    rate_hz : float, optional
        Frames per second; the file's `fps` when left out. The first frame is at time 0.

    Returns
    -------
    int
        The number of frames.

    Raises
    ------
    InputError
        If something is missing or does not match, or `out` holds files.
    """
    source, out = Path(source), Path(out)
    if rate_hz is not None and not 0 < rate_hz < np.inf:
        raise InputError(f"rate is {rate_hz!r}; expected frames per second")
    intrinsics, depth_units_per_m = read_camera(source / "intrinsic.json")
    rgb, depth = (_images(source / name) for name in ("color", "depth"))
    if [path.stem for path in rgb] != [path.stem for path in depth]:
        raise InputError(f"{source}: color/ and depth/ hold other names; expected one depth image per colour")
    times_s = np.arange(len(rgb)) / (_rate_hz(source / "intrinsic.json") if rate_hz is None else rate_hz)
    refuse_used_folder(out)
    names = [f"rgb/{path.name}" for path in rgb], [f"depth/{path.name}" for path in depth]
    for path, name in zip(rgb + depth, sum(names, []), strict=True):
        with atomic_path(out / name) as temporary:
            shutil.copyfile(path, temporary)
    write_index(out, intrinsics, depth_units_per_m, times_s, *_poses_at(times_s, poses), names)
    return len(times_s)


def import_bag(bag: str | Path, out: str | Path, poses: Poses) -> int:
    """Import a `.bag` recorded by the RealSense viewer or SDK; depth is aligned to colour on the way.

    Times are those of the file, in seconds; colour is stored as JPEG of high quality.

    Parameters
    ----------
    bag : str or Path
    out : str or Path
        Folder of the recording; new or empty.
    poses : tuple of array
        As `read_pose_source` gives them.

    Returns
    -------
    int
        The number of frames.

    Raises
    ------
    InputError
        If Open3D was built without RealSense, the file is not such a bag, or `out` holds files.
    """
    out = Path(out)
    refuse_used_folder(out)
    reader = _open_bag(Path(bag))
    meta = reader.metadata
    if meta.color_format not in ("RGB8", "BGR8"):
        raise InputError(f"{bag}: colour is {meta.color_format}; record it as RGB8")
    stamps_s: list[float] = []
    for time_s, rgb, depth_units in _frames(reader):
        if stamps_s and time_s <= stamps_s[-1]:
            continue  # the reader may return the last frame twice
        rgb = rgb if meta.color_format == "RGB8" else rgb[..., ::-1].copy()
        write_frame(out, len(stamps_s), rgb, depth_units, 1)
        stamps_s.append(time_s)
    if not stamps_s:
        raise InputError(f"{bag}: holds no frames with colour and depth; record both streams")
    times_s, matrix = np.array(stamps_s), meta.intrinsics.intrinsic_matrix
    intrinsics = Camera(meta.width, meta.height, matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2])
    write_index(out, intrinsics, meta.depth_scale, times_s, *_poses_at(times_s, poses))
    return len(times_s)


def _open_bag(bag: Path) -> Any:
    """Open3D's reader, opened."""
    with needs("render"), with_variables(OPEN3D_DISABLE_WEB_VISUALIZER="true"):
        import open3d as o3d

    if not hasattr(o3d.t.io, "RSBagReader"):
        hint = "use its tools elsewhere to save the frames, then import with --open3d"
        raise InputError(f"{bag}: this Open3D was built without RealSense; {hint}")
    if not bag.is_file():
        raise InputError(f"{bag}: is not there; give a .bag recorded by the RealSense viewer")
    reader = o3d.t.io.RSBagReader()
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        is_open = reader.open(str(bag))
    if not is_open:
        raise InputError(f"{bag}: cannot be opened; expected a .bag recorded by the RealSense viewer")
    return reader


def _frames(reader: Any) -> Iterator[tuple[float, np.ndarray, np.ndarray]]:
    """Time in seconds, colour (height, width, 3) and depth in units (height, width) of every frame."""
    frame = reader.next_frame()
    while not reader.is_eof():
        color, depth = (np.asarray(image.as_tensor().numpy()) for image in (frame.color, frame.depth))
        yield reader.get_timestamp() / 1e6, color, depth.squeeze()
        frame = reader.next_frame()
    reader.close()


def _images(folder: Path) -> list[Path]:
    if not folder.is_dir():
        raise InputError(f"{folder}: is not a folder; expected color/, depth/ and intrinsic.json")
    paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in _IMAGE_KINDS)
    if not paths:
        raise InputError(f"{folder}: holds no images; expected files such as 00000.png")
    return paths


def _rate_hz(path: Path) -> float:
    value = read_json(path).get("fps")
    if not (is_number(value) and 0 < value < _MAX_RATE_HZ):
        raise InputError(f"{path}: fps: expected frames per second, found {value!r}; give --rate")
    return float(value)


def _poses_at(times_s: np.ndarray, poses: Poses) -> tuple[np.ndarray, np.ndarray]:
    """Poses and their times; of a camera that stands still, one for every image."""
    pose_s, T_base_cam = poses
    if len(pose_s) > 1:
        return T_base_cam, pose_s
    if len(pose_s) == 0:
        if len(T_base_cam) != len(times_s):
            wrong = f"{len(T_base_cam)} poses without times for {len(times_s)} frames"
            raise InputError(f"{wrong}; expected one for each, or a file with times")
        return T_base_cam, times_s
    return np.repeat(T_base_cam, len(times_s), axis=0), times_s

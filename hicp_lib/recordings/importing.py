"""Recordings made by others' tools: a RealSense `.bag`, and the folder layout Open3D's tools write.

Images of a folder are copied as they are. Poses come from the user: a text file in the TUM layout, one
line of which is a camera that stands still, or a CSV of the robot's joint angles.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.camera import Camera
from hicp_lib.core.environment import with_variables
from hicp_lib.core.errors import InputError
from hicp_lib.core.extras import needs
from hicp_lib.core.files import atomic_path, read_json
from hicp_lib.recordings.camera_file import read_camera, write_camera
from hicp_lib.recordings.recording import CAMERA_FILE, DEPTH_LIST, POSES_FILE, RGB_LIST
from hicp_lib.recordings.tum import read_poses, write_file_list, write_poses
from hicp_lib.recordings.writer import depth_name, refuse_used_folder, rgb_name, write_depth, write_rgb

_IMAGE_KINDS = (".png", ".jpg", ".jpeg")


@dataclass(frozen=True)
class PoseSource:
    """Where poses come from: times (n,) in seconds and T_base_cam (n, 4, 4); one pose is for all times."""

    times_s: np.ndarray
    T_base_cam: np.ndarray


def read_pose_source(path: str | Path | None, mount: str = "level") -> PoseSource:
    """Poses from a TUM text file, or from a CSV of joint angles by the robot's kinematics.

    A CSV has a column `t_s` and one of degrees for every joint of torso and neck, such as
    `torso_pitch_deg`. Without a file the base frame is the camera's own.

    Parameters
    ----------
    mount : camera holder, for joint angles: "level" or "tilted"

    Raises
    ------
    InputError
        If the file cannot be read, or a column or number is missing.
    """
    if path is None:
        return PoseSource(np.zeros(1), np.eye(4)[None])
    path = Path(path)
    if path.suffix.lower() != ".csv":
        return PoseSource(*read_poses(path))
    from hicp_lib.robot.kinematics import HEAD_JOINTS, load_icub  # not in every installation

    columns = ["t_s", *(f"{joint}_deg" for joint in HEAD_JOINTS)]
    try:
        table = pd.read_csv(path)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: is not a CSV table ({str(error).splitlines()[0]})") from None
    missing = [name for name in columns if name not in table.columns]
    if missing:
        raise InputError(f"{path}: has no column {missing[0]!r}; expected {', '.join(columns)}")
    numbers = table[columns].apply(pd.to_numeric, errors="coerce").to_numpy(float)
    bad = np.flatnonzero(~np.isfinite(numbers).all(axis=1) | (np.diff(numbers[:, 0], prepend=-np.inf) <= 0))
    if len(bad) or len(numbers) == 0:
        row = bad[0] + 1 if len(bad) else 1
        raise InputError(f"{path}: row {row}: expected numbers, and a t_s after the one before")
    return PoseSource(numbers[:, 0], load_icub().T_root_camera(np.radians(numbers[:, 1:]), mount))


def import_open3d(
    source: str | Path, out: str | Path, poses: PoseSource, rate_hz: float | None = None
) -> int:
    """Import `color/`, `depth/` and `intrinsic.json` as Open3D's recorder writes them.

    Parameters
    ----------
    rate_hz : frames per second; the file's `fps` when left out. The first frame is at time 0

    Returns
    -------
    The number of frames

    Raises
    ------
    InputError
        If something is missing or does not match, or `out` holds files.
    """
    source, out = Path(source), Path(out)
    if rate_hz is not None and not 0 < rate_hz < np.inf:
        raise InputError(f"rate is {rate_hz!r}; expected frames per second")
    intrinsics, units = read_camera(source / "intrinsic.json")
    rgb, depth = (_images(source / name) for name in ("color", "depth"))
    if [path.stem for path in rgb] != [path.stem for path in depth]:
        raise InputError(f"{source}: color/ and depth/ hold other names; expected one depth image per colour")
    times_s = np.arange(len(rgb)) / (_rate_hz(source / "intrinsic.json") if rate_hz is None else rate_hz)
    refuse_used_folder(out)
    names = []
    for folder, paths in (("rgb", rgb), ("depth", depth)):
        names.append([f"{folder}/{path.name}" for path in paths])
        for path, name in zip(paths, names[-1], strict=True):
            with atomic_path(out / name) as temporary:
                shutil.copyfile(path, temporary)
    _write_lists(out, intrinsics, units, times_s, *names, poses)
    return len(times_s)


def import_bag(bag: str | Path, out: str | Path, poses: PoseSource) -> int:
    """Import a `.bag` recorded by the RealSense viewer or SDK; depth is aligned to colour on the way.

    Times are those of the file, in seconds; colour is stored as JPEG of high quality.

    Returns
    -------
    The number of frames

    Raises
    ------
    InputError
        If Open3D was built without RealSense, the file is not such a bag, or `out` holds files.
    """
    out = Path(out)
    refuse_used_folder(out)
    reader = _open_bag(Path(bag))
    meta, times_s = reader.metadata, []
    if meta.color_format not in ("RGB8", "BGR8"):
        raise InputError(f"{bag}: colour is {meta.color_format}; record it as RGB8")
    matrix = meta.intrinsics.intrinsic_matrix
    for time_s, rgb, depth_units in _frames(reader):
        if times_s and time_s <= times_s[-1]:
            continue  # the reader may return the last frame twice
        write_rgb(out / rgb_name(len(times_s)), rgb if meta.color_format == "RGB8" else rgb[..., ::-1].copy())
        write_depth(out / depth_name(len(times_s)), depth_units, 1)
        times_s.append(time_s)
    if not times_s:
        raise InputError(f"{bag}: holds no frames with colour and depth; record both streams")
    intrinsics = Camera(meta.width, meta.height, matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2])
    numbers = range(len(times_s))
    names = [rgb_name(k) for k in numbers], [depth_name(k) for k in numbers]
    _write_lists(out, intrinsics, meta.depth_scale, np.array(times_s), *names, poses)
    return len(times_s)


def _open_bag(bag: Path):
    """Open3D's reader, opened."""
    with needs("render"), with_variables(OPEN3D_DISABLE_WEB_VISUALIZER="true"):
        import open3d as o3d

    if not hasattr(o3d.t.io, "RSBagReader"):
        raise InputError(
            f"{bag}: this Open3D was built without RealSense; use its tools elsewhere to save the frames, "
            "then import with --open3d"
        )
    if not bag.is_file():
        raise InputError(f"{bag}: is not there; give a .bag recorded by the RealSense viewer")
    reader = o3d.t.io.RSBagReader()
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        is_open = reader.open(str(bag))
    if not is_open:
        raise InputError(f"{bag}: cannot be opened; expected a .bag recorded by the RealSense viewer")
    return reader


def _frames(reader) -> Iterator[tuple[float, np.ndarray, np.ndarray]]:
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
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < 10_000:
        raise InputError(f"{path}: fps: expected frames per second, found {value!r}; give --rate")
    return float(value)


def _write_lists(out: Path, intrinsics, units, times_s, rgb_names, depth_names, poses: PoseSource) -> None:
    pose_s, T_base_cam = poses.times_s, poses.T_base_cam
    if len(T_base_cam) == 1:
        pose_s, T_base_cam = times_s, np.repeat(T_base_cam, len(times_s), axis=0)
    write_camera(out / CAMERA_FILE, intrinsics, units)
    write_poses(out / POSES_FILE, pose_s, T_base_cam)
    write_file_list(out / DEPTH_LIST, times_s, depth_names)
    write_file_list(out / RGB_LIST, times_s, rgb_names)

"""What is missing or inconsistent in anyone's recording, in one line each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.recordings.camera_file import read_camera
from hicp_lib.recordings.recording import (
    CAMERA_FILE,
    DEPTH_LIST,
    POSES_FILE,
    RGB_LIST,
    Recording,
    associate_frames,
    open_recording,
    read_depth_m,
    read_joints,
    read_rgb,
    read_truth,
)
from hicp_lib.recordings.tum import MAX_DIFFERENCE_S, associate, read_file_list, read_poses

Read = TypeVar("Read")

PLAUSIBLE_DEPTH_M = (0.1, 12.0)  # where the middle of what a camera near a robot sees must lie
FURTHEST_POSE_M = 10.0  # from the base: a robot reaches less, a pose in millimetres more


@dataclass(frozen=True)
class Finding:
    """One line about a recording; `is_fatal` where it cannot be used as it is."""

    text: str
    is_fatal: bool = True

    def __str__(self) -> str:
        return self.text


def check_recording(folder: str | Path) -> list[Finding]:
    """Everything wrong with a recording, one finding each; none where all is well. Reads every image."""
    folder = Path(folder)
    if not folder.is_dir():
        return [Finding(f"{folder}: is not a folder; give the folder of a recording")]
    findings = list(_files(folder))
    if any(finding.is_fatal for finding in findings):
        return findings
    recording = open_recording(folder)
    return [*findings, *_images(recording), *_poses(recording), *_tables(recording), *_mocap(recording)]


def _files(folder: Path) -> Iterator[Finding]:
    """Text files missing or malformed, images listed but not there, images without a partner."""
    _, problem = _attempt(read_camera, folder / CAMERA_FILE)
    yield from problem
    times_s = []
    for name in (RGB_LIST, DEPTH_LIST):
        listed, problem = _attempt(read_file_list, folder / name)
        yield from problem
        if listed:
            times_s.append(listed[0])
            yield from _missing(folder, listed[1])
    poses, problem = _attempt(read_poses, folder / POSES_FILE)
    yield from problem
    if poses and len(times_s) == 2:
        yield from _unassociated(folder, *times_s, poses[0])


def _attempt(read: Callable[..., Read], *arguments) -> tuple[Read | None, list[Finding]]:
    try:
        return read(*arguments), []
    except InputError as error:
        return None, [Finding(str(error))]


def _missing(folder: Path, names: list[str]) -> Iterator[Finding]:
    missing = [name for name in names if not (folder / name).is_file()]
    if missing:
        yield Finding(f"{folder / missing[0]}: is not there; {len(missing)} of {len(names)} listed are not")


def _unassociated(folder: Path, rgb_s, depth_s, pose_s) -> Iterator[Finding]:
    is_fatal = len(associate_frames(rgb_s, depth_s, pose_s)[0]) == 0
    for name, other_s in (("depth image", depth_s), ("pose", pose_s)):
        n = len(rgb_s) - len(associate(rgb_s, other_s)[0])
        if n:
            text = f"{n} of {len(rgb_s)} colour images have no {name} within {MAX_DIFFERENCE_S:g} s"
            yield Finding(f"{folder / RGB_LIST}: {text} and are left out", is_fatal)


def _images(recording: Recording) -> Iterator[Finding]:
    """Images that cannot be read, are not of the right kind, or have another size."""
    middles_m = []
    for kind, read in (("colour", read_rgb), ("depth", read_depth_m)):
        bad = []
        for k in range(len(recording)):
            image, problem = _attempt(read, recording, k)
            bad += problem
            if kind == "depth" and image is not None:
                middles_m.append(np.median(image[image > 0]) if (image > 0).any() else np.nan)
        if bad:
            yield Finding(f"{bad[0]} ({len(bad)} of {len(recording)} {kind} images are unusable)")
    yield from _depths(recording, np.array(middles_m))


def _depths(recording: Recording, middles_m: np.ndarray) -> Iterator[Finding]:
    """Images without depth, and depth that cannot be right; from the middle depth of each image."""
    empty = int(np.isnan(middles_m).sum())
    if empty:
        text = f"{empty} of {len(middles_m)} depth images hold no depth at all"
        yield Finding(f"{recording.folder / DEPTH_LIST}: {text}", is_fatal=empty == len(middles_m))
    low, high = PLAUSIBLE_DEPTH_M
    if empty < len(middles_m) and not low <= (middle := np.nanmedian(middles_m)) <= high:
        scale = f"with depth_scale {recording.depth_units_per_m:g} the middle depth is {middle:.3g} m"
        text = f"{scale}; expected {low:g} to {high:g} m, correct the scale"
        yield Finding(f"{recording.folder / CAMERA_FILE}: {text}", is_fatal=False)


def _poses(recording: Recording) -> Iterator[Finding]:
    furthest_m = np.linalg.norm(recording.T_base_cam[:, :3, 3], axis=1).max()
    if furthest_m > FURTHEST_POSE_M:
        text = f"the camera is up to {furthest_m:.4g} m from the base; expected metres, not millimetres"
        yield Finding(f"{recording.folder / POSES_FILE}: {text}", is_fatal=False)


def _tables(recording: Recording) -> Iterator[Finding]:
    """Truth and joints, where there are any, that are no such tables."""
    for read in (read_truth, read_joints):
        yield from _attempt(read, recording)[1]


def _mocap(recording: Recording) -> Iterator[Finding]:
    """Motion capture that cannot be read, does not cover the recording, or lacks a marker."""
    from hicp_lib.recordings.qualisys import read_mocap  # ezc3d takes a while to load

    path = recording.mocap_path
    if path is None:
        return
    mocap, problem = _attempt(read_mocap, path)
    yield from problem
    if mocap is None:
        return
    images_s = recording.times_s
    if np.ptp(mocap.times_s) < 0.9 * np.ptp(images_s):
        text = f"lasts {np.ptp(mocap.times_s):.2f} s, the images {np.ptp(images_s):.2f} s; export it whole"
        yield Finding(f"{path}: {text}", is_fatal=False)
    if mocap.times_s[-1] < images_s[0] or mocap.times_s[0] > images_s[-1]:
        yield Finding(f"{path}: does not overlap with the images in time; its clock is another", False)
    never = [n for k, n in enumerate(mocap.names) if np.isnan(mocap.points_m[:, k]).any(axis=1).all()]
    if never:
        text = f"{', '.join(never)} never seen ({len(never)} of {len(mocap.names)} markers)"
        yield Finding(f"{path}: {text}", is_fatal=False)

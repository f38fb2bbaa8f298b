"""Recordings in Open3D's folder layout; images are copied as they are, unless they are distorted."""

import re
from pathlib import Path

import cv2
import numpy as np

from hicp_lib.core.camera import Camera
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_bytes, read_json, write_bytes
from hicp_lib.core.folders import listed, refuse_used_folder
from hicp_lib.core.images import decode
from hicp_lib.formats.json_validation import is_number, shown
from hicp_lib.recordings.camera_file import read_distorted_camera
from hicp_lib.recordings.recording import check_size
from hicp_lib.recordings.rectification import rectify
from hicp_lib.recordings.writer import JPEG_QUALITY, Poses, write_index

METADATA = ("intrinsic.json", "camera_intrinsic.json")
_IMAGE_KINDS = (".png", ".jpg", ".jpeg")
_RATES_HZ = (0.001, 10_000.0)


def import_open3d(
    source: str | Path,
    out: str | Path,
    poses: Poses,
    rate_hz: float | None = None,
    depth_units_per_m: float | None = None,
) -> tuple[int, list[str]]:
    """Import `color/`, `depth/` and `intrinsic.json` or `camera_intrinsic.json`, as Open3D's recorders do.

    Images are undistorted by the file's coefficients. Frames are in the order of the numbers in their names.

    Parameters
    ----------
    source : str or Path
        Folder with the three.
    out : str or Path
        Folder of the recording; new or empty.
    poses : tuple of array
        As `hicp_lib.recordings.trajectories.read_pose_source` gives them.
    rate_hz : float, optional
        Frames per second; the file's `fps` when left out. The first frame is at time 0.
    depth_units_per_m : float, optional
        Of the depth images; the file's `depth_scale` when left out.

    Returns
    -------
    n_frames : int
    notes : list of str
        Changes to the images, and contradictions between files, one line each.

    Raises
    ------
    InputError
        If something is missing or does not match, or `out` holds files.
    """
    source, out = Path(source), Path(out)
    found = [source / name for name in METADATA if (source / name).is_file()]
    if len(found) > 1:
        raise InputError(f"{source}: holds {' and '.join(METADATA)}; keep the one of these images")
    path = (found or [source / METADATA[0]])[0]
    intrinsics, units_per_m, pixels_px = read_distorted_camera(path, depth_units_per_m)
    notes = [] if pixels_px is None else [f"{path}: distortion undone"]
    said = read_json(path)
    for key, given in (("fps", rate_hz), ("depth_scale", depth_units_per_m)):
        if given is not None and said.get(key, given) != given:
            notes.append(f"{path}: {key} is {shown(said[key])}; {given:g} was given and counts")
    rgb, depth = (_images(source / name) for name in ("color", "depth"))
    if [image.stem for image in rgb] != [image.stem for image in depth]:
        counts = f"color/ holds {len(rgb)} images, depth/ {len(depth)}, not all of the same names"
        raise InputError(f"{source}: {counts}; expected one depth image per colour")
    rate_hz = said.get("fps") if rate_hz is None else rate_hz
    if not (is_number(rate_hz) and _RATES_HZ[0] <= rate_hz <= _RATES_HZ[1]):
        expected = "expected frames per second, {:g} to {:g}".format(*_RATES_HZ)
        raise InputError(f"{path}: fps: {expected}, found {shown(rate_hz)}; give --rate")
    times_s = _frame_numbers(rgb, notes) / rate_hz
    lasts_s, said_us = times_s[-1] + 1 / rate_hz, said.get("stream_length_usec")
    if is_number(said_us) and abs(said_us / 1e6 - lasts_s) > max(2 / rate_hz, 0.01 * lasts_s):
        lengths = f"stream_length_usec is {said_us / 1e6:.2f} s, {len(rgb)} frames are {lasts_s:.2f} s"
        notes.append(f"{path}: {lengths}; frames were dropped, or the rate is another")
    refuse_used_folder(out)
    is_plain = all(re.fullmatch(r"[\w.-]+", image.name) for image in rgb + depth)  # as lists can contain them
    rgb_names, depth_names = (
        [f"{of}/{image.name if is_plain else f'{k:06d}{image.suffix}'}" for k, image in enumerate(images)]
        for of, images in (("rgb", rgb), ("depth", depth))
    )
    for image, name in zip(rgb + depth, rgb_names + depth_names, strict=True):
        write_bytes(out / name, _rectified(image, intrinsics, pixels_px))
    write_index(out, intrinsics, units_per_m, times_s, poses, (rgb_names, depth_names))
    return len(times_s), notes


def _images(folder: Path) -> list[Path]:
    """Sorted by the numbers in their names."""
    if not folder.is_dir():
        raise InputError(f"{folder}: is not a folder; expected color/, depth/ and intrinsic.json")
    names = listed(folder, _IMAGE_KINDS)
    if not names:
        raise InputError(f"{folder}: holds no images; expected files such as 00000.png")
    return [folder / name for name in names]


def _frame_numbers(paths: list[Path], notes: list[str]) -> np.ndarray:
    """The frame of each image, from 0: by the number in its name, if few are missing."""
    in_order = np.arange(len(paths))
    numbers = [int(match[0]) for path in paths if (match := re.search("[0-9]+$", path.stem))]
    missing = numbers[-1] - numbers[0] + 1 - len(paths) if len(numbers) == len(paths) else 0
    if missing == 0:
        return in_order
    if len(set(numbers)) < len(paths):
        raise InputError(f"{paths[0].parent}: two images have the same number; keep one of them")
    if not 0 < missing < len(paths):
        notes.append(
            f"{paths[0].parent}: names do not count frames, which are taken as evenly spaced in time"
        )
        return in_order
    notes.append(f"{paths[0].parent}: {missing} numbers are missing among {len(paths)}; times go by number")
    return np.array(numbers) - numbers[0]


def _rectified(path: Path, intrinsics: Camera, pixels_px: np.ndarray | None) -> bytes:
    """An image file's content, without distortion."""
    content = read_bytes(path, "expected an image")
    image = decode(content, path, cv2.IMREAD_UNCHANGED)
    check_size(path, image.shape, intrinsics)
    if pixels_px is None:
        return content
    quality = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    return cv2.imencode(path.suffix, rectify(image, pixels_px), quality)[1].tobytes()

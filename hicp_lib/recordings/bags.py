"""Convert a ROS or RealSense bag to a recording: colour, depth aligned to it, and poses."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.limited import limited_child
from hicp_lib.recordings.bag_file import Bag, decode, open_bag, stamp_s
from hicp_lib.recordings.bag_poses import frame_poses, joint_poses, read_links
from hicp_lib.recordings.bag_streams import Stream, Topics, find_streams, realsense_links
from hicp_lib.recordings.recording import check_size
from hicp_lib.recordings.rectification import align_depth, rectify
from hicp_lib.recordings.tum import MAX_DIFFERENCE_S, associate
from hicp_lib.recordings.writer import Poses, write_recording

_SAME_PX = 0.5  # intrinsics this similar belong to one camera
_SAME_POSE = 1e-3  # m, and of rotations' entries: cameras that move less are fixed to each other


def import_bag(
    path: str | Path,
    out: str | Path,
    poses: Poses | None = None,
    topics: Topics = (None, None),
    base_frame: str | None = None,
    joints_mount: str | None = None,
) -> tuple[int, list[str]]:
    """Import a bag of ROS 1 or 2, or of librealsense, in a separate process (`limited_child`).

    Images are undistorted and depth is aligned to colour. Times are those of the images' headers; a depth
    image is paired with the nearest colour image within half a period. Colour is stored as JPEG of high
    quality.

    Parameters
    ----------
    path : str or Path
    out : str or Path
        Folder of the recording; new or empty.
    poses : tuple of array, optional
        As `read_pose_source` gives them.
    topics : (str or None, str or None), optional
        Of colour and depth; needed if the bag has several.
    base_frame : str, optional
        Frame of the bag's transforms, in which the poses are.
    joints_mount : str, optional
        Camera holder, "level" or "tilted", for poses by the bag's joint angles.

    Returns
    -------
    n_frames : int
    notes : list of str
        Changes to images, and images left out, one line each.

    Raises
    ------
    InputError
        If the bag is damaged or lacks something, or `out` holds files.
    """
    given = poses and [of.tolist() for of in poses]
    return limited_child(Path(path), _import, str(out), given, topics, base_frame, joints_mount)


def _import(
    path: str, out: str, given: list | None, topics: Topics, base_frame: str | None, joints_mount: str | None
) -> tuple[int, list[str]]:
    with open_bag(path) as bag:
        streams = color, depth = find_streams(bag, topics)
        notes = [f"{stream.topic}: {note}" for stream in streams for note in stream.notes]
        times_s, rows = _pairs(bag, color, depth, notes)
        T_color_depth = _alignment(bag, color, depth, times_s)
        if T_color_depth is not None:
            notes.insert(0, f"{depth.topic}: aligned to {color.topic}")
        poses: Poses = (np.array(given[0]), np.array(given[1])) if given else (np.zeros(1), np.eye(4)[None])
        if base_frame is not None:
            T_base_cam = frame_poses(bag, read_links(bag), base_frame.strip("/"), color.frame, times_s)
            poses = _known(bag, times_s, T_base_cam, notes)
        elif joints_mount is not None:
            poses = _known(bag, times_s, joint_poses(bag, joints_mount, times_s), notes)
        rgb, depth_images = (_images(bag, stream, of) for stream, of in zip(streams, rows, strict=True))
        depth_m = (of if of.dtype.kind == "f" else of / depth.units_per_m for of in depth_images)
        if T_color_depth is not None:
            depth_m = (align_depth(of, depth.camera, color.camera, T_color_depth) for of in depth_m)
        frames = zip(times_s, rgb, depth_m, strict=True)
        write_recording(out, color.camera, depth.units_per_m, frames, poses)
    return len(times_s), [f"{path}: {note}" for note in notes]


def _alignment(bag: Bag, color: Stream, depth: Stream, times_s: np.ndarray) -> np.ndarray | None:
    """From the depth camera's coordinates to the colour camera's; None if depth is already aligned.

    It may be among the moving transforms, but has to be the same at all images.
    """
    if color.frame == depth.frame:
        of_color, of_depth = (list(vars(stream.camera).values()) for stream in (color, depth))
        if np.allclose(of_color, of_depth, rtol=0, atol=_SAME_PX):
            return None
        if color.frame:
            return np.eye(4)
        raise InputError(f"{bag.path}: {depth.topic} has another camera than colour, and neither has a frame")
    links = realsense_links(bag) or read_links(bag)
    try:
        T_color_depth = frame_poses(bag, links, color.frame, depth.frame, times_s)
        known = T_color_depth[np.isfinite(T_color_depth).all(axis=(1, 2))]
        if len(known) == 0 or np.ptp(known, axis=0).max() > _SAME_POSE:
            wrong = "moves" if len(known) else f"is not known within {MAX_DIFFERENCE_S:g} s of any image"
            raise InputError(f"{bag.path}: {depth.frame!r} {wrong} relative to {color.frame!r}")
        return known[0]
    except InputError as error:
        wrong = f"{depth.topic} is not aligned to {color.topic}"
        raise InputError(f"{error}; {wrong}, so record aligned depth, or these transforms") from None


def _pairs(bag: Bag, color: Stream, depth: Stream, notes: list[str]) -> tuple[np.ndarray, list[np.ndarray]]:
    """Times of colour images with depth, and the indices of the paired messages."""
    (color_s, color_rows), (depth_s, depth_rows) = (_times(bag, stream, notes) for stream in (color, depth))
    half_period_s = np.median(np.diff(color_s)) / 2 if len(color_s) > 1 else MAX_DIFFERENCE_S
    a, b = associate(color_s, depth_s, half_period_s)
    if len(a) == 0:
        raise InputError(f"{bag.path}: no image of depth is within {half_period_s:.3f} s of one of colour")
    if (apart_s := np.abs(color_s[a] - depth_s[b]).max()) > MAX_DIFFERENCE_S:
        notes.append(f"{depth.topic}: up to {apart_s:.3f} s from its colour")
    for stream, n in ((color, len(color_s)), (depth, len(depth_s))):
        if n > len(a):
            notes.append(f"{stream.topic}: {n - len(a)} of {n} images have no partner and are left out")
    return color_s[a], [color_rows[a], depth_rows[b]]


def _times(bag: Bag, stream: Stream, notes: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Increasing times, and the indices of their messages."""
    times_s = [stream.taken_s.get(ns) or stamp_s(message) for _, ns, message in bag.messages(stream.topic)]
    before_s = np.maximum.accumulate([-np.inf, *times_s])[:-1]
    rows = np.flatnonzero(times_s > before_s)
    if len(rows) < len(times_s):
        late = len(times_s) - len(rows)
        notes.append(f"{stream.topic}: times of {late} of {len(times_s)} images do not increase; left out")
    return np.array(times_s)[rows], rows


def _images(bag: Bag, stream: Stream, rows: np.ndarray) -> Iterator[np.ndarray]:
    """Undistorted images of the camera's size."""
    where, wanted = f"{bag.path}: {stream.topic}", set(rows.tolist())
    for row, (_, _, message) in enumerate(bag.messages(stream.topic)):
        if row in wanted:
            image = decode(where, message)
            check_size(where, image.shape, stream.camera)
            yield rectify(image, stream.pixels_px)


def _known(bag: Bag, times_s: np.ndarray, T_base_cam: np.ndarray, notes: list[str]) -> Poses:
    """The poses of all images; NaN, of which a note tells, where unknown."""
    is_known = np.isfinite(T_base_cam).all(axis=(1, 2))
    if not is_known.any():
        raise InputError(
            f"{bag.path}: no pose is within {MAX_DIFFERENCE_S:g} s of an image; check the clocks"
        )
    if not is_known.all():
        notes.append(f"{(~is_known).sum()} of {len(is_known)} images have no pose and will be left out")
    return times_s, T_base_cam

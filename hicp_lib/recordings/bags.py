"""A bag of ROS or of RealSense becomes a recording: colour, depth aligned to it, and poses."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.recordings.bag_file import Bag, decode, open_bag
from hicp_lib.recordings.bag_poses import frame_poses, joint_poses, read_links
from hicp_lib.recordings.bag_streams import Stream, find_streams, realsense_links
from hicp_lib.recordings.rectification import align_depth, rectify
from hicp_lib.recordings.tum import MAX_DIFFERENCE_S, associate
from hicp_lib.recordings.writer import Poses, RecordingWriter

_SAME_PX = 0.5  # intrinsics this alike are those of one camera


def import_bag(
    path: str | Path,
    out: str | Path,
    poses: Poses | None = None,
    *,
    color_topic: str | None = None,
    depth_topic: str | None = None,
    base_frame: str | None = None,
    joints_mount: str | None = None,
) -> tuple[int, list[str]]:
    """Import a bag of ROS 1 or 2, or of librealsense.

    Distortion is undone and depth aligned to colour on the way. Times are those of the images' headers; an
    image of depth belongs to the nearest of colour within half of their period. Colour is stored as JPEG of
    high quality.

    Parameters
    ----------
    path : str or Path
    out : str or Path
        Folder of the recording; new or empty.
    poses : tuple of array, optional
        As `read_pose_source` gives them.
    color_topic, depth_topic : str, optional
        Needed where the bag holds several.
    base_frame : str, optional
        Frame of the bag's transforms, in which the poses are.
    joints_mount : str, optional
        Camera holder, "level" or "tilted", for poses by the bag's joint angles.

    Returns
    -------
    n_frames : int
    notes : list of str
        What was done to the images or left out, one line each.

    Raises
    ------
    InputError
        If the bag is damaged or lacks something, or `out` holds files.
    """
    notes: list[str] = []
    with open_bag(path) as bag:
        color, depth = find_streams(bag, color_topic, depth_topic)
        writer = RecordingWriter(out, color.camera, depth.units_per_m)
        T_color_depth = _alignment(bag, color, depth)
        if T_color_depth is not None:
            notes.append(f"{depth.topic}: aligned to {color.topic}")
        notes += [f"{stream.topic}: distortion undone" for stream in (color, depth) if stream.pixels_px is not None]
        rows, times_s = _pairs(bag, color, depth, notes)
        if base_frame is not None:
            T = frame_poses(bag, read_links(bag), base_frame.strip("/"), color.frame, times_s)
            poses = _known(bag, times_s, T, notes)
        elif joints_mount is not None:
            poses = _known(bag, times_s, joint_poses(bag, times_s, joints_mount), notes)
        elif poses is None and bag.topics("TFMessage", "tfMessage", "JointState"):
            notes.append("poses in it are not used: no base frame was named, and no joints were asked for")
        for time_s, (rgb, depth_m) in zip(times_s, _frames(bag, color, depth, rows), strict=True):
            if T_color_depth is not None:
                depth_m = align_depth(depth_m, depth.camera, color.camera, T_color_depth)
            writer.add(time_s, rgb, depth_m)
    writer.finish(poses)
    return len(times_s), [f"{path}: {note}" for note in notes]


def _alignment(bag: Bag, color: Stream, depth: Stream) -> np.ndarray | None:
    """The depth camera's coordinates to the colour camera's; None where depth is aligned already."""
    if color.frame == depth.frame:
        same = np.allclose(list(vars(color.camera).values()), list(vars(depth.camera).values()), atol=_SAME_PX)
        return None if same else np.eye(4)
    links = realsense_links(bag) or read_links(bag)
    try:
        return frame_poses(bag, links, color.frame, depth.frame, np.zeros(1))[0]
    except InputError as error:
        wrong = f"depth ({depth.topic}) is not aligned to colour ({color.topic})"
        raise InputError(f"{bag.path}: {wrong}, and cannot be: {error}; record aligned depth") from None


def _pairs(bag: Bag, color: Stream, depth: Stream, notes: list[str]) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
    """Positions within their topics of colour and depth that belong together, and the times of colour."""
    taken_s: dict[str, list[float]] = {color.topic: [], depth.topic: []}
    by_topic = {color.topic: color, depth.topic: depth}
    for topic, recorded_ns, message in bag.messages(*by_topic):
        taken_s[topic].append(by_topic[topic].stamp_s(recorded_ns, message))
    (color_s, color_rows), (depth_s, depth_rows) = (
        np.unique(taken_s[topic], return_index=True) for topic in by_topic
    )
    for topic, rows in zip(by_topic, (color_rows, depth_rows), strict=True):
        if surplus := len(taken_s[topic]) - len(rows):
            notes.append(f"{topic}: {surplus} of {len(taken_s[topic])} images repeat a time and are left out")
    half_period_s = np.median(np.diff(color_s)) / 2 if len(color_s) > 1 else MAX_DIFFERENCE_S
    a, b = associate(color_s, depth_s, half_period_s)
    if len(a) == 0:
        raise InputError(f"{bag.path}: no image of depth is within {half_period_s:.3f} s of one of colour")
    for kind, n, n_all in (("colour", len(a), len(color_s)), ("depth", len(b), len(depth_s))):
        if n < n_all:
            notes.append(f"{n_all - n} of {n_all} images of {kind} have no partner and are left out")
    return (color_rows[a], depth_rows[b]), color_s[a]


def _frames(
    bag: Bag, color: Stream, depth: Stream, rows: tuple[np.ndarray, ...]
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Colour, and depth in metres, of each pair, as soon as both were read."""
    streams = color, depth
    place = [{row: k for k, row in enumerate(of_stream)} for of_stream in rows]
    n_read, waiting = [0, 0], ({}, {})  # type: ignore[var-annotated]
    k = 0
    for topic, _, message in bag.messages(color.topic, depth.topic):
        i = int(topic == depth.topic)
        if n_read[i] in place[i]:
            waiting[i][place[i][n_read[i]]] = message
        n_read[i] += 1
        while k in waiting[0] and k in waiting[1]:
            rgb, depth_image = (_image(bag, stream, of.pop(k)) for stream, of in zip(streams, waiting, strict=True))
            is_metres = depth_image.dtype.kind == "f"
            yield rgb, depth_image if is_metres else depth_image / depth.units_per_m
            k += 1


def _image(bag: Bag, stream: Stream, message: object) -> np.ndarray:
    """A picture without distortion, of the camera's size."""
    image = decode(f"{bag.path}: {stream.topic}", message)
    expected = stream.camera.height_px, stream.camera.width_px
    if image.shape[:2] != expected:
        found = f"images are {image.shape[:2]} (height, width), their camera {expected}"
        raise InputError(f"{bag.path}: {stream.topic}: {found}; record them without binning or cropping")
    return rectify(image, stream.pixels_px)


def _known(bag: Bag, times_s: np.ndarray, T_base_cam: np.ndarray, notes: list[str]) -> Poses:
    """Poses without those that are not known."""
    is_known = np.isfinite(T_base_cam).all(axis=(1, 2))
    if not is_known.any():
        raise InputError(f"{bag.path}: no pose is within {MAX_DIFFERENCE_S:g} s of an image; check the clocks")
    if not is_known.all():
        notes.append(f"{(~is_known).sum()} of {len(is_known)} images have no pose and will be left out")
    return times_s[is_known], T_base_cam[is_known]

"""Colour and depth streams of a bag: their topics, cameras, and the time of each image."""

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from hicp_lib.core.camera import Camera
from hicp_lib.core.errors import InputError
from hicp_lib.recordings.bag_file import Bag, decode
from hicp_lib.recordings.bag_poses import Link, rigid
from hicp_lib.recordings.camera_file import refuse_implausible
from hicp_lib.recordings.rectification import undistortion

_REALSENSE = re.compile(r"((/device_\d+/sensor_\d+)/\w+)/image/data")
_MM_PER_M = 1000.0
Topics = tuple[str | None, str | None]


@dataclass(frozen=True)
class Stream:
    """Images of a bag.

    Attributes
    ----------
    topic : str
    frame : str
        Of the camera, in the bag's transforms.
    camera : Camera
    pixels_px : array or None, shape (height, width, 2)
        Positions of an undistorted camera's pixels in the images (`undistortion`).
    units_per_m : float
        Of depth in whole numbers.
    taken_s : dict of int to float
        Times of images by their recording time in nanoseconds, if their headers do not contain them.
    notes : list of str
        Remarks for the user.
    """

    topic: str
    frame: str
    camera: Camera
    pixels_px: np.ndarray | None
    units_per_m: float
    taken_s: dict[int, float]
    notes: list[str]


def find_streams(bag: Bag, topics: Topics) -> list[Stream]:
    """Find the colour and depth streams by their messages.

    If a topic exists raw and compressed, the raw one is used; of several depth topics, the one in the colour
    camera's frame.

    Parameters
    ----------
    bag : Bag
    topics : (str or None, str or None)
        The topics to use, if there are several.

    Returns
    -------
    list of Stream
        Two.

    Raises
    ------
    InputError
        If there is no such topic, or more than one; or its camera is unknown.
    """
    kinds = {topic: _kind(topic, bag.first(topic)) for topic in bag.topics("Image", "CompressedImage")}
    color, depth = ([topic for topic, (kind, _) in kinds.items() if kind == of] for of in ("color", "depth"))
    chosen = [_chosen(bag, "color", color, topics[0], kinds)]
    aligned = [topic for topic in depth if _frame(bag, topic) == _frame(bag, chosen[0])]
    depth = depth if topics[1] else aligned or depth
    chosen.append(_chosen(bag, "depth", depth, topics[1], kinds))
    return [_stream(bag, topic) for topic in chosen]


def realsense_links(bag: Bag) -> dict[str, Link]:
    """The poses of librealsense's streams, as links to one frame.

    Parameters
    ----------
    bag : Bag

    Returns
    -------
    dict of str to Link
        Empty where another recorder wrote the bag.
    """
    links: dict[str, Link] = {}
    for topic in bag.topics("String", "Transform"):
        if match := re.fullmatch(r"(/device_\d+/sensor_\d+/\w+)/tf/(?:ref_)?(\d+)", topic):
            written, T_stream_reference = bag.first(topic), np.eye(4)
            if hasattr(written, "data"):  # newer releases write text
                numbers = {key: np.array(of.split(","), float) for key, of in _fields(written.data).items()}
                T_stream_reference[:3, :3] = numbers["rotation"].reshape(3, 3).T
                T_stream_reference[:3, 3] = numbers["translation"]
            else:
                T_stream_reference = rigid(written)
            links[match[1]] = f"reference {match[2]}", [], [np.linalg.inv(T_stream_reference)]
    return links


def _kind(topic: str, message: Any) -> tuple[str, str]:
    """Whether a topic's images are colour or depth, and their encoding."""
    encoding = getattr(message, "encoding", "") or getattr(message, "format", "no messages")
    try:
        image = decode(topic, message) if message else np.zeros((1, 1), np.uint8)
    except InputError:
        return "", encoding
    return "color" if image.ndim == 3 else "depth" if image.dtype != np.uint8 else "", encoding


def _chosen(
    bag: Bag, kind: str, topics: list[str], asked: str | None, kinds: dict[str, tuple[str, str]]
) -> str:
    raw = [topic for topic in topics if topic.rpartition("/")[0] not in topics]
    found = raw if asked is None else [topic for topic in topics if topic == asked]
    if len(found) != 1:
        problem = f"{len(raw)} topics are of {kind}" if asked is None else f"{asked} is no topic of {kind}"
        listed = ", ".join(f"{topic} ({kinds[topic][1]})" for topic in topics or kinds) or "none"
        raise InputError(f"{bag.path}: {problem}; give one by --{kind}-topic; images there are: {listed}")
    return found[0]


def _frame(bag: Bag, topic: str) -> str:
    """librealsense gives its streams no frames of their own."""
    match = _REALSENSE.match(topic)
    return match[1] if match else bag.first(topic).header.frame_id.strip("/")


def _stream(bag: Bag, topic: str) -> Stream:
    frame, match = _frame(bag, topic), _REALSENSE.match(topic)
    camera, model, coefficients = _camera(bag, topic, frame)
    unit = bag.first(f"{match[2]}/option/Depth_Units/value") if match else None
    units_per_m = round(1 / float(unit.data), 3) if unit else _MM_PER_M
    pixels_px = undistortion(f"{bag.path}: {topic}", camera, model, coefficients)
    notes = [] if pixels_px is None else ["distortion undone"]
    # Text in newer releases of librealsense, where headers have another clock.
    metadata = bag.messages(f"{frame}/image/metadata")
    said = {recorded_ns: _fields(of.data) for _, recorded_ns, of in metadata if hasattr(of, "data")}
    taken_s = {recorded_ns: float(of["timestamp"]) / 1000 for recorded_ns, of in said.items()}
    numbers = {int(of["Frame number"]) for of in said.values()}
    if lost := max(numbers, default=0) - min(numbers, default=1) + 1 - len(numbers):
        notes.append(f"{lost} of {lost + len(numbers)} frames were lost while recording")
    if domains := {of["timestamp_domain"] for of in said.values()} - {"Global Time", "System Time"}:
        notes.append(f"times are of the camera's own clock ({', '.join(domains)}), not the computer's")
    return Stream(topic, frame, camera, pixels_px, units_per_m, taken_s, notes)


def _camera(bag: Bag, topic: str, frame: str) -> tuple[Camera, str, np.ndarray]:
    """Camera, model and coefficients from the CameraInfo next to the images, or else of the same frame.

    Images whose topic's name says that they are rectified use the matrix P, and no distortion.
    """
    infos = {name: bag.first(name) for name in bag.topics("CameraInfo")}
    beside = [name for name in infos if topic.startswith(name.removesuffix("camera_info"))]
    beside += [name for name in infos if name == f"{frame}/info/camera_info"]
    beside = beside or [n for n, info in infos.items() if info and info.header.frame_id.strip("/") == frame]
    info = infos[max(beside, key=len)] if beside else None
    if info is None:
        raise InputError(f"{bag.path}: {topic}: has no CameraInfo beside it; record its camera_info too")
    K, D, P = (getattr(info, key if hasattr(info, key) else key.upper()) for key in "kdp")
    is_rectified = re.search("(?<![a-z])rect", topic.rpartition("/image")[2])
    fx, fy, cx, cy = (P[0], P[5], P[2], P[6]) if is_rectified else (K[0], K[4], K[2], K[5])
    camera = Camera(info.width, info.height, fx, fy, cx, cy)
    refuse_implausible(f"{bag.path}: {topic}: its CameraInfo", camera)
    return camera, info.distortion_model, np.zeros(0) if is_rectified else D


def _fields(text: str) -> dict[str, str]:
    """Of "a=1;b=2,3"."""
    return dict(pair.split("=", 1) for pair in text.split(";") if "=" in pair)

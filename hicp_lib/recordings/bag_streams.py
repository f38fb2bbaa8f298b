"""The colour and the depth of a bag: which topics they are, their cameras, and when each image was taken."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hicp_lib.core.camera import Camera
from hicp_lib.core.errors import InputError
from hicp_lib.recordings.bag_file import Bag, decode, stamp_s
from hicp_lib.recordings.bag_poses import Link, rigid
from hicp_lib.recordings.rectification import undistortion

_REALSENSE = re.compile(r"((/device_\d+/sensor_\d+)/\w+)/image/data")
_MM_PER_M = 1000.0


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
        Where an ideal camera finds its pixels in the images (`undistortion`).
    units_per_m : float
        Of depth in whole numbers.
    stamp_s : callable
        Time at which an image was taken, from the time it was recorded at (ns) and the message.
    """

    topic: str
    frame: str
    camera: Camera
    pixels_px: np.ndarray | None
    units_per_m: float
    stamp_s: Callable[[int, Any], float]


def find_streams(bag: Bag, color_topic: str | None, depth_topic: str | None) -> tuple[Stream, Stream]:
    """Colour and depth, by their messages.

    Of a topic that is there raw and compressed, the raw one is taken; of several of depth, the one that is
    in the frame of colour.

    Parameters
    ----------
    bag : Bag
    color_topic, depth_topic : str or None
        Those to be taken, where there are several.

    Returns
    -------
    color, depth : Stream

    Raises
    ------
    InputError
        If there is no such topic, or more than one; or its camera is not known.
    """
    shown: dict[str, str] = {}
    kinds: dict[str, list[str]] = {"colour": [], "depth": []}
    for topic in bag.topics("Image", "CompressedImage"):
        kind, shown[topic] = _kind(bag, topic)
        kinds.get(kind, []).append(topic)
    color = _chosen(bag, "colour", kinds["colour"], color_topic, shown)
    frame = _frame(bag, color)
    depths = kinds["depth"]
    if depth_topic is None:
        depths = [topic for topic in depths if _frame(bag, topic) == frame] or depths
    return _stream(bag, color), _stream(bag, _chosen(bag, "depth", depths, depth_topic, shown))


def realsense_links(bag: Bag) -> dict[str, Link]:
    """Where librealsense says its streams are, as links of one frame.

    Parameters
    ----------
    bag : Bag

    Returns
    -------
    dict of str to Link
        Empty where another recorder wrote the bag.
    """
    links = {}
    for topic in bag.types:
        if match := re.fullmatch(r"(/device_\d+/sensor_\d+/\w+)/tf/(\w+)", topic):
            written = bag.first(topic)
            if hasattr(written, "data"):
                numbers = _fields(written.data)
                T_stream_reference = np.eye(4)
                T_stream_reference[:3, :3] = np.reshape(_numbers(numbers["rotation"]), (3, 3)).T
                T_stream_reference[:3, 3] = _numbers(numbers["translation"])
            else:
                T_stream_reference = rigid(written)
            group = match[2].rpartition("_")[2]
            links[match[1]] = Link(f"reference {group}", True, [0.0], [np.linalg.inv(T_stream_reference)])
    return links


def _kind(bag: Bag, topic: str) -> tuple[str, str]:
    """What a topic's images show, and how a list of topics names it."""
    message = bag.first(topic)
    if message is None:
        return "none", f"{topic} (no messages)"
    try:
        image = decode(topic, message)
    except InputError as error:
        return "none", f"{error}"
    encoding = getattr(message, "encoding", None) or message.format
    kind = "colour" if image.ndim == 3 else "none" if image.dtype == np.uint8 else "depth"
    return kind, f"{topic} ({encoding})"


def _chosen(bag: Bag, kind: str, topics: list[str], asked: str | None, shown: dict[str, str]) -> str:
    option = f"--{'color' if kind == 'colour' else kind}-topic"
    raw = [topic for topic in topics if topic.rpartition("/")[0] not in topics]
    found = [topic for topic in topics if topic == asked] if asked is not None else raw
    if len(found) != 1:
        several = f"{len(raw)} topics are {kind}" if asked is None else f"{asked} is not a topic of {kind}"
        listed = ", ".join(topics if topics else shown.values()) or "none"
        raise InputError(f"{bag.path}: {several}; give one by {option}; there are: {listed}")
    return found[0]


def _frame(bag: Bag, topic: str) -> str:
    """librealsense gives its streams no frames."""
    match = _REALSENSE.match(topic)
    return match[1] if match else bag.first(topic).header.frame_id.strip("/")


def _stream(bag: Bag, topic: str) -> Stream:
    where, frame = f"{bag.path}: {topic}", _frame(bag, topic)
    camera, model, coefficients = _realsense_camera(bag, frame) or _ros_camera(bag, topic, frame)
    pixels_px = undistortion(where, camera, model, coefficients)
    units_per_m, match = _MM_PER_M, _REALSENSE.match(topic)
    if match:
        unit = bag.first(f"{match[2]}/option/Depth_Units/value")
        units_per_m = round(1 / float(unit.data), 3) if unit else _MM_PER_M
    taken_ms = {}
    if match and bag.types.get(f"{frame}/image/metadata", "").endswith("/String"):
        for _, recorded_ns, message in bag.messages(f"{frame}/image/metadata"):
            taken_ms[recorded_ns] = float(_fields(message.data)["timestamp"])

    def stamp(recorded_ns: int, message: Any) -> float:
        return taken_ms[recorded_ns] / 1e3 if recorded_ns in taken_ms else stamp_s(message)

    return Stream(topic, frame, camera, pixels_px, units_per_m, stamp)


def _ros_camera(bag: Bag, topic: str, frame: str) -> tuple[Camera, str, np.ndarray]:
    """Camera, model and coefficients of the CameraInfo beside the images, or else of the same frame.

    Images that their topic's name calls rectified have the matrix P, and no distortion.
    """
    infos = {name: bag.first(name) for name in bag.topics("CameraInfo")}
    beside = [name for name in infos if topic.startswith(name.removesuffix("camera_info"))]
    beside += [name for name in infos if name == f"{frame}/info/camera_info"]
    beside = beside or [n for n, info in infos.items() if info and info.header.frame_id.strip("/") == frame]
    info = infos[max(beside, key=len)] if beside else None
    if info is None:
        raise InputError(f"{bag.path}: {topic}: has no CameraInfo beside it; record its camera_info too")
    K, D, P = (getattr(info, key, getattr(info, key.upper(), None)) for key in ("k", "d", "p"))
    is_rectified = "rect" in topic.rpartition("/image")[2]
    fx, fy, cx, cy = (P[0], P[5], P[2], P[6]) if is_rectified else (K[0], K[4], K[2], K[5])
    if min(fx, fy) <= 0:
        raise InputError(f"{bag.path}: {topic}: its CameraInfo is not calibrated (focal length {fx:g})")
    size = info.width, info.height
    return Camera(*size, fx, fy, cx, cy), info.distortion_model, np.zeros(0) if is_rectified else D


def _realsense_camera(bag: Bag, frame: str) -> tuple[Camera, str, np.ndarray] | None:
    """As newer releases of librealsense write it; None otherwise.

    The CameraInfo beside it says plumb_bob of any model.
    """
    if not bag.types.get(f"{frame}/camera_info", "").endswith("/String"):
        return None
    said = _fields(bag.first(f"{frame}/camera_info").data)
    numbers = (float(said[key]) for key in ("fx", "fy", "ppx", "ppy"))
    camera = Camera(int(said["width"]), int(said["height"]), *numbers)
    return camera, said["model"], _numbers(said["coeffs"])


def _fields(text: str) -> dict[str, str]:
    """Of "a=1;b=2,3"."""
    return dict(pair.split("=", 1) for pair in text.split(";") if "=" in pair)


def _numbers(text: str) -> np.ndarray:
    return np.array(text.split(","), float)

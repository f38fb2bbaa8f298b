"""Messages of bags: ROS 1, ROS 2 in SQLite or MCAP, and librealsense's, which use either format."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from hicp_lib.core.errors import InputError, one_line
from hicp_lib.core.extras import needs
from hicp_lib.core.images import decode as decode_pixels
from hicp_lib.core.limited import went_on

_ROS1 = b"#ROSBAG V"
_SURPLUS_BYTES = 4  # librealsense appends the depth unit to an image, as the message has no field for it
_RGB, _BGR = [0, 1, 2], [2, 1, 0]
_ENCODINGS: dict[str, tuple[str, int, Any]] = {  # type, channels, and those that are used
    "rgb8": ("u1", 3, _RGB), "rgba8": ("u1", 4, _RGB), "bgr8": ("u1", 3, _BGR), "bgra8": ("u1", 4, _BGR),
    "16UC1": ("u2", 1, 0), "mono16": ("u2", 1, 0), "32FC1": ("f4", 1, 0),
}  # fmt: skip


@dataclass(frozen=True)
class Bag:
    """A bag that is open.

    Attributes
    ----------
    path : Path
    reader : rosbags.highlevel.AnyReader
    """

    path: Path
    reader: Any

    def topics(self, *types: str) -> list[str]:
        """Topics with messages of these types, named without their package."""
        named = {c.topic: c.msgtype.rpartition("/")[2] for c in self.reader.connections}
        return sorted(topic for topic, name in named.items() if name in types)

    def messages(self, *topics: str) -> Iterator[tuple[str, int, Any]]:
        """Topic, time of recording in nanoseconds, and content of every message."""
        connections = [c for c in self.reader.connections if c.topic in topics]
        for connection, recorded_ns, raw in self.reader.messages(connections) if connections else ():
            went_on()
            try:
                message = self.reader.deserialize(raw, connection.msgtype)
            except Exception:
                message = self.reader.deserialize(raw[:-_SURPLUS_BYTES], connection.msgtype)
            yield connection.topic, recorded_ns, message

    def first(self, topic: str) -> Any:
        """Content of a topic's first message; None if there is none."""
        return next((message for _, _, message in self.messages(topic)), None)


@contextmanager
def open_bag(path: str | Path) -> Iterator[Bag]:
    """Open a bag.

    Parameters
    ----------
    path : str or Path
        `.bag`, `.db3`, `.mcap`, or the folder of a ROS 2 bag.

    Yields
    ------
    Bag

    Raises
    ------
    Exception
        If it is not a bag or damaged, here or during use, of many kinds: call it in a separate process
        (`hicp_lib.core.limited.limited_child`).
    """
    with needs("bags"):
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    types = get_typestore(Stores.LATEST)  # for files without type definitions
    if Path(path).suffix == ".bag":  # whose reader searches for the end of the first line without limit
        with open(path, "rb") as file:
            if file.read(len(_ROS1)) != _ROS1:
                raise InputError(f"{path}: does not begin as a bag of ROS 1 or RealSense does; get it again")
    with AnyReader([Path(path)], default_typestore=types) as reader:
        yield Bag(Path(path), reader)


def stamp_s(message: Any) -> float:
    """Time in a message's header, in seconds.

    Parameters
    ----------
    message : Any
        Of a bag.

    Returns
    -------
    float
    """
    return message.header.stamp.sec + message.header.stamp.nanosec / 1e9


def decode(where: str, message: Any) -> np.ndarray:
    """The pixels of an `Image` or `CompressedImage` message.

    Parameters
    ----------
    where : str
        The bag and the topic, for messages.
    message : Any

    Returns
    -------
    array, shape (height, width, 3) or (height, width)
        Colour as RGB; depth as whole numbers of the file's unit, or as metres.

    Raises
    ------
    InputError
        If it is damaged, or neither colour nor depth.
    """
    if hasattr(message, "format"):
        return _decompressed(where, message)
    if message.encoding not in _ENCODINGS:
        known = ", ".join(_ENCODINGS)
        raise InputError(f"{where}: images are {message.encoding}; record them as one of {known}")
    kind, n_channels, taken = _ENCODINGS[message.encoding]
    dtype = np.dtype((">" if message.is_bigendian else "<") + kind)
    try:
        rows = np.frombuffer(message.data, np.uint8).reshape(message.height, message.step)
        values = rows[:, : message.width * n_channels * dtype.itemsize].copy().view(dtype)
        return values.reshape(message.height, message.width, n_channels)[..., taken].astype(kind)
    except ValueError as error:
        raise InputError(f"{where}: an image is not whole ({one_line(error)})") from None


def _decompressed(where: str, message: Any) -> np.ndarray:
    """JPEG or PNG; depth has a header of twelve bytes, of which the last eight encode floats."""
    is_depth, content = "compresseddepth" in message.format.lower(), np.asarray(message.data, np.uint8)
    image = decode_pixels(content[12 * is_depth :], f"{where}: {message.format[:40]!r}", cv2.IMREAD_UNCHANGED)
    if is_depth and message.format.startswith("32FC1"):
        scale, offset = content[4:12].copy().view("<f4")
        with np.errstate(divide="ignore"):
            return np.where(image > 0, scale / (image - offset), 0).astype(np.float32)
    if image.ndim == 3:
        return np.ascontiguousarray(image[..., _RGB if "compressed rgb8" in message.format else _BGR])
    return image

"""Bags of ROS 1 and ROS 2 with known content, written by rosbags."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

KINDS = ("ros1", "sqlite3", "mcap")
WIDTH, HEIGHT = 32, 24
K = [30.0, 0, 15.5, 0, 31.0, 11.5, 0, 0, 1]
COLOR, DEPTH = "/camera/color/image_raw", "/camera/aligned_depth_to_color/image_raw"
OPTICAL = "color_optical"


class Messages:
    """Makes messages of one generation of ROS."""

    def __init__(self, kind: str):
        self.is_ros1 = kind == "ros1"
        self.store = get_typestore(Stores.ROS1_NOETIC if self.is_ros1 else Stores.ROS2_HUMBLE)
        if self.is_ros1:
            definition = "geometry_msgs/TransformStamped[] transforms"
            self.store.register(get_types_from_msg(definition, "tf2_msgs/msg/TFMessage"))

    def of(self, name: str, /, **fields):
        return self.store.types[name](**fields)

    def header(self, time_s: float, frame: str):
        ns = round(time_s * 1e9)
        stamp = self.of("builtin_interfaces/msg/Time", sec=ns // 10**9, nanosec=ns % 10**9)
        sequence = {"seq": 0} if self.is_ros1 else {}
        return self.of("std_msgs/msg/Header", stamp=stamp, frame_id=frame, **sequence)

    def image(
        self, time_s: float, frame: str, encoding: str, values: np.ndarray, padding: int = 0, big=False
    ):
        rows = values.reshape(len(values), -1).astype(values.dtype.newbyteorder(">" if big else "<"))
        data = np.pad(rows.view(np.uint8), ((0, 0), (0, padding)), constant_values=77)
        return self.of(
            "sensor_msgs/msg/Image", header=self.header(time_s, frame), height=values.shape[0],
            width=values.shape[1], encoding=encoding, is_bigendian=int(big), step=data.shape[1],
            data=data.ravel(),
        )  # fmt: skip

    def compressed(self, time_s: float, frame: str, form: str, content: bytes):
        data = np.frombuffer(content, np.uint8)
        header = self.header(time_s, frame)
        return self.of("sensor_msgs/msg/CompressedImage", header=header, format=form, data=data)

    def info(self, frame: str, D=(), model: str = "plumb_bob", matrix=K, size=(WIDTH, HEIGHT), P=None):
        roi = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
        P = P or [*matrix[:3], 0, *matrix[3:6], 0, *matrix[6:], 0]
        arrays = {
            "d": np.array(D, float),
            "k": np.array(matrix),
            "r": np.eye(3).ravel(),
            "p": np.array(P, float),
        }
        return self.of(
            "sensor_msgs/msg/CameraInfo", header=self.header(1, frame), width=size[0], height=size[1],
            distortion_model=model, binning_x=0, binning_y=0,
            roi=self.of("sensor_msgs/msg/RegionOfInterest", **roi),
            **{key.upper() if self.is_ros1 else key: of for key, of in arrays.items()},
        )  # fmt: skip

    def tf(self, time_s: float, parent: str, frame: str, xyz, xyzw=(0.0, 0, 0, 1)):
        names = [
            f"geometry_msgs/msg/{name}" for name in ("Vector3", "Quaternion", "Transform", "TransformStamped")
        ]
        translation = self.of(names[0], **dict(zip("xyz", map(float, xyz), strict=True)))
        rotation = self.of(names[1], **dict(zip("xyzw", map(float, xyzw), strict=True)))
        moved = self.of(names[2], translation=translation, rotation=rotation)
        link = self.of(names[3], header=self.header(time_s, parent), child_frame_id=frame, transform=moved)
        return self.of("tf2_msgs/msg/TFMessage", transforms=[link])

    def joints(self, time_s: float, angles_rad: dict[str, float]):
        position, none = np.array(list(angles_rad.values()), float), np.zeros(0)
        header = self.header(time_s, "")
        return self.of("sensor_msgs/msg/JointState", header=header, name=list(angles_rad), position=position,
                       velocity=none, effort=none)  # fmt: skip


@contextmanager
def writing(path: Path, kind: str):
    """A function that writes a message: topic, message, and the time of recording in seconds."""
    messages = Messages(kind)
    if kind == "ros1":
        writer, serialize = Writer1(path), messages.store.serialize_ros1
    else:
        writer, serialize = Writer2(path, version=9, storage_plugin=StoragePlugin[kind.upper()]), None
        serialize = messages.store.serialize_cdr
    connections: dict = {}
    with writer:

        def write(topic: str, message, recorded_s: float) -> None:
            name = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, name, typestore=messages.store)
            writer.write(connections[topic], round(recorded_s * 1e9), serialize(message, name))

        yield write, messages


def rgb(k: int) -> np.ndarray:
    return np.full((HEIGHT, WIDTH, 3), (200, 20, 10 * k), np.uint8)


def depth_mm(k: int) -> np.ndarray:
    return np.full((HEIGHT, WIDTH), 1500 + k, np.uint16)


def png(image: np.ndarray) -> bytes:
    return cv2.imencode(".png", image)[1].tobytes()


def write_bag(folder: Path, kind: str = "mcap", n: int = 4, **changes) -> Path:
    """`n` frames at 10 Hz from 100 s, recorded two seconds later; depth 4 ms after colour.

    Changes: `color`, `depth` (functions of messages, time and k to a message), `info` and `depth_info`
    (arguments of the camera infos), `depth_topic`, `color_topic`, `more` (function of write and messages).
    """
    path = folder / ("x.bag" if kind == "ros1" else "x")
    use = SimpleNamespace(
        color=lambda m, t, k: m.image(t, OPTICAL, "rgb8", rgb(k)),
        depth=lambda m, t, k: m.image(t, OPTICAL, "16UC1", depth_mm(k)),
        info={"frame": OPTICAL}, depth_info={"frame": OPTICAL}, color_topic=COLOR, depth_topic=DEPTH,
        more=lambda write, m: None,
    )  # fmt: skip
    vars(use).update(changes)
    with writing(path, kind) as (write, m):
        for topic, info in ((use.color_topic, use.info), (use.depth_topic, use.depth_info)):
            if info:
                write(topic.split("/image")[0] + "/camera_info", m.info(**info), 102)
        use.more(write, m)
        for k in range(n):
            t = 100 + k / 10
            write(use.color_topic, use.color(m, t, k), t + 2)
            write(use.depth_topic, use.depth(m, t + 0.004, k), t + 2.001)
    return path

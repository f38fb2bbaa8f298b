"""Recordings, bags and motion capture: files that tell sizes, times and names that cannot be."""

from __future__ import annotations

import json
import shutil
import struct
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from hicp_lib.recordings.qualisys import MotionCapture, write_tsv
from hicp_lib.robot.kinematics import HEAD_JOINTS
from tests.hostile.annotations import put
from tests.hostile.case import Case
from tests.hostile.good import IMPORT_OPEN3D, LIFT, READERS, write_c3d
from tests.hostile.special_files import prepare
from tests.recordings.c3d_files import make_c3d
from tests.recordings.ros_bags import COLOR, OPTICAL, write_bag

CAMERAS: dict[str, Callable[[Any], Any]] = {
    "focal length 1e7": put("intrinsic_matrix", 0, value=1e7),
    "focal length 1e-9": put("intrinsic_matrix", 0, value=1e-9),
    "focal length negative": put("intrinsic_matrix", 0, value=-30.0),
    "focal length 0": put("intrinsic_matrix", 4, value=0),
    "focal length NaN": put("intrinsic_matrix", 0, value=float("nan")),
    "centre 1e9": put("intrinsic_matrix", 6, value=1e9),
    "width 1e6": put("width", value=10**6),
    "width 1e12": put("width", value=10**12),
    "width 0": put("width", value=0),
    "width a text": put("width", value="32"),
    "depth scale 0": put("depth_scale", value=0),
    "depth scale 1e300": put("depth_scale", value=1e300),
    "depth scale inf": put("depth_scale", value=float("inf")),
    "depth scale of 400 digits": put("depth_scale", value=10**400),
}  # fmt: skip
LISTS = {
    "time NaN": "nan rgb/000000.jpg\n",
    "time 1e308": "1e308 rgb/000000.jpg\n",
    "time a text": "now rgb/000000.jpg\n",
    "no name": "100.0\n",
    "out of the folder": "100.0 ../../../etc/passwd\n",
    "absolute": "100.0 /etc/passwd\n",
    "with NUL": "100.0 a\0b.jpg\n",
    "a line of 10 MB": "100.0 " + "a" * 10_000_000 + "\n",
    "times that fall": "".join(f"{100 - k} rgb/00000{k}.jpg\n" for k in range(4)),
    "UTF-16": "100.0 rgb/000000.jpg\n".encode("utf-16"),
    "the same image 300,000 times": "".join(f"{k} rgb/000000.jpg\n" for k in range(300_000)),
}
POSES = {
    "quaternion 0": "100 0 0 0 0 0 0 0\n",
    "quaternion NaN": "100 0 0 0 nan 0 0 1\n",
    "translation 1e300": "100 1e300 0 0 0 0 0 1\n",
    "seven numbers": "100 0 0 0 0 0 1\n",
    "texts": "a b c d e f g h\n",
    "a time of 400 digits": "1" * 400 + " 0 0 0 0 0 0 1\n",
}  # fmt: skip


def c3d_files() -> dict[str, Callable[[], bytes]]:
    points = np.random.default_rng(0).normal(size=(20, 2, 3)) * 500
    good = partial(make_c3d, points, (b"a", b"b"))
    return {
        "65535 markers": lambda: good(header={"m": 65535}, point={"USED": 65535}),
        "frames that are not there": lambda: good(header={"last": 65535}, point={"FRAMES": 65535}),
        "65535 analog channels": lambda: good(header={"n_analog": 65535}),
        "data before the header": lambda: good(header={"start": 0}, point={"DATA_START": 0}),
        "data after the end": lambda: good(header={"start": 65535}, point={"DATA_START": 65535}),
        "scale 0": lambda: good(header={"scale": 0.0}, point={"SCALE": 0.0}),
        "scale NaN": lambda: good(header={"scale": float("nan")}, point={"SCALE": float("nan")}),
        "rate 0": lambda: good(header={"rate": 0.0}, point={"RATE": 0.0}),
        "rate inf": lambda: good(header={"rate": float("inf")}, point={"RATE": float("inf")}),
        "rate 1e30": lambda: good(header={"rate": 1e30}, point={"RATE": 1e30}),
        "no markers": lambda: good(header={"m": 0}, point={"USED": 0}),
        "no parameters": lambda: good()[:512] + bytes(1024) + good()[1536:],
        "a group that leads to itself": lambda: good()[:516] + b"\x05\xffPOINT\0\0\0" + good()[526:],
        "a parameter of 7 dimensions": lambda: good()[:540] + b"\x07" + b"\xff" * 7 + good()[548:],
        "the header alone": lambda: good()[:512],
        "markers at 1e30": lambda: make_c3d(points * 1e28, (b"a", b"b")),
        "another machine's numbers": lambda: make_c3d(points, (b"a", b"b"), processor=99),
        "of noise": lambda: good()[:512] + np.random.default_rng(1).bytes(4096),
    }


def bags(folder: Path) -> dict[str, Callable[[], None]]:
    """Bags whose messages tell what cannot be; written over the good one."""

    def changed(**changes) -> None:
        shutil.rmtree(folder / "mcap", ignore_errors=True)
        made = write_bag(folder / "made", "mcap", 2, **changes) if (folder / "made").mkdir() is None else None
        assert made
        made.rename(folder / "mcap")

    def color(**fields):
        def make(m, time_s, k):
            message = m.image(time_s, OPTICAL, "rgb8", np.full((24, 32, 3), 9, np.uint8))
            for name, value in fields.items():
                object.__setattr__(message, name, value)
            return message

        return make

    def compressed(form: str, content: bytes):
        return lambda m, time_s, k: m.compressed(time_s, OPTICAL, form, content)

    from tests.hostile.images import png

    topic = COLOR + "/compressed"
    return {
        "height 2^31": lambda: changed(color=color(height=2**31)),
        "width 0": lambda: changed(color=color(width=0)),
        "step 0": lambda: changed(color=color(step=0)),
        "no pixels": lambda: changed(color=color(data=np.zeros(0, np.uint8))),
        "an encoding nobody knows": lambda: changed(color=color(encoding="<svg onload=x()>\x1b[2J")),
        "camera of 10^6 pixels a side": lambda: changed(info={"frame": OPTICAL, "size": (10**6, 10**6)}),
        "focal length NaN": lambda: changed(info={"frame": OPTICAL, "matrix": [float("nan")] * 9}),
        "focal length 1e300": lambda: changed(info={"frame": OPTICAL, "matrix": [1e300, *[0] * 7, 1]}),
        "distortion 1e30": lambda: changed(info={"frame": OPTICAL, "D": [1e30, 0, 0, 0, 0]}),
        "a compressed bomb": lambda: changed(color=compressed("png", png(30_000, 30_000)), color_topic=topic),
        "compressed noise": lambda: changed(color=compressed("jpeg", b"\xff\xd8\xff\0"), color_topic=topic),
    }  # fmt: skip


def _text_bags() -> Iterator[tuple[str, str, Callable[[Path], None]]]:
    def cut(name: str, share: float, folder: Path) -> None:
        content = (folder / name).read_bytes()
        (folder / name).write_bytes(content[: int(share * len(content))])

    def overwrite(name: str, at: float, content: bytes, folder: Path) -> None:
        whole = bytearray((folder / name).read_bytes())
        start = int(at * len(whole))
        whole[start : start + len(content)] = content
        (folder / name).write_bytes(whole)

    def metadata(content: str, folder: Path) -> None:
        (folder / "mcap" / "metadata.yaml").write_text(content)

    for reader in ("ros1", "mcap", "sqlite"):
        name = READERS[f"import {reader}"][1]
        for share in (0.02, 0.5, 0.98):
            yield reader, f"{share:.0%} of it", partial(cut, name, share)
        for at in (0.05, 0.3, 0.6):
            yield reader, f"lengths of 2^32 - 1 at {at:.0%}", partial(overwrite, name, at, b"\xff" * 64)
            yield reader, f"zeros at {at:.0%}", partial(overwrite, name, at, bytes(256))
    yield "mcap", "no metadata in YAML", partial(metadata, "a: [")
    yield "mcap", "metadata that is a list", partial(metadata, "[1, 2]")
    bomb = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"{b}: &{b} [{', '.join([f'*{a}'] * 9)}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
    )
    yield "mcap", "metadata of nine billion laughs", partial(metadata, bomb)
    yield (
        "mcap",
        "metadata that makes objects",
        partial(metadata, "!!python/object/apply:os.system ['touch x']"),
    )
    yield (
        "mcap",
        "metadata that leads elsewhere",
        partial(metadata, "rosbag2_bagfile_information: {relative_file_paths: [../../../etc/passwd]}"),
    )


def _bag_of_ros1_with_a_bomb(folder: Path) -> None:
    """A chunk that says it is 4 GB once it is unpacked."""
    content = bytearray((folder / "x.bag").read_bytes())
    at = content.index(b"size=") + 5
    content[at : at + 4] = struct.pack("<I", 2**32 - 1)
    (folder / "x.bag").write_bytes(content)


def _write(target: str, content: bytes | str, folder: Path) -> None:
    prepare(folder)
    (folder / target).write_bytes(content if isinstance(content, bytes) else content.encode())


def _camera(change, folder: Path) -> None:
    path = folder / "rec" / "camera.json"
    path.write_text(json.dumps(change(json.loads(path.read_text()))))


def _made(name: str, content: Callable[[], bytes], folder: Path) -> None:
    (folder / name).write_bytes(content())


def _bag(kind: str, folder: Path) -> None:
    bags(folder)[kind]()
    shutil.rmtree(folder / "made")


def _tsv(change: Callable[[str], str], folder: Path) -> None:
    text = (folder / "mocap.tsv").read_text()
    assert change(text) != text
    (folder / "mocap.tsv").write_text(change(text))


def _far_markers(write, name: str, folder: Path) -> None:
    (folder / name).unlink()
    points = np.full((40, 2, 3), 1e27)
    write(folder / name, MotionCapture(100 + np.arange(40) / 100, ("elbow", "wrist"), points, 100.0))


def _joints(value: object, folder: Path) -> None:
    table = pd.DataFrame(0.0, range(4), ["t_s", *(f"{joint}_deg" for joint in HEAD_JOINTS)])
    table = table.assign(t_s=np.arange(4) / 10).astype(object)
    table.iloc[1, 1] = value
    table.to_csv(folder / "joints.csv", index=False)


TSV = {
    "frames 1e12": lambda text: text.replace("NO_OF_FRAMES\t40", "NO_OF_FRAMES\t1000000000000"),
    "rate 0": lambda text: text.replace("FREQUENCY\t100", "FREQUENCY\t0"),
    "rate NaN": lambda text: text.replace("FREQUENCY\t100", "FREQUENCY\tnan"),
    "markers 10^9": lambda text: text.replace("NO_OF_MARKERS\t2", "NO_OF_MARKERS\t1000000000"),
    "the same name twice": lambda text: text.replace("elbow", "wrist"),
    "numbers that are texts": lambda text: text.replace("500.000", "<b>"),
    "positions of 1e300": lambda text: text.replace("500.000", "1e300"),
    "UTF-16": lambda text: text.encode("utf-16").decode("latin-1"),
}
INTRINSICS = {
    "fps 0": put("fps", value=0), "fps NaN": put("fps", value=float("nan")),
    "fps 1e300": put("fps", value=1e300),
    "width 1e9": put("width", value=10**9), "focal length 1e12": put("intrinsic_matrix", 0, value=1e12),
    "matrix of 8": put("intrinsic_matrix", value=[1] * 8), "depth scale -1": put("depth_scale", value=-1),
}  # fmt: skip


def _intrinsic(change, folder: Path) -> None:
    path = folder / "open3d" / "intrinsic.json"
    path.write_text(json.dumps(change(json.loads(path.read_text()))))


def cases() -> Iterator[Case]:
    for kind, change in CAMERAS.items():
        for command in ("record check rec", f"{LIFT} --out out.parquet", "inspect rec"):
            yield Case(f"recording: {command.split()[0]}: camera: {kind}", command, partial(_camera, change))
    for kind, text in LISTS.items():
        yield Case(f"recording: list: {kind}", "record check rec", partial(_write, "rec/rgb.txt", text))
        yield Case(
            f"recording: inspect: list: {kind}",
            "inspect rec",
            partial(_write, "rec/rgb.txt", text),
            exits=(0, 2),
        )
    for kind, text in POSES.items():
        yield Case(
            f"recording: poses: {kind}", "record check rec", partial(_write, "rec/groundtruth.txt", text)
        )
        command = READERS["import poses"][0]
        yield Case(f"recording: imported poses: {kind}", command, partial(_write, "poses.txt", text))
    for kind, value in {"NaN": "nan", "1e300": 1e300, "a text": "<b>", "400 digits": "9" * 400}.items():
        command = f"{IMPORT_OPEN3D} --poses joints.csv"
        yield Case(f"recording: joints: {kind}", command, partial(_joints, value))
    for kind, content in c3d_files().items():
        exits = (2,) if "1e30" in kind or "NaN" in kind or "inf" in kind else (0, 2)
        yield Case(
            f"C3D: inspect: {kind}", "inspect mocap.c3d", partial(_made, "mocap.c3d", content), exits=exits
        )
        yield Case(
            f"C3D: check: {kind}", "record check rec", partial(_made, "rec/mocap.c3d", content), exits=(0, 2)
        )
    for kind, change in TSV.items():
        yield Case(f"TSV: inspect: {kind}", "inspect mocap.tsv", partial(_tsv, change))
    for write, name in ((write_tsv, "mocap.tsv"), (write_c3d, "mocap.c3d")):
        yield Case(
            f"{name[-3:].upper()}: markers at 1e30 mm", f"inspect {name}", partial(_far_markers, write, name)
        )
    for reader, kind, make in _text_bags():
        command, name = READERS[f"import {reader}"]
        yield Case(f"bag: {reader}: {kind}", command, make, exits=(0, 2), notes=True)
        yield Case(f"bag: inspect {reader}: {kind}", f"inspect {name}", make, exits=(0, 2), notes=True)
    for kind in bags(Path()):
        yield Case(
            f"bag: message: {kind}", READERS["import mcap"][0], partial(_bag, kind), exits=(2,), notes=True
        )
    yield Case("bag: a chunk of 4 GB", READERS["import ros1"][0], _bag_of_ros1_with_a_bomb, exits=(0, 2))
    for kind, change in INTRINSICS.items():
        yield Case(f"recording: Open3D: {kind}", READERS["import open3d"][0], partial(_intrinsic, change))

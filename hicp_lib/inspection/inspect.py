"""What a file or a folder is, by its content: its name is not believed."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from hicp_lib.core import video
from hicp_lib.core.errors import InputError, one_line
from hicp_lib.core.files import read_bytes
from hicp_lib.detectors.onnx.model_file import read_model
from hicp_lib.inspection.facts import Facts
from hicp_lib.inspection.folders import inspect_folder
from hicp_lib.inspection.json_files import inspect_json
from hicp_lib.inspection.recordings import inspect_bag
from hicp_lib.inspection.tables import inspect_detections_table, inspect_mocap, inspect_text

_HEAD_BYTES = 8192
_PRINTED = {*b"\t\r\n\f\x1a", *range(32, 256)}  # what texts are made of, in any code page


def inspect(path: str | Path) -> Facts:
    """Say what a file or a folder is, and what it needs to be used.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Facts
        With `problem` where the kind is known and the content cannot be used.

    Raises
    ------
    InputError
        If it cannot be read, or is of no kind that is known.
    """
    path = Path(path)
    if path.is_dir():
        return inspect_folder(path)
    if not path.is_file():
        raise InputError(f"{path}: is no file and no folder; check the path")
    with open(path, "rb") as file:
        head = file.read(_HEAD_BYTES)
    if not head:
        raise InputError(f"{path}: is empty")
    kind, inspected = next((kind, of) for fits, kind, of in _KINDS if fits(head))
    try:
        return inspected(path)
    except InputError as error:
        if not kind:
            raise
        return Facts(path, kind, problem=str(error).removeprefix(f"{path}: "))


def _image(path: Path) -> Facts:
    content = np.frombuffer(read_bytes(path, "expected an image"), np.uint8)
    pixels = cv2.imdecode(content, cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION)
    if pixels is None:
        raise InputError(f"{path}: is cut off, or no image that OpenCV can decode")
    height_px, width_px = pixels.shape[:2]
    channels = 1 if pixels.ndim == 2 else pixels.shape[2]
    says = {"size": f"{width_px} x {height_px} pixels, {channels} channels of {8 * pixels.itemsize} bits"}
    if pixels.dtype == np.uint16 and channels == 1:
        known = pixels[pixels > 0]
        middle = f"median {np.median(known):.0f}" if known.size else "nothing measured"
        says["depth"] = f"raw units, {100 * known.size / pixels.size:.0f} % measured, {middle}"
        return Facts(path, "depth image", says, needs={"hicp record import": "its folder, and --depth-scale"})
    return Facts(path, "image", says, needs={"hicp detect": "--images, the folder it lies in"})


def _video(path: Path) -> Facts:
    frames = video.read_frames(path)
    first = next(frames, None)
    if first is None:
        raise InputError(f"{path}: OpenCV decodes no frame of it")
    second = next(frames, None)
    height_px, width_px = first[1].shape[:2]
    says = {
        "size": f"{width_px} x {height_px} pixels",
        "frames": f"{video.count_frames(path)} as the file says",
    }
    if second is not None and second[0] > first[0]:
        says["times"] = f"of the file; {1 / (second[0] - first[0]):.4g} per second at the start"
    return Facts(path, "video", says, needs={"hicp detect": "--images, this file"})


def _parquet(path: Path) -> Facts:
    try:
        table = pd.read_parquet(path)
    except (OSError, ValueError, ImportError) as error:
        raise InputError(f"{path}: cannot be read as Parquet ({one_line(error)})") from None
    if {"keypoint", "u_px", "v_px", "image_id"} <= set(table):
        return inspect_detections_table(path)
    return Facts(path, "table", {"rows": str(len(table)), "columns": ", ".join(map(str, table))[:400]})


def _network(path: Path) -> Facts:
    model = read_model(path, read_bytes(path, "expected an ONNX file"))
    said = {name: str(value)[:80] for name, value in list(model.metadata.items())[:5]}
    says = {"kinds of operators": str(len(model.operators)), **said}
    return Facts(path, "ONNX network", says, needs={"hicp detect": f"--detector NAME --model {path.name}"})


def _text(path: Path) -> Facts:
    head = read_bytes(path, "expected a text file")[:_HEAD_BYTES].decode("utf-8", errors="replace")
    return inspect_text(path, head)


def _begins(*starts: bytes) -> Callable[[bytes], bool]:
    return lambda head: head.startswith(starts)


def _is_json(head: bytes) -> bool:
    return head.removeprefix(b"\xef\xbb\xbf").lstrip()[:1] in (b"{", b"[")


def _is_video(head: bytes) -> bool:
    is_avi = head[:4] == b"RIFF" and head[8:11] == b"AVI"
    return is_avi or head[4:8] == b"ftyp" or head[:4] == b"\x1aE\xdf\xa3"


def _is_text(head: bytes) -> bool:
    return not set(head) - _PRINTED


def _is_c3d(head: bytes) -> bool:
    return head[1:2] == b"\x50" and not _is_text(head[:512])


_IMAGES = _begins(b"\x89PNG", b"\xff\xd8\xff", b"BM", b"II*\0", b"MM\0*")
_KINDS: list[tuple[Callable[[bytes], bool], str, Callable[[Path], Facts]]] = [
    (_begins(b"#ROSBAG", b"SQLite format 3", b"\x89MCAP"), "bag", inspect_bag),
    (_is_video, "video", _video),
    (lambda head: _IMAGES(head) or head[8:12] == b"WEBP", "image", _image),
    (_begins(b"PAR1"), "Parquet table", _parquet),
    (_is_c3d, "C3D", lambda path: inspect_mocap(path, "C3D")),
    (_is_json, "", inspect_json),
    (_is_text, "", _text),
    (lambda head: True, "", _network),
]

"""C3D files byte by byte, after the public description of the format; what is said twice may differ."""

import struct

import numpy as np


def _section(entries):
    """Groups, each of parameters: whole numbers, floats, or lists of texts as bytes."""
    body = b""
    for number, (group, parameters) in enumerate(entries.items(), start=1):
        body += struct.pack("<bb", len(group), -number) + group.encode() + struct.pack("<hb", 3, 0)
        for name, value in parameters.items():
            array = np.atleast_1d(value)
            if array.dtype.kind == "S":
                width = array.dtype.itemsize
                kind, dims, data = -1, [width, len(array)], b"".join(x.ljust(width) for x in array.tolist())
            else:
                kind = 4 if array.dtype.kind == "f" else 2
                dims = [] if np.ndim(value) == 0 else [len(array)]
                data = (
                    array.astype("<f4").tobytes()
                    if kind == 4
                    else array.astype("<i8").astype("<u2").tobytes()
                )
            content = struct.pack("<bB", kind, len(dims)) + bytes(dims) + data + b"\0"
            body += struct.pack("<bb", len(name), number) + name.encode()
            body += struct.pack("<h", 2 + len(content)) + content
    return body


def make_c3d(
    points, names=(b"m",), *, n_analog=0, header=None, scale=-1.0, processor=84, point=None, **groups
) -> bytes:
    """Points (n, m, 3) in the file's units, n_analog floats after each frame's; NaN has the residual -1.

    `header` changes fields of the first block, `point` parameters of POINT; None leaves one out.
    """
    n, m, _ = points.shape
    point = {"USED": m, "SCALE": scale, "RATE": 100.0, "DATA_START": 4, "FRAMES": n, "UNITS": [b"mm"],
             "LABELS": list(names)} | (point or {})  # fmt: skip
    entries = {"POINT": {name: value for name, value in point.items() if value is not None}, **groups}
    told = {"m": m, "n_analog": n_analog, "first": 1, "last": n, "scale": scale, "start": 4, "rate": 100.0}
    told |= header or {}
    block = struct.pack(
        "<BBHHHHHfHHf", 2, 80, told["m"], told["n_analog"], told["first"], told["last"], 10, told["scale"],
        told["start"], 1, told["rate"],
    )  # fmt: skip
    parameters = bytes([1, 80, 2, processor]) + _section(entries)
    residuals = np.where(np.isnan(points).any(axis=2), -1.0, 0.0)
    rows = np.concatenate([np.nan_to_num(points), residuals[..., None]], axis=2).reshape(n, -1)
    rows = np.concatenate([rows, np.full((n, n_analog), 7.0)], axis=1).astype("<f4").tobytes()
    return (
        block.ljust(512, b"\0")
        + parameters.ljust(1024, b"\0")
        + rows.ljust(-(-len(rows) // 512) * 512, b"\0")
    )

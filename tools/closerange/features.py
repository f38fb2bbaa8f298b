"""The frozen layers' outputs for all squares, computed once, in 16 bits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnxruntime

from hicp_lib.core.files import sha256_bytes, sha256_file

from .frozen import SHAPES, frozen_layers

TRUTH = ("keypoints_px", "seen", "body", "picture", "view")


def load_truth(squares: Path) -> dict[str, np.ndarray]:
    """`keypoints_px` (n, 136, 2), `seen` (n, 136), `body`, `picture`, `view` (n,) of all squares."""
    parts = [np.load(path) for path in _files(squares)]
    return {name: np.concatenate([part[name] for part in parts]) for name in TRUTH}


def load_features(squares: Path, lightning: Path, names: list[str], threads: int) -> dict[str, np.ndarray]:
    """Memory-mapped features by name, shape (n, channels, side, side), dtype float16; made if not there.

    Made anew if a file of squares or the frozen network is another.
    """
    prefix = frozen_layers(lightning, names).SerializeToString()
    stamp = sha256_bytes(prefix + squares_sha256(squares).encode())
    made = squares / "features" / "stamp.txt"
    n = len(load_truth(squares)["seen"])
    shapes = {name: (n, *of) for name, of in SHAPES.items() if name in names}
    places = {name: squares / "features" / f"{name}.f16" for name in names}
    if not made.exists() or made.read_text() != stamp:
        made.parent.mkdir(exist_ok=True)
        made.unlink(missing_ok=True)
        maps = {name: np.memmap(places[name], np.float16, "w+", shape=shapes[name]) for name in names}
        _fill(squares, prefix, maps, threads)
        made.write_text(stamp)
    return {name: np.memmap(places[name], np.float16, "r", shape=shapes[name]) for name in names}


def squares_sha256(squares: Path) -> str:
    """Hash of all files of squares."""
    return sha256_bytes("".join(f"{path.name} {sha256_file(path)}\n" for path in _files(squares)).encode())


def _fill(squares_dir: Path, prefix: bytes, maps: dict[str, np.ndarray], threads: int) -> None:
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    session = onnxruntime.InferenceSession(prefix, options, providers=["CPUExecutionProvider"])
    row = 0
    for path in _files(squares_dir):
        squares = np.load(path)["squares"]
        for image in squares.transpose(0, 3, 1, 2).astype(np.float32):
            for name, values in zip(maps, session.run(list(maps), {"image": image[None]}), strict=True):
                maps[name][row] = values[0]
            row += 1


def _files(squares: Path) -> list[Path]:
    return sorted(squares.glob("*.npz"))

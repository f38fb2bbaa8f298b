"""Good files with some of their bytes changed, by a seed: whatever a parser believes of them."""

from __future__ import annotations

import random
import struct
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import cv2

from tests.hostile.case import Case
from tests.hostile.good import DETECT, EVALUATE, READERS, picture

_EXTREMES = [struct.pack(f, v) for f, v in (
    ("<I", 0), ("<I", 2**32 - 1), (">I", 2**31 - 1), ("<Q", 2**63 - 1), ("<H", 65535), ("<f", float("nan")),
    ("<d", 1e300), ("<b", -1), (">H", 0x7FFF), ("<i", -2), ("<I", 1 << 20), ("<f", 1e30),
)]  # fmt: skip
# Kind: how its file is made of the good folder or which it is, and what is asked with it.
PICTURES = (".png", ".jpg", ".webp", ".tiff", ".bmp", ".ppm")
COMMANDS = {
    "image": [("pictures/a.png", f"{DETECT} --out out.json")],
    "bag": [
        ("x.bag", "record import out --bag x.bag"),
        ("mcap/x.mcap", "record import out --bag mcap"),
        ("sqlite3/x.db3", "record import out --bag sqlite3"),
        ("mcap/metadata.yaml", "inspect mcap"),
        ("x.bag", "inspect x.bag"),
    ],
    "c3d": [("mocap.c3d", "inspect mocap.c3d")],
    "video": [("clip.avi", READERS["video"][0]), ("clip.avi", "inspect clip.avi")],
    "json": [
        ("annotations.json", "inspect annotations.json"),
        ("results.json", f"{EVALUATE} --group body"),
        ("alphapose.json", "inspect alphapose.json"),
        ("open3d/intrinsic.json", "record import out --open3d open3d"),
        ("rec/camera.json", "record check rec"),
    ],
    "text": [
        ("mocap.tsv", "inspect mocap.tsv"),
        ("rec/rgb.txt", "record check rec"),
        ("rec/groundtruth.txt", "record check rec"),
        ("poses.txt", "inspect poses.txt"),
    ],
    "network": [
        ("model.onnx", "inspect model.onnx"),
        ("model.onnx", "models show --detector mmpose --model model.onnx"),
    ],
}  # fmt: skip


def mutate(content: bytes, chance: random.Random) -> bytes:
    """A file's content with one to eight changes, most of them near its beginning."""
    changed = bytearray(content)
    for _ in range(chance.choice((1, 1, 2, 4, 8))):
        end = len(changed) if chance.random() < 0.5 else min(len(changed), 600)
        at = chance.randrange(max(end, 1))
        match chance.randrange(6):
            case 0:
                changed[at : at + 1] = bytes([chance.randrange(256)])
            case 1 | 2:
                extreme = chance.choice(_EXTREMES)
                changed[at : at + len(extreme)] = extreme
            case 3:
                del changed[at : at + chance.choice((1, 4, 100, len(changed)))]
            case 4:
                changed[at:at] = changed[at : at + chance.choice((1, 16, 1000))]
            case 5:
                changed[at : at + chance.choice((2, 30))] = chance.randbytes(chance.choice((2, 30)))
    return bytes(changed)


def _change(kind: str, target: str, seed: str, folder: Path) -> None:
    chance, path = random.Random(seed), folder / target
    content = path.read_bytes()
    if kind == "image":
        content = cv2.imencode(chance.choice(PICTURES), picture(1))[1].tobytes()
    path.write_bytes(mutate(content, chance))


def cases(n: int, seed: int = 0, kinds: tuple[str, ...] = tuple(COMMANDS)) -> Iterator[Case]:
    """`n` of each kind."""
    for kind in kinds:
        for k in range(n):
            target, command = COMMANDS[kind][k % len(COMMANDS[kind])]
            make = partial(_change, kind, target, f"{seed} {kind} {k}")
            yield Case(f"mutated {kind}: {target} {seed}.{k}", command, make, exits=(0, 2), notes=True)

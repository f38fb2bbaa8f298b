"""Videos: cut off, of sizes they do not have, and texts that lead elsewhere."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from tests.hostile.case import Case
from tests.hostile.good import READERS
from tests.hostile.images import jpeg_of_size

PLAYLIST = b"#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nhttp://127.0.0.1:9/a.ts\n#EXT-X-ENDLIST\n"


def _of_size(width: int, height: int, content: bytes) -> bytes:
    """The header of its pictures says another size."""
    at = content.index(b"strf") + 12
    return content[:at] + struct.pack("<ii", width, height) + content[at + 8 :]


def _of_frames(n: int, content: bytes) -> bytes:
    at = content.index(b"avih") + 24
    return content[:at] + struct.pack("<I", n) + content[at + 4 :]


def _with_picture(picture: bytes, content: bytes) -> bytes:
    """The first picture is another, as far as there is room."""
    at = content.index(b"00dc") + 8
    size = struct.unpack("<I", content[at - 4 : at])[0]
    return content[:at] + picture[:size].ljust(size, b"\0") + content[at + size :]


CHANGES: dict[str, Callable[[bytes], bytes]] = {
    "half of it": lambda content: content[: len(content) // 2],
    "its header": lambda content: content[:300],
    "30000 x 30000": partial(_of_size, 30_000, 30_000),
    "2^31 - 1 pixels a side": partial(_of_size, 2**31 - 1, 2**31 - 1),
    "of negative size": partial(_of_size, -64, -48),
    "2^32 - 1 frames": partial(_of_frames, 2**32 - 1),
    "a picture of 65500 x 65500": lambda content: _with_picture(jpeg_of_size(65_500, 65_500), content),
    "pictures of noise": lambda content: content.replace(b"\xff\xd8", b"\x00\xff"),
    "a list of addresses": lambda content: PLAYLIST,
    "a list of files": lambda content: b"ffconcat version 1.0\nfile /etc/passwd\n",
}  # fmt: skip


def _change(change: Callable[[bytes], bytes], folder: Path) -> None:
    path = folder / "clip.avi"
    path.write_bytes(change(path.read_bytes()))


def cases() -> Iterator[Case]:
    for kind, change in CHANGES.items():
        for reader in ("video", "inspect video"):
            make = partial(_change, change)
            yield Case(f"{reader}: {kind}", READERS[reader][0], make, exits=(0, 2), notes=True)

"""Pictures: bombs, cut off, of a size they do not have, and of kinds nobody expects."""

from __future__ import annotations

import io
import shutil
import struct
import zlib
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from tests.hostile.case import Case
from tests.hostile.good import READERS, picture
from tests.hostile.special_files import expected, prepare


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def png(width: int, height: int, *chunks: bytes, rows: int | None = None, kind: int = 0) -> bytes:
    """A PNG of 8-bit grey (or another colour type) whose pixels are 0, of which `rows` are really there."""
    per_pixel = {0: 1, 2: 3, 6: 4}[kind]
    row, packer, packed = bytes(1 + per_pixel * width), zlib.compressobj(9), b""
    for _ in range(height if rows is None else rows):
        packed += packer.compress(row)
    packed += packer.flush()
    header = struct.pack(">IIBBBBB", width, height, 8, kind, 0, 0, 0)
    parts = (_chunk(b"IHDR", header), *chunks, _chunk(b"IDAT", packed), _chunk(b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def coded(suffix: str) -> bytes:
    """A good picture in another format."""
    return cv2.imencode(suffix, picture(1))[1].tobytes()


def by_pillow(form: str, **options) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(picture(1)).save(stream, form, **options)
    return stream.getvalue()


def jpeg_of_size(width: int, height: int) -> bytes:
    """A JPEG whose header tells another size than its pixels have."""
    content = bytearray(coded(".jpg"))
    at = content.index(b"\xff\xc0") + 5
    content[at : at + 4] = struct.pack(">HH", height, width)
    return bytes(content)


def tiff_of_size(width: int, height: int) -> bytes:
    """A TIFF of one strip that is not there."""
    entries = [(256, 4, width), (257, 4, height), (258, 3, 8), (259, 3, 1), (262, 3, 1), (273, 4, 8),
               (277, 3, 1), (278, 4, height), (279, 4, 100)]  # fmt: skip
    rows = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in entries)
    return b"II*\0" + struct.pack("<IH", 8, len(entries)) + rows + bytes(4)


def bmp_of_size(width: int, height: int) -> bytes:
    header = struct.pack("<IiiHHIIiiII", 40, width, height, 1, 24, 0, 0, 0, 0, 0, 0)
    return b"BM" + struct.pack("<IHHI", 154, 0, 0, 54) + header + bytes(100)


BOMBS = {
    "PNG 30000 x 30000": partial(png, 30_000, 30_000),
    "PNG 40000 x 40000, one row": partial(png, 40_000, 40_000, rows=1),
    "PNG of 2^31 - 1 pixels a side": partial(png, 2**31 - 1, 2**31 - 1, rows=0),
    "PNG 20000 x 20000 in colour, 10 rows": partial(png, 20_000, 20_000, rows=10, kind=2),
    "JPEG 65500 x 65500": partial(jpeg_of_size, 65_500, 65_500),
    "TIFF 40000 x 40000": partial(tiff_of_size, 40_000, 40_000),
    "BMP 30000 x 30000": partial(bmp_of_size, 30_000, 30_000),
    "BMP -2^31 high": partial(bmp_of_size, 10, -(2**31)),
    "PGM 99999 x 99999": lambda: b"P5 99999 99999 255\n" + bytes(100),
    "PFM 1e9 x 1e9": lambda: b"PF\n1000000000 1000000000\n-1.0\n" + bytes(100),
    "HDR 100000 x 100000": lambda: b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 100000 +X 100000\n" + bytes(64),
    "GIF 65535 x 65535": lambda: b"GIF89a" + struct.pack("<HHBBB", 65535, 65535, 0, 0, 0) + b",\0\0\0\0"
    + struct.pack("<HHB", 65535, 65535, 0) + b"\x08\x01\0\0;",
}  # fmt: skip
DAMAGED = {
    "PNG cut off": lambda: coded(".png")[:2000],
    "JPEG cut off in its header": lambda: coded(".jpg")[:100],
    "PNG without pixels": lambda: png(8, 8, rows=0),
    "PNG 0 x 0": lambda: png(0, 0, rows=0),
    "PNG of a wrong checksum": lambda: coded(".png")[:40] + b"\0" + coded(".png")[41:],
    "SVG": lambda: b"<svg xmlns='http://www.w3.org/2000/svg' onload='x()'/>",
    "HTML": lambda: b"<script>alert(1)</script>",
    "an answer of a version control": lambda: b"version https://git-lfs.github.com/spec/v1\noid sha256:00\n",
}  # fmt: skip
ODD = {
    "PNG with 200 MB of text": lambda: png(
        32, 32, _chunk(b"zTXt", b"k\0\0" + zlib.compress(bytes(200_000_000), 9)), kind=2
    ),
    "PNG with a false colour profile": lambda: png(
        32, 32, _chunk(b"iCCP", b"x\0\0" + zlib.compress(b"no")), kind=2
    ),
    "PNG with EXIF of noise": lambda: png(32, 32, _chunk(b"eXIf", bytes(range(200))), kind=2),
    "PNG 1 x 1": lambda: png(1, 1, kind=2),
    "PNG 60000 x 1": lambda: png(60_000, 1, kind=2),
    "PNG of 16 bits": lambda: cv2.imencode(".png", picture(1).astype(np.uint16) * 256)[1].tobytes(),
    "PNG transparent": lambda: png(32, 32, kind=6),
    "JPEG in CMYK": lambda: by_pillow_cmyk(),
    "JPEG cut off in its pixels": lambda: coded(".jpg")[: len(coded(".jpg")) // 2],
    "JPEG with EXIF of noise": lambda: by_pillow("JPEG", exif=b"Exif\0\0" + bytes(range(200))),
    "GIF": lambda: by_pillow("GIF"),
    "WebP": lambda: coded(".webp"),
    "TIFF": lambda: coded(".tiff"),
}


def by_pillow_cmyk() -> bytes:
    stream = io.BytesIO()
    Image.fromarray(picture(1)).convert("CMYK").save(stream, "JPEG")
    return stream.getvalue()


def _put(target: str, make, folder: Path) -> None:
    prepare(folder)
    (folder / target).write_bytes(make())


def _alone(make, folder: Path) -> None:
    shutil.rmtree(folder / "pictures")
    (folder / "pictures").mkdir()
    (folder / "pictures" / "a.png").write_bytes(make())


def cases() -> Iterator[Case]:
    for kinds, where in (
        (BOMBS, ("pictures", "create picture", "draw picture", "import open3d picture", "lift depth")),
        (DAMAGED, ("pictures", "create picture", "draw picture", "lift depth")),
    ):
        for reader in where:
            command, target = READERS[reader]
            for kind, content in kinds.items():
                yield Case(
                    f"image: {reader}: {kind}", command, partial(_put, target, content), **expected(reader)
                )
    command, _ = READERS["pictures"]
    for kind, content in (BOMBS | DAMAGED).items():
        yield Case(f"image: none else: {kind}", command, partial(_alone, content), notes=True)
        yield Case(f"image: inspect: {kind}", "inspect pictures/a.png", partial(_alone, content))
    for kind, content in ODD.items():
        yield Case(f"image: odd: {kind}", command, partial(_alone, content), exits=(0, 2), notes=True)

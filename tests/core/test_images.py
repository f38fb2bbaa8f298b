"""Pictures as they are stored, and their rotation flags."""

import io
import resource
import struct
import time
import zlib

import cv2
import numpy as np
import pytest
from PIL import Image

from hicp_lib.core import images
from hicp_lib.core.errors import InputError
from hicp_lib.core.images import as_seen, decode_image, image_header, note_rotation, read_image, rotation_note

# Where a viewer shows what is stored at the top left and at the top right, by flag.
CORNERS = {
    1: ("top left", "top right"), 2: ("top right", "top left"), 3: ("bottom right", "bottom left"),
    4: ("bottom left", "bottom right"), 5: ("top left", "bottom left"), 6: ("top right", "bottom right"),
    7: ("bottom right", "top right"), 8: ("bottom left", "top left"),
}  # fmt: skip
PLACES = {"top": 0, "bottom": -1, "left": 0, "right": -1}


def write_flagged(path, flag: int, kind: str = "JPEG") -> None:
    """Grey, 60 x 40 as stored, the top left red, the top right blue."""
    pixels = np.full((40, 60, 3), 127, np.uint8)
    pixels[:20, :20], pixels[:20, 40:] = [255, 0, 0], [0, 0, 255]
    exif = Image.Exif()
    exif[0x0112] = flag
    options = {"quality": 95} if kind == "JPEG" else {"lossless": True} if kind == "WEBP" else {}
    Image.fromarray(pixels).save(path, kind, exif=exif, **options)


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "WEBP"])
@pytest.mark.parametrize("flag", range(1, 9))
def test_pictures_are_read_as_stored_and_turned_as_viewers_do(tmp_path, flag, kind):
    path = tmp_path / "picture"
    write_flagged(path, flag, kind)
    assert image_header(path) == (60, 40, flag)
    stored = read_image(path)
    assert stored.shape == (40, 60, 3) and stored[0, 0, 0] > 200 and stored[0, -1, 2] > 200
    seen = as_seen(stored, flag)
    assert seen.shape == ((60, 40, 3) if flag > 4 else (40, 60, 3))
    for channel, corner in ((0, CORNERS[flag][0]), (2, CORNERS[flag][1])):
        row, column = (PLACES[word] for word in corner.split())
        other = seen[row, column, 2 - channel]
        assert seen[row, column, channel] > 200 and other < 60


@pytest.mark.parametrize("flag", [3, 6])
def test_tiff_is_turned_as_it_is_read(tmp_path, flag):
    path = tmp_path / "picture.tif"
    write_flagged(path, flag, "TIFF")
    assert image_header(path)[2] == 1
    row, column = (PLACES[word] for word in CORNERS[flag][0].split())
    assert read_image(path)[row, column].tolist() == [255, 0, 0]


def test_the_note_names_who_has_a_flag(tmp_path):
    write_flagged(tmp_path / "a.jpg", 1)
    write_flagged(tmp_path / "b.jpg", 6)
    write_flagged(tmp_path / "c.jpg", 0)  # no flag that EXIF knows
    write_flagged(tmp_path / "d.webp", 8, "WEBP")
    write_flagged(tmp_path / "e.png", 3, "PNG")
    (tmp_path / "f.jpg").write_bytes(b"no image, Exif or not")
    flagged = {}
    for path in sorted(tmp_path.iterdir()):
        note_rotation(path.read_bytes(), path.name, flagged)
    assert flagged == {"b.jpg": 6, "d.webp": 8, "e.png": 3}
    assert rotation_note(flagged).startswith("3 images have a rotation flag (EXIF; b.jpg: 6")
    assert rotation_note({}) == ""


def png(width: int, height: int) -> bytes:
    """A black picture, as small as it gets."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        return (
            struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        )

    packed, row = zlib.compressobj(1), bytes(1 + 3 * width)
    rows = b"".join(packed.compress(row) for _ in range(height)) + packed.flush()
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


def bomb(kind: str) -> bytes:
    """A picture of more pixels than are decoded, in a small file."""
    if kind == "PNG":
        return png(40_000, 2_600)
    content = io.BytesIO()
    size = (20, 10) if kind == "WEBP" else (40_000, 2_600)
    Image.new("L" if kind in ("GIF", "TIFF") else "RGB", size).save(
        content, kind, **({"compression": "tiff_adobe_deflate"} if kind == "TIFF" else {})
    )
    coded = bytearray(content.getvalue())
    if kind == "WEBP":
        coded[26:30] = struct.pack("<HH", 16_000, 7_000)
    return bytes(coded)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", ["PNG", "JPEG", "WEBP", "TIFF", "GIF"])
def test_too_many_pixels_are_refused_before_they_are_decoded(tmp_path, kind):
    path = tmp_path / "bomb"
    path.write_bytes(bomb(kind))
    assert path.stat().st_size < 4e6
    before, begin = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    with pytest.raises(InputError, match=r"bomb: \d+ x \d+ pixels are more than 100 million.*HICP_LIMITS=2 "):
        read_image(path)
    assert time.process_time() - begin < 1
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000  # kB


def test_the_limit_can_be_raised(monkeypatch):
    monkeypatch.setattr(images, "MAX_PIXELS", 100.0)
    with pytest.raises(InputError, match="a: 20 x 10 pixels are more than 0.0001 million"):
        decode_image(png(20, 10), "a")
    monkeypatch.setenv("HICP_LIMITS", "2")
    assert decode_image(png(20, 10), "a").shape == (10, 20, 3)
    for nonsense in ("nan", "-1", "much"):
        monkeypatch.setenv("HICP_LIMITS", nonsense)
        with pytest.raises(InputError, match="^HICP_LIMITS is "):
            decode_image(png(20, 10), "a")


def test_a_jpeg_that_is_drawn_over_and_over_is_refused():
    content = io.BytesIO()
    Image.new("RGB", (1000, 1000)).save(content, "JPEG", progressive=True)
    coded = content.getvalue()
    assert decode_image(coded, "a").shape == (1000, 1000, 3)
    scan = coded[coded.rindex(b"\xff\xda") : -2]
    with pytest.raises(InputError, match="a: 1000 x 134000 pixels are more than"):
        decode_image(coded[:-2] + 2000 * scan + coded[-2:], "a")


@pytest.mark.filterwarnings("ignore::UserWarning:PIL")
@pytest.mark.parametrize("kind", ["PNG", "JPEG", "WEBP", "TIFF", "GIF", "BMP", "PPM", "JPEG2000"])
def test_what_is_damaged_is_decoded_or_one_line(kind):
    """OpenCV raises errors of its own for some bitmaps."""
    content, random = io.BytesIO(), np.random.default_rng(5)
    pixels = random.integers(0, 255, (24, 32, 3)).astype(np.uint8)
    Image.fromarray(pixels).save(content, kind)
    whole = np.frombuffer(content.getvalue(), np.uint8)
    assert decode_image(whole, "whole").shape == (24, 32, 3)
    n_refused = 0
    for _ in range(60):
        damaged = whole[: random.integers(len(whole))] if random.random() < 0.3 else whole.copy()
        if damaged.size == whole.size:
            damaged[random.integers(0, min(64, len(whole)), 3)] = random.integers(0, 256, 3)
        try:
            assert decode_image(damaged, "damaged").ndim == 3
        except InputError as error:
            assert str(error).startswith("damaged: ") and "\n" not in str(error)
            n_refused += 1
    assert n_refused > 10


def test_errors_of_opencv_are_one_line(monkeypatch):
    def fails(*_: object) -> None:
        raise cv2.error("Overflow for imageSize")

    monkeypatch.setattr(cv2, "imdecode", fails)
    with pytest.raises(InputError, match="^a: is not an image"):
        decode_image(png(2, 2), "a")

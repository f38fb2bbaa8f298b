"""Reading and writing images: RGB, 8 bit, as arrays.

A camera may store a picture rotated, with a flag that tells viewers how to rotate it back (EXIF's
orientation, 1 to 8). Pixels are always read as stored, and keypoints are in that frame. Code that reads
external images checks the flag and reports it (`rotation_note`), or rotates the image (`as_seen`). Only TIFF
is rotated on reading, by OpenCV and by every viewer, and counts as having no flag.
"""

from collections.abc import Mapping
from contextlib import suppress
from io import BytesIO
from pathlib import Path

import cv2
import numpy as np
from PIL import ExifTags, Image

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_bytes, regular_file, write_bytes
from hicp_lib.core.limited import LIMITS_VARIABLE, raised

MAX_PIXELS = 100e6
"""Of an image; more would take a gigabyte before any processing."""
_MAX_SCANS = 15
_FORMATS = ("PNG", "JPEG", "WEBP", "TIFF", "BMP", "GIF", "JPEG2000", "PPM")  # as Pillow calls them
Box = tuple[int, int, int, int]  # left, top, right, bottom; right and bottom exclusive


def read_image(path: str | Path) -> np.ndarray:
    """Read an image as it is stored: a rotation flag is not applied.

    Parameters
    ----------
    path : str or Path
        A file that OpenCV can decode.

    Returns
    -------
    array, shape (height, width, 3), dtype uint8
        RGB.

    Raises
    ------
    InputError
        If the file is missing, not an image OpenCV can decode or has too many pixels.
    """
    return decode_image(read_bytes(path, "expected an image file"), path)


def decode_image(content: bytes | np.ndarray, path: str | Path) -> np.ndarray:
    """Decode an image from a file's content, as `read_image` does; `path` is for the error message."""
    return decode(content, path, cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION)


def decode(content: bytes | np.ndarray, path: str | Path, flags: int) -> np.ndarray:
    """Decode pixels from a file's content, after checking its header for their number.

    Parameters
    ----------
    content : bytes or array, dtype uint8
    path : str or Path
        For messages.
    flags : int
        OpenCV's.

    Returns
    -------
    array
        As the flags say.

    Raises
    ------
    InputError
        If it cannot be decoded, or has more than `MAX_PIXELS`.
    """
    content = bytes(content)
    width_px, height_px, _ = image_header(BytesIO(content))
    # Each scan of a progressive JPEG costs as much as one decoding; normal files have about ten.
    refuse_too_large(path, width_px, height_px * max(1, content.count(b"\xff\xda") // _MAX_SCANS))
    pixels = None
    with suppress(cv2.error):
        pixels = cv2.imdecode(np.frombuffer(content, np.uint8), flags) if width_px else None
    if pixels is None:
        raise InputError(f"{path}: is not an image (PNG, JPEG, ...) or is cut off; replace the file")
    return pixels


def refuse_too_large(path: str | Path, width_px: int, height_px: int) -> None:
    """Raise an error for an image or video frame with too many pixels.

    Parameters
    ----------
    path : str or Path
        For the message.
    width_px, height_px : int

    Raises
    ------
    InputError
        With the variable of the environment that raises the limit.

    Examples
    --------
    >>> refuse_too_large("a.png", 30_000, 30_000)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    hicp_lib.core.errors.InputError: a.png: 30000 x 30000 pixels are more than 100 million; make ...
    """
    most = raised(MAX_PIXELS)
    if width_px * height_px > most:
        times = -(-width_px * height_px // MAX_PIXELS)
        raise InputError(
            f"{path}: {width_px} x {height_px} pixels are more than {most / 1e6:g} million; make it smaller, "
            f"or set {LIMITS_VARIABLE}={times:.0f} in the environment"
        )


def image_header(path: str | Path | BytesIO) -> tuple[int, int, int]:
    """Width and height of an image as stored, and its rotation flag; its pixels are not decoded.

    Returns
    -------
    width_px, height_px : int
        0 where the file is no image that can be read.
    flag : int
        2 to 8 for pictures that viewers rotate (see `as_seen`), 1 for all others.
    """
    try:
        with path if isinstance(path, BytesIO) else open(regular_file(path, ""), "rb") as file:
            Image.init()
            start, readers = file.read(16), (Image.OPEN[kind] for kind in _FORMATS)
            file.seek(0)
            # Pillow's own `open` would print a warning about large images.
            image = next(read for read, accepts in readers if accepts and accepts(start))(file, "")
            exif = Image.Exif()
            # A TIFF has no flag there, as intended; `getexif` would decode a whole PNG.
            exif.load(image.info.get("exif", b""))
            flag = int(exif.get(ExifTags.Base.Orientation, 1))
            return *image.size, flag if flag in range(2, 9) else 1
    except Exception:  # Pillow raises many kinds; reading the pixels will report what is wrong
        return 0, 0, 1


def as_seen(pixels: np.ndarray, flag: int) -> np.ndarray:
    """Pixels as viewers show them.

    Parameters
    ----------
    pixels : array, shape (height, width, ...)
        As stored.
    flag : int
        EXIF's orientation, 1 to 8.

    Returns
    -------
    array
        Height and width are swapped for flags above 4.

    Examples
    --------
    >>> as_seen(np.array([[1, 2, 3], [4, 5, 6]]), 6).tolist()
    [[4, 1], [5, 2], [6, 3]]
    """
    turned = pixels.swapaxes(0, 1) if flag > 4 else pixels
    rows, columns = (slice(None, None, -1 if flag in flags else 1) for flags in ((3, 4, 7, 8), (2, 3, 6, 7)))
    return np.ascontiguousarray(turned[rows, columns])


def note_rotation(content: bytes, name: str, flagged: dict[str, int]) -> None:
    """Add an image to those with a rotation flag, if it has one.

    Parameters
    ----------
    content : bytes
        Of the file.
    name : str
    flagged : dict of str to int
        Flags by name.
    """
    if (flag := image_header(BytesIO(content))[2]) != 1:
        flagged[name] = flag


def rotation_note(flagged: Mapping[str, int]) -> str:
    """One line that names images with a rotation flag; empty if there are none."""
    about = "they are taken as stored in the file, not as viewers show them, and keypoints are in that frame"
    first = [f"{Path(name).name}: {flag}" for name, flag in flagged.items()][:1]
    return f"{len(flagged)} images have a rotation flag (EXIF; {first[0]}, ...): {about}" if first else ""


def write_png(path: str | Path, image: np.ndarray) -> None:
    """Write an image losslessly: RGB uint8 (height, width, 3), or one channel uint8/uint16."""
    pixels = cv2.cvtColor(image, cv2.COLOR_RGB2BGR) if image.ndim == 3 else image
    # Level 1: a third larger than the default, four times as fast. One filter for all rows instead of the
    # best for each: as small, and in half the time, for reading too.
    options = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP]
    _, encoded = cv2.imencode(".png", pixels, options)
    write_bytes(path, encoded.tobytes())


def is_whole_png(path: str | Path) -> bool:
    """Whether a file is a PNG whose checksums are right, up to its end."""
    with suppress(Exception), Image.open(path, formats=["PNG"]) as image:  # Pillow raises many kinds
        image.verify()
        return True
    return False


def inside(pixels_px: np.ndarray, box_px: Box) -> np.ndarray:
    """Whether positions lie on the pixels of a box; pixel i is [i - 0.5, i + 0.5).

    Parameters
    ----------
    pixels_px : array, shape (..., 2)
        (u, v); NaN is outside.
    box_px : tuple of int
        Left, top, right, bottom; right and bottom exclusive.

    Returns
    -------
    array of bool, shape (...)

    Examples
    --------
    >>> inside(np.array([[0, 0], [2.4, 1], [2.5, 1], [np.nan, 0]]), (0, 0, 3, 2))
    array([ True,  True, False, False])
    """
    left, top, right, bottom = box_px
    u, v = np.moveaxis(np.asarray(pixels_px, float), -1, 0)
    return (u >= left - 0.5) & (u < right - 0.5) & (v >= top - 0.5) & (v < bottom - 0.5)

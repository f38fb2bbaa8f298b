"""Files: the cache folder, hashes, atomic writes, checked reading of JSON."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import secrets
import shutil
import stat
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import orjson
import platformdirs

from hicp_lib.core.errors import InputError
from hicp_lib.core.limited import RAISE, raised

if TYPE_CHECKING:
    from pandas import DataFrame

MAX_BYTES = 2e9  # of a file that is read whole
_PARTIAL = ".partial-"
_OLD_S = 3600.0  # without locks: what nobody wrote to for so long was left behind


def cache_dir() -> Path:
    """Folder of downloads, renders and detections: ``$HICP_CACHE``, or the user's cache folder."""
    return Path(os.environ.get("HICP_CACHE") or platformdirs.user_cache_dir("hicp"))


@contextmanager
def atomic_path(path: str | Path, sync: bool = True) -> Iterator[Path]:
    """Yield a temporary name beside `path`; rename it to `path` when the block succeeds.

    A reader sees the old file, the new one, or none: never a half-written one. The
    temporary file keeps the suffix, since image writers choose the format by it.

    Parameters
    ----------
    path : str or Path
        Nothing, or a regular file that may be written. For a link, its target is replaced and the link kept.
    sync : bool, optional
        False if the content is checked when it is read: a power cut may leave it empty.

    Yields
    ------
    Path

    Raises
    ------
    InputError
        If `path` is a folder, a device, a link to nothing or the like, or a file that is write-protected.
    """
    named, path = path, Path(os.path.realpath(path))
    if os.path.lexists(named):
        mode = os.stat(path).st_mode if path.exists() else stat.S_IFLNK
        if not stat.S_ISREG(mode):
            raise InputError(f"{named}: is {_kind(mode)}; give the name of a file to write")
        if not (mode & stat.S_IWUSR and os.access(path, os.W_OK)):
            raise InputError(f"{named}: is write-protected; give another name, or make it writable")
    temporary = partial_name(path.parent, path.suffix)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))  # minus the caller's umask
        with held(temporary):
            yield temporary
            if sync:
                with open(temporary, "rb+") as file:
                    os.fsync(file.fileno())
            os.replace(temporary, path)
    except OSError as error:
        if str(error.filename) in ("None", str(temporary)):  # report the name that was given
            error.filename = str(named)
        raise
    finally:
        with suppress(OSError):
            temporary.unlink()


def partial_name(folder: Path, suffix: str = "") -> Path:
    """A new name in a folder for what is not finished."""
    return folder / f"{_PARTIAL}{secrets.token_hex(8)}{suffix}"


@contextmanager
def held(path: Path, waits: bool = False) -> Iterator[bool | None]:
    """Lock a file or folder against other processes for a block; what nobody holds is not being written.

    Parameters
    ----------
    path : Path
    waits : bool, optional
        Whether to wait for another's lock to end.

    Yields
    ------
    bool or None
        False if another has it; None if the system, or the file system, has no such locks.
    """
    is_locked: bool | None = None
    with ExitStack() as stack:
        with suppress(ImportError, OSError):
            import fcntl

            stack.callback(os.close, descriptor := os.open(path, os.O_RDONLY | os.O_NONBLOCK))
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if waits else fcntl.LOCK_NB))
                is_locked = True
            except BlockingIOError:
                is_locked = False
        yield is_locked


def remove_left(folder: Path, below: bool = False) -> None:
    """Remove what killed processes left half-written in a folder.

    Parameters
    ----------
    folder : Path
    below : bool, optional
        Whether in folders below it, too.
    """
    for left in (folder.rglob if below else folder.glob)(f"{_PARTIAL}{'[0-9a-f]' * 16}*"):
        with suppress(OSError), held(left) as is_ours:
            is_old = left.is_file() and time.time() - left.stat().st_mtime > _OLD_S
            if is_ours or (is_ours is None and is_old):
                shutil.rmtree(left) if left.is_dir() else left.unlink()


def write_bytes(path: str | Path, content: bytes, sync: bool = True) -> None:
    """Write a file, whole or not at all.

    Parameters
    ----------
    path : str or Path
    content : bytes
    sync : bool, optional
        As of `atomic_path`.
    """
    with atomic_path(path, sync) as temporary:
        temporary.write_bytes(content)


def write_checked(path: str | Path, payload: bytes) -> None:
    """Write `payload` after its SHA-256, for `read_checked` to verify; whole or not at all."""
    write_bytes(path, hashlib.sha256(payload).digest() + payload, sync=False)


def read_checked(path: str | Path) -> bytes | None:
    """What `write_checked` wrote; None if there is none or it is damaged.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_checked(Path(folder, "a"), b"kept")
    ...     read_checked(Path(folder, "a")), read_checked(Path(folder, "b"))
    (b'kept', None)
    """
    try:
        content = read_bytes(path, "")
    except InputError:
        return None
    stated, payload = content[:32], content[32:]
    return payload if hashlib.sha256(payload).digest() == stated else None


def regular_file(path: str | Path, expected: str, max_bytes: float = math.inf) -> Path:
    """The path, if it is a regular file: reading anything else may never start or never end.

    Parameters
    ----------
    path : str or Path
    expected : str
        What the file should have been, or what to do, for the message.
    max_bytes : float, optional
        The largest size.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If it is not there, not a regular file, or larger.
    """
    try:
        state = os.stat(path)
    except (OSError, ValueError) as error:  # ValueError: an invalid file name
        why = getattr(error, "strerror", "no file has such a name")
        raise InputError(f"{path}: cannot be read ({why}); {expected}") from None
    if not stat.S_ISREG(state.st_mode):
        raise InputError(f"{path}: is {_kind(state.st_mode)}; {expected}")
    if state.st_size > max_bytes:
        sizes = f"has {state.st_size / 1e9:.3g} GB, more than {max_bytes / 1e9:.3g}"
        raise InputError(f"{path}: {sizes}; {RAISE}")
    return Path(path)


def _kind(mode: int) -> str:
    kinds = {"d": "a folder", "p": "a named pipe", "s": "a socket", "l": "a link to nothing"}
    return kinds.get(stat.filemode(mode)[0], "a device")


def read_bytes(path: str | Path, expected: str) -> bytes:
    """The content of a file; used for everything that is read whole.

    Parameters
    ----------
    path : str or Path
    expected : str
        What the file should have been, or what to do, for the message.

    Returns
    -------
    bytes

    Raises
    ------
    InputError
        If it cannot be read, is no regular file, or has more than `MAX_BYTES`.
    """
    try:
        with open(regular_file(path, expected, raised(MAX_BYTES)), "rb") as file:
            return file.read()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); {expected}") from None


def write_json(path: str | Path, value: Any, *, indent: int | None = None) -> None:
    """Write strict JSON, whole or not at all.

    Parameters
    ----------
    path : str or Path
        The file to write.
    value : any
        Without NaN and infinity, which are refused.
    indent : int, optional
        Spaces per level; all in one line when left out.

    Raises
    ------
    ValueError
        For NaN and infinity.
    """
    text = json.dumps(value, indent=indent, allow_nan=False)
    write_bytes(path, (text + "\n").encode())


def write_table(path: str | Path, table: DataFrame) -> None:
    """Write a table as Parquet, or as CSV where the name ends in `.csv`; whole or not at all."""
    with atomic_path(path) as temporary:
        write = table.to_csv if temporary.suffix == ".csv" else table.to_parquet
        write(temporary, index=False)


def natural_order(name: str) -> tuple[str, str]:
    """Sort key of names that orders the numbers in them (up to 20 digits) by value.

    Examples
    --------
    >>> sorted(["b10.png", "b9.png", "a.png"], key=natural_order)
    ['a.png', 'b9.png', 'b10.png']
    """
    return re.sub("[0-9]+", lambda number: number[0].zfill(20), name), name


def json_or_text(text: str) -> Any:
    """The value of a text as JSON (true, 1, 0.5, [1, 2]), or else the text itself.

    Examples
    --------
    >>> json_or_text("0.5"), json_or_text("gt")
    (0.5, 'gt')
    """
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return text


def read_json(path: str | Path) -> Any:
    """Read JSON from outside.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    Any
        NaN and infinity, which JSON lacks, are read as Python writes them; integers beyond 64 bits become
        floats.

    Raises
    ------
    InputError
        If the file is missing, unreadable or not JSON; the line and column are named.
    """
    content = read_bytes(path, "give the path of a JSON file")
    with suppress(orjson.JSONDecodeError):  # json accepts more, with better messages
        return orjson.loads(content)
    try:
        return json.loads(content)
    except UnicodeDecodeError:
        raise InputError(f"{path}: is not text in UTF-8; expected a JSON file") from None
    except json.JSONDecodeError as error:
        raise InputError(
            f"{path}: line {error.lineno}, column {error.colno}: not JSON ({error.msg}); "
            "the file may be cut off, write it again"
        ) from None
    except (RecursionError, ValueError):
        raise InputError(f"{path}: nested too deeply, or numbers too long, for an annotation file") from None


def sha256_bytes(content: bytes) -> str:
    """SHA-256 of `content` in hexadecimal.

    Examples
    --------
    >>> sha256_bytes(b"")[:8]
    'e3b0c442'
    """
    return hashlib.sha256(content).hexdigest()


def sha256_file(path: str | Path) -> str:
    """SHA-256 of a regular file's content in hexadecimal."""
    with open(regular_file(path, "give a file"), "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()

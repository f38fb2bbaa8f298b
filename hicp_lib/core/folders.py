"""Folders: listing them, and locking those that a command fills."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import cache_dir, natural_order, read_json
from hicp_lib.core.names import is_inside

_OLD_S = 3600.0  # a temporary file not written to for this long is a leftover


def listed(folder: str | Path, suffixes: str | tuple[str, ...] = "", what: str = "a folder") -> list[str]:
    """Names in a folder in natural order (numbers by value), without hidden ones.

    Parameters
    ----------
    folder : str or Path
    suffixes : str or tuple of str, optional
        In lower case; names with other endings are left out.
    what : str, optional
        Which folder to give, for the message.

    Returns
    -------
    list of str

    Raises
    ------
    InputError
        If there is no such folder, or it cannot be read.
    """
    try:
        names = os.listdir(folder)
    except OSError as error:
        raise InputError(f"{folder}: cannot be read ({error.strerror}); give {what}") from None
    return sorted((n for n in names if n[0] != "." and n.lower().endswith(suffixes)), key=natural_order)


def kept_beside(folder: Path, name: str, **kinds: type) -> dict[str, Any]:
    """A command's own record of the files it made in a folder; empty values if the folder is empty.

    Parameters
    ----------
    folder : Path
    name : str
        Of the JSON file with the record.
    **kinds : type
        Of the values.

    Returns
    -------
    dict of str to object

    Raises
    ------
    InputError
        If the folder holds something else.
    """
    kept: Any = {of: kind() for of, kind in kinds.items()}
    if (folder / name).exists():
        kept = read_json(folder / name)
    elif listed(folder):
        raise InputError(f"{folder}: holds files not made by this command; give an empty or new folder")
    if not (isinstance(kept, dict) and all(isinstance(kept.get(of), kind) for of, kind in kinds.items())):
        raise InputError(f"{folder / name}: is of another version or tool; give another folder")
    return kept


def remove_inside(folder: Path, names: Iterable[str]) -> None:
    """Remove files that a folder's list names; names that lead out of the folder are ignored."""
    for name in names:
        if is_inside(name):
            (folder / name).unlink(missing_ok=True)


@contextmanager
def locked_folder(folder: str | Path) -> Iterator[None]:
    """Let one process at a time fill a folder, which is created if missing.

    The folder itself is locked, and the system releases the lock when the process ends; on systems without
    such locks nothing is locked. Half-written files older than an hour are removed.

    Parameters
    ----------
    folder : str or Path
        For a folder in the cache, the lock is awaited: the other process makes the same files.

    Raises
    ------
    InputError
        If another process fills it, or it is a file.
    """
    folder, is_new = Path(folder), not os.path.lexists(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise InputError(f"{folder}: is a file, or lies in one; give a folder") from None
    with ExitStack() as stack:
        with suppress(ImportError):
            import fcntl

            stack.callback(os.close, descriptor := os.open(folder, os.O_RDONLY))
            waits = folder.resolve().is_relative_to(cache_dir().resolve())
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if waits else fcntl.LOCK_NB))
            except BlockingIOError:
                raise InputError(f"{folder}: another command writes there; wait for it to end") from None
            except OSError:
                pass  # the file system has no locks
        for left in folder.rglob(f".partial-{'[0-9a-f]' * 16}*"):
            with suppress(OSError):
                if time.time() - left.stat().st_mtime > _OLD_S:
                    left.unlink()
        try:
            yield
        except BaseException:
            if is_new and not os.listdir(folder):
                folder.rmdir()
            raise

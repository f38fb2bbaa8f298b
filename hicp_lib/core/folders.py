"""Folders: listing them, and locking those that a command fills."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import cache_dir, held, natural_order, partial_name, read_json, remove_left
from hicp_lib.core.names import is_inside

_MOST_ENDINGS = 8  # that are named


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


def listed_and_others(folder: str | Path, suffixes: tuple[str, ...]) -> tuple[list[str], str]:
    """As `listed`, and words on how many others there are, with which endings; empty if there are none.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     for name in ("a.png", "b.gif", "c.GIF"):
    ...         Path(folder, name).touch()
    ...     Path(folder, "sub").mkdir()
    ...     listed_and_others(folder, (".png",)), listed_and_others(folder, (".png", ".gif", "sub"))[1]
    ((['a.png'], '3 others (.gif, folders) passed over'), '')
    """
    everything = listed(folder)
    names = [name for name in everything if name.lower().endswith(suffixes)]
    others = [Path(folder, name) for name in everything if not name.lower().endswith(suffixes)]
    kinds = ["folders" if path.is_dir() else path.suffix.lower() or "no ending" for path in others]
    more = ", ..." * (len(set(kinds)) > _MOST_ENDINGS)
    shown = ", ".join([*dict.fromkeys(kinds)][:_MOST_ENDINGS])
    return names, f"{len(others)} others ({shown}{more}) passed over" if others else ""


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
    such locks nothing is locked. Half-written files that killed processes left there are removed.

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
    real, cache = (Path(os.path.realpath(of)) for of in (folder, cache_dir()))
    with held(folder, waits=real.is_relative_to(cache)) as is_ours:
        if is_ours is False:
            raise InputError(f"{folder}: another command writes there; wait for it to end")
        remove_left(folder, below=True)
        try:
            yield
        except BaseException:
            if is_new and not os.listdir(folder):
                folder.rmdir()
            raise


@contextmanager
def filled_folder(folder: str | Path) -> Iterator[Path]:
    """Fill a folder that is new or empty, all or nothing, and one process at a time.

    Parameters
    ----------
    folder : str or Path

    Yields
    ------
    Path
        A hidden folder in it: what is put there moves up when the block succeeds.

    Raises
    ------
    InputError
        As of `locked_folder` and `refuse_used_folder`.
    """
    folder = Path(folder)
    with locked_folder(folder):
        refuse_used_folder(folder)
        inner = partial_name(folder)
        inner.mkdir()
        try:
            with held(inner):
                yield inner
                for path in sorted(inner.iterdir(), key=lambda path: (path.is_file(), path.name)):
                    os.replace(path, folder / path.name)
        except InputError as error:  # told by the names that were asked for
            raise InputError(str(error).replace(str(inner), str(folder))) from None
        except OSError as error:
            error.filename = error.filename and str(error.filename).replace(str(inner), str(folder))
            raise
        finally:
            shutil.rmtree(inner, ignore_errors=True)


def refuse_used_folder(folder: Path) -> None:
    """Nothing is written over what is there.

    Parameters
    ----------
    folder : Path

    Raises
    ------
    InputError
        If `folder` is a file, or holds anything but hidden files.
    """
    if folder.exists() and (not folder.is_dir() or listed(folder)):
        raise InputError(f"{folder}: is there already; give a new or empty folder")

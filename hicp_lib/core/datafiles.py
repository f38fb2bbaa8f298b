"""Where the study's own data lie: the folder `data` at the top of a checkout, within the installed package.

They are only read. What is made or recorded goes to the working folder, the cache or the user's data folder.
"""

import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from hicp_lib.core.errors import InputError

_PACKAGE = Path(__file__).resolve().parents[1]


def data_dir(package: Path = _PACKAGE) -> Path:
    """The data of the library in the folder `package`: within it where a wheel put them, else beside it."""
    within = package / "data"
    return within if (within / "detectors.json").is_file() else package.parent / "data"


DATA_DIR = data_dir()
REFERENCE_DIR = DATA_DIR / "reference"
"""Results of runs that others are compared with: no result follows from them, and so no key."""


def read_arrays(path: Path, shapes: Mapping[str, tuple[int, ...]], what: str, tool: str) -> list[np.ndarray]:
    """Arrays of a file that a tool of this project made.

    Parameters
    ----------
    path : Path
        Of an NPZ file.
    shapes : mapping of str to tuple of int
        Shape of each array to read, by name; -1 where any length will do.
    what, tool : str
        What the file holds and what makes it, for the error's message.

    Returns
    -------
    list of array

    Raises
    ------
    InputError
        If the file is missing or not such a file.
    """
    try:
        with np.load(path, allow_pickle=False) as stored:
            return [stored[name].reshape(shape) for name, shape in shapes.items()]
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"{path}: not {what} ({error}); run {tool}") from None

"""Where the study's data are: the folder `data` at the top of a checkout, or inside the installed package.

They are only read. Files that are made or recorded go to the working folder, the cache or the user's data
folder.
"""

import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from hicp_lib.core.errors import InputError

_PACKAGE = Path(__file__).resolve().parents[1]


def data_dir(package: Path = _PACKAGE) -> Path:
    """The data of the library in the folder `package`: inside it if installed by a wheel, else beside it."""
    within = package / "data"
    return within if (within / "detectors.json").is_file() else package.parent / "data"


DATA_DIR = data_dir()
REFERENCE_DIR = DATA_DIR / "reference"
"""Reference results for comparison: no result depends on them, so they are not part of cache keys."""


def read_arrays(path: Path, shapes: Mapping[str, tuple[int, ...]], what: str, tool: str) -> list[np.ndarray]:
    """Arrays from a file made by one of this project's tools.

    Parameters
    ----------
    path : Path
        Of an NPZ file.
    shapes : mapping of str to tuple of int
        Shape of each array to read, by name; -1 where any length will do.
    what, tool : str
        What the file contains and which tool makes it, for the error message.

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

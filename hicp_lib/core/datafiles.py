"""Where the study's own data lie: the folder `data` at the top of a checkout, within the installed package.

They are only read. What is made or recorded goes to the working folder, the cache or the user's data folder.
"""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]


def data_dir(package: Path = _PACKAGE) -> Path:
    """The data of the library in the folder `package`: within it where a wheel put them, else beside it."""
    within = package / "data"
    return within if (within / "detectors.json").is_file() else package.parent / "data"


DATA_DIR = data_dir()
REFERENCE_DIR = DATA_DIR / "reference"
"""Results of runs that others are compared with: no result follows from them, and so no key."""

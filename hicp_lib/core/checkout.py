"""Where the study's notebooks and book are, and where results go: never next to installed code."""

from pathlib import Path

from hicp_lib.core.errors import InputError

_MARK = Path("notebooks", "profiles.toml")
_BESIDE_LIBRARY = Path(__file__).resolve().parents[2]

CHECKOUT: Path | None = _BESIDE_LIBRARY if (_BESIDE_LIBRARY / _MARK).is_file() else None
"""The checkout that the library runs from; None if it was installed from a wheel."""

# Set for the kernel of a run: where its results go, where those of earlier notebooks are, and the profile's
# name. Absent in Jupyter.
RESULTS_VARIABLE = "HICP_RESULTS"
EARLIER_RESULTS_VARIABLE = "HICP_EARLIER_RESULTS"
PROFILE_VARIABLE = "HICP_PROFILE"


def working_folder() -> Path:
    """Where results go: the working folder, or in a checkout its top, since Jupyter works in `notebooks`."""
    here = Path.cwd()
    return _study_around(here) or here


def sources() -> Path:
    """The study to run: the library's own checkout, or else the one that contains the working folder.

    Raises
    ------
    InputError
        If there is neither, since an installed package contains the library but no notebooks; or both, since
        notebooks are code, and those in a data folder must not replace the study's own.
    """
    around = _study_around(Path.cwd())
    if CHECKOUT and around not in (None, CHECKOUT):
        remedy = f"use that checkout's own environment, or go to {CHECKOUT}"
        raise InputError(f"{around}: its notebooks are not those of the library that runs here; {remedy}")
    found = CHECKOUT or around
    if found is None:
        raise InputError(f"{Path.cwd()}: has no {_MARK}; run the report in a checkout of the study")
    return found


def _study_around(folder: Path) -> Path | None:
    return next((path for path in (folder, *folder.parents) if (path / _MARK).is_file()), None)

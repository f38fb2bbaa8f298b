"""Where the study's notebooks and book are, and where results go: never beside installed code."""

from pathlib import Path

from hicp_lib.core.errors import InputError

_MARK = Path("notebooks", "profiles.toml")
_BESIDE_LIBRARY = Path(__file__).resolve().parents[2]

CHECKOUT: Path | None = _BESIDE_LIBRARY if (_BESIDE_LIBRARY / _MARK).is_file() else None
"""The checkout that the library itself runs from; None where it was installed."""

# Set for the kernel of a run: where its results go, where those of earlier notebooks are, and the profile's
# name. Absent in Jupyter.
RESULTS_VARIABLE = "HICP_RESULTS"
EARLIER_RESULTS_VARIABLE = "HICP_EARLIER_RESULTS"
PROFILE_VARIABLE = "HICP_PROFILE"


def working_folder() -> Path:
    """Where results go: the working folder, or the study around it, since Jupyter works in `notebooks`."""
    here = Path.cwd()
    return _study_around(here) or here


def sources() -> Path:
    """The study to run: the library's own checkout, or if it has none the one the working folder lies in.

    Raises
    ------
    InputError
        If there is neither, since an installed package brings the library, not the notebooks; or both, since
        notebooks are code, and those in a folder of data must not stand in for the study's.
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

"""Weights of the user's own, named once: what a detector that needs a model runs on where none is given.

Notebooks and the report name detectors, not files. `hicp models use` writes down which files, and which
other options, such a detector takes (`own_detectors.json` in the cache); options given at a call come first.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from hicp_lib.errors import InputError
from hicp_lib.files import cache_dir, read_json, sha256_bytes, sha256_file, write_json


def own_path() -> Path:
    """The file of own options."""
    return cache_dir() / "own_detectors.json"


def own_options(name: str) -> dict[str, Any]:
    """Options kept for a detector; none where nothing was kept.

    Raises
    ------
    InputError
        If the file is not one of options.
    """
    return _read().get(name, {})


def keep_own(name: str, options: dict[str, Any]) -> None:
    """Keep a detector's options, files by their absolute path, in the place of those kept before."""
    kept = {key: str(value.resolve()) if isinstance(value, Path) else value for key, value in options.items()}
    write_json(own_path(), _read() | {name: kept}, indent=2)


def own_sha256() -> dict[str, str]:
    """By detector, one SHA-256 of its options with the content of their files."""
    return {
        name: sha256_bytes(json.dumps({key: _identity(value) for key, value in kept.items()}).encode())
        for name, kept in _read().items()
    }


def _identity(value: Any) -> Any:
    is_file = isinstance(value, str) and Path(value).is_file()
    return sha256_file(value) if is_file else value


def _read() -> dict[str, dict[str, Any]]:
    path = own_path()
    kept = read_json(path) if path.is_file() else {}
    if not isinstance(kept, dict) or not all(isinstance(options, dict) for options in kept.values()):
        raise InputError(
            f"{path}: expected options by detector; delete it, and name your files again with hicp models use"
        )
    return kept

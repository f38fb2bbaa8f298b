"""MediaPipe is found where it is installed, else where it was fetched; only the wheels that are named are."""

from __future__ import annotations

import zipfile
from importlib.metadata import version
from importlib.util import find_spec

import pytest

from hicp_lib.core.checkout import CHECKOUT
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import sha256_file
from hicp_lib.detectors.mediapipe import program

METADATA = "Metadata-Version: 2.1\nName: mediapipe\nVersion: 9.9\nRequires-Dist: no-such-package\n"


@pytest.fixture
def not_installed(tmp_path, monkeypatch):
    """An index of one tiny wheel, whose requirements nobody can meet, and a Python without MediaPipe."""
    wheel = tmp_path / "index" / "mediapipe-9.9-py3-none-any.whl"
    wheel.parent.mkdir()
    with zipfile.ZipFile(wheel, "w") as file:
        file.writestr("mediapipe/__init__.py", "")
        file.writestr("mediapipe-9.9.dist-info/METADATA", METADATA)
        file.writestr(
            "mediapipe-9.9.dist-info/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
        )
        file.writestr("mediapipe-9.9.dist-info/RECORD", "")
    requirement = tmp_path / "mediapipe.txt"
    requirement.write_text(f"mediapipe==9.9 --hash=sha256:{sha256_file(wheel)}\n")
    monkeypatch.setattr(program, "REQUIREMENT_FILE", requirement)
    monkeypatch.setattr(program, "find_spec", lambda name: None if name == "mediapipe" else find_spec(name))
    monkeypatch.setenv("HICP_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(wheel.parent))
    return requirement


def test_it_is_fetched_once_without_what_it_declares(not_installed, tmp_path):
    with pytest.raises(InputError, match="MediaPipe is absent; get it with: hicp models fetch mediapipe"):
        program.program_folder()
    assert program.fetch_program()
    folder = program.program_folder()
    assert (folder / "__init__.py").is_file()
    assert folder.is_relative_to(tmp_path / "cache")
    assert program.program_version() == "9.9"
    assert not program.fetch_program()


def test_another_wheel_is_refused_and_nothing_is_left(not_installed, tmp_path):
    not_installed.write_text(f"mediapipe==9.9 --hash=sha256:{'0' * 64}\n")
    with pytest.raises(InputError, match="pip could not put it into the cache .*; check the network"):
        program.fetch_program()
    assert not list((tmp_path / "cache" / "programs").iterdir())


def test_without_the_extra_that_is_what_is_told(not_installed, monkeypatch):
    monkeypatch.setattr("hicp_lib.core.extras.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"absl is not installed, .*: pip install '\.\[mediapipe\]'"):
        program.program_folder()


def test_the_locked_one_is_the_same():
    pinned = program.REQUIREMENT_FILE.read_text().partition("\n")[2]
    assert pinned in (CHECKOUT / "environment.lock").read_text()
    assert program.program_version() == version("mediapipe")
    assert pinned.startswith(f"mediapipe=={version('mediapipe')} ")

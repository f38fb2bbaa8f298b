"""OpenCV's files are told from another distribution's that were laid over them."""

from __future__ import annotations

import base64
import hashlib
import shutil

import pytest

from hicp_lib.cli import doctor
from hicp_lib.cli.opencv_files import overwritten

BINARY = "cv2/cv2.abi3.so"


@pytest.fixture
def site(tmp_path, monkeypatch):
    """A folder of installed packages, the only one that is looked at."""
    monkeypatch.setattr("sys.path", [str(tmp_path)])
    return tmp_path


def install(site, name: str, content: bytes) -> None:
    """As pip does: the files over what is there, and a record of them."""
    (site / "cv2").mkdir(exist_ok=True)
    (site / BINARY).write_bytes(content)
    folder = site / f"{name.replace('-', '_')}-5.0.dist-info"
    folder.mkdir(exist_ok=True)
    (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 5.0\n")
    sha256 = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).decode().rstrip("=")
    (folder / "RECORD").write_text(f"{BINARY},sha256={sha256},{len(content)}\ncv2/x.pyc,,\n")


def test_what_was_laid_over_it_is_named_with_a_remedy_that_holds(site):
    install(site, "opencv-python-headless", b"headless")
    assert overwritten() is None
    assert doctor.check_opencv().finding == "opencv-python-headless 5.0"
    install(site, "opencv-contrib-python", b"with a display")
    check = doctor.check_opencv()
    assert check.status == doctor.FAIL
    assert check.finding == f"opencv-python-headless is overwritten by opencv-contrib-python ({BINARY})"
    reinstall = "pip install --force-reinstall --no-deps opencv-python-headless==5.0"
    assert check.remedy == f"pip uninstall -y opencv-contrib-python; {reinstall}"
    install(site, "opencv-python-headless", b"headless")
    assert overwritten() is None, "the last one wins"
    (site / BINARY).unlink()  # what uninstalling the other leaves
    shutil.rmtree(site / "opencv_contrib_python-5.0.dist-info")
    assert overwritten() == (f"opencv-python-headless is damaged ({BINARY})", reinstall)


def test_another_distribution_alone_is_not_taken_for_it(site):
    install(site, "opencv-python", b"with a display")
    finding, remedy = overwritten()
    assert finding == "opencv-python in the place of opencv-python-headless"
    assert remedy == (
        "pip uninstall -y opencv-python; pip install --force-reinstall --no-deps opencv-python-headless"
    )

"""Fixtures shared by the detectors' tests."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import hicp_lib
from hicp_lib.core.images import write_png
from tests.detectors.plain_people import render_person

N_PEOPLE = 8

# The detector "slow", and the code under test wherever it is.
_SOURCES = [str(Path(__file__).parent / "preloaded"), str(Path(hicp_lib.__file__).parents[1])]
_HICP = "import sys, slow_detector; from hicp_lib.cli import main as cli; sys.exit(cli.run(sys.argv[1:]))"


class Slow:
    """Processes that know the detector "slow", one folder of images, and what was computed where."""

    def __init__(self, folder: Path, n_images: int = 40) -> None:
        self.folder, self.n_images, self.calls = folder, n_images, folder / "calls"
        self.images = folder / "images"
        self.calls.mkdir()
        for value in range(n_images):
            write_png(self.images / f"{value:02}.png", np.full((8, 9, 3), value, np.uint8))

    def start(self, *command: str, **environment: str) -> subprocess.Popen:
        """A Python process with these arguments."""
        own = {
            "PYTHONPATH": os.pathsep.join(_SOURCES), "SLOW_CALLS": str(self.calls),
            "HICP_CACHE": str(self.folder / "cache"), "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "3",
        }  # fmt: skip
        return subprocess.Popen(
            [sys.executable, *command], env=os.environ | own | environment, cwd=self.folder, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
        )  # fmt: skip

    def detect(self, out: str, *arguments: str, **environment: str) -> subprocess.Popen:
        """`hicp detect` on the folder of images."""
        command = ("detect", "--detector", "slow", "--images", "images", "--out", out, *arguments)
        return self.start("-c", _HICP, *command, **environment)

    def computed(self, process: subprocess.Popen | None = None) -> list[int]:
        """The images that a process, or all of them, computed; in the order of the calls within each."""
        logs = self.calls.iterdir() if process is None else [self.calls / str(process.pid)]
        return [int(line) for log in logs if log.exists() for line in log.read_text().splitlines()]

    def open_gate(self) -> None:
        """Let the images pass that wait (see `slow_detector`)."""
        (self.folder / "gate").touch()

    def n_kept(self) -> int:
        """How many results are in the cache."""
        return sum(path.suffix == ".bin" and path.name[0] != "." for path in self.folder.rglob("*.bin"))


@pytest.fixture
def slow(tmp_path) -> Slow:
    return Slow(tmp_path)


@pytest.fixture(scope="session")
def people():
    """Rendered people with known keypoints, hands of some 60 pixels beside the shoulders."""
    return [render_person(seed, distance_m=1.4) for seed in range(N_PEOPLE)]

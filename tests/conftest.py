"""Fixtures shared by the tests."""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import matplotlib
import pytest
from hypothesis import settings

from hicp_lib.core.checkout import CHECKOUT
from hicp_lib.core.images import read_image
from hicp_lib.detectors.weights import default as default_weights

# The same examples on every machine and every day; a slow machine is no failure.
settings.register_profile("hicp", derandomize=True, deadline=None)
settings.load_profile("hicp")


# A browser without a window that asks nobody anything.
BROWSER_FLAGS = (
    "--headless=new --no-sandbox --window-size=1400,1000 --use-angle=swiftshader --enable-unsafe-swiftshader "
    "--no-first-run --disable-background-networking --disable-component-update --disable-quic --disable-sync"
)


# What needs the book.
_OF_THE_BOOK = ("api_pages", "explored_pages", "jupyterlab", "links", "notebooks", "pages")
OF_THE_BOOK = {f"test_{of}.py" for of in _OF_THE_BOOK}


# What takes long, as measured; a file, or one test of it.
SLOW = (
    "tests/core/test_cache.py::test_200_random_changes",
    "tests/core/test_cache.py::test_all_that_python_loads",
    "tests/datasets/test_subsets.py::test_no_head_keypoint_ever_stays",
    "tests/detectors/mediapipe/test_tasks.py",
    "tests/detectors/runtime/test_cluster.py",
    "tests/detectors/runtime/test_isolation.py",
    "tests/detectors/runtime/test_run.py",
    "tests/experiments/test_on_cluster.py",
    "tests/hostile/",
    "tests/report/test_book.py",
    "tests/report/test_kills.py",
    "tests/report/test_runs.py",
    "tests/simulation/test_same_bytes.py",
    "tests/simulation/world/test_scenes.py",
    "tests/test_bare_machine.py",
    "tests/test_benchmarks.py",
    "tests/test_docstrings.py::test_what_is_pending_is_not_done",
    "tests/test_pages.py::test_every_page_can_be_read_by_everybody",
    "tests/tools/test_mutate.py",
)


def pytest_collection_modifyitems(items):
    """Mark what takes long, and what looks at the book: notebooks run, pages built."""
    for item in items:
        if item.nodeid.startswith(SLOW):
            item.add_marker("slow")
        if "book" in getattr(item, "fixturenames", ()):
            item.add_marker("integration")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """One worker makes the book and looks at it; with `--dist loadfile` the others would wait for it."""
    if config.getvalue("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    class Scheduling(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = super()._split_scope(nodeid)
            return "the book" if Path(file).name in OF_THE_BOOK else file

    return Scheduling(config, log)


@pytest.fixture(scope="session")
def weights() -> Path:
    """Folder of the fetched weights; `hicp models fetch` comes before the tests."""
    absent = [
        weight.name
        for weight in default_weights.registry().values()
        if default_weights.status(weight) != "present"
    ]
    if absent and os.environ.get("HICP_TESTS_WITHOUT_WEIGHTS"):
        pytest.skip(f"weights are absent: {', '.join(absent)}")
    assert not absent, f"weights are absent: {', '.join(absent)}; run: hicp models fetch"
    return default_weights.weights_dir()


@pytest.fixture
def own_cache(tmp_path, monkeypatch, weights) -> Path:
    """An empty cache folder with the fetched weights in it."""
    cache = tmp_path / "cache"
    (cache / "weights").mkdir(parents=True)
    for path in weights.iterdir():
        if path.is_file():
            (cache / "weights" / path.name).write_bytes(path.read_bytes())
    monkeypatch.setenv("HICP_CACHE", str(cache))
    return cache


@pytest.fixture(scope="session")
def photograph():
    """The photograph of a person that ships with matplotlib: (600, 512, 3), RGB."""
    return read_image(Path(matplotlib.get_data_path()) / "sample_data" / "grace_hopper.jpg")


@pytest.fixture(scope="session")
def book() -> Path:
    """The book of the quick profile: made now, or what an earlier run left if nothing has changed.

    One worker makes it, the others wait.
    """
    import fcntl  # not on Windows

    from hicp_lib.report.build import make_report  # not in every installation

    lock = CHECKOUT / "_build" / ".tests.lock"
    lock.parent.mkdir(exist_ok=True)
    with open(lock, "w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        return make_report("quick", [], print, sources=CHECKOUT, root=CHECKOUT).parent


@pytest.fixture(scope="module")
def browser() -> Iterator:
    """A headless Chromium; without one the tests are skipped, but never in CI."""
    absent = [name for name in ("chromium", "chromedriver") if shutil.which(name) is None]
    if absent:
        reason = f"no {' and no '.join(absent)}; on Debian: apt-get install chromium chromium-driver"
        (pytest.fail if os.environ.get("CI") else pytest.skip)(reason)
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    for flag in BROWSER_FLAGS.split():
        options.add_argument(flag)
    chromium = webdriver.Chrome(options, webdriver.ChromeService(shutil.which("chromedriver")))
    chromium.set_script_timeout(600)
    yield chromium
    chromium.quit()

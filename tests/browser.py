"""A headless Chromium for the tests that open pages."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator

import pytest

LIMIT_S = 600
FLAGS = (
    "--headless=new --no-sandbox --window-size=1400,1000 --use-angle=swiftshader --enable-unsafe-swiftshader "
    "--no-first-run --disable-background-networking --disable-component-update --disable-quic --disable-sync"
)


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
    for flag in FLAGS.split():
        options.add_argument(flag)
    chromium = webdriver.Chrome(options, webdriver.ChromeService(shutil.which("chromedriver")))
    chromium.set_script_timeout(LIMIT_S)
    yield chromium
    chromium.quit()

"""Every notebook in a real JupyterLab in headless Chromium: opened, run whole, looked at and saved.

The pages run with the quick profile's parameters after its report, in kernels that have nothing of the
report's environment, and must say what the report said.
"""

from __future__ import annotations

import io
import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pandas as pd
import pytest
from papermill.iorw import load_notebook_node
from papermill.parameterize import parameterize_notebook
from PIL import Image

from hicp_lib.core.checkout import CHECKOUT
from hicp_lib.report.notebooks import read_notebooks, read_profile

pytestmark = pytest.mark.browser

NOTEBOOKS = sorted(path.stem for path in (CHECKOUT / "notebooks").glob("*.ipynb"))
REPORT = CHECKOUT / "results" / "quick"
LIMIT_S = 600
SET_BY_A_REPORT = {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MPLBACKEND", "MATPLOTLIBRC", "PYTHONHASHSEED"}
RAW_MARKUP = re.compile(r"\{[a-z:-]+\}|```|:::|\$\$|\\frac")
ASKS = ".jp-Dialog, .Toastify__toast"

CALL = """
  const [argument, done] = arguments;
  const pause = time_ms => new Promise(resolve => setTimeout(resolve, time_ms));
  const call = async () => {
    while (!window.jupyterapp) await pause(50);
    const app = window.jupyterapp;
    await app.restored;
    %s
  };
  call().then(value => done({value}), error => done({error: `${error}`}));
"""
OPEN = """
  const panel = await app.commands.execute("docmanager:open", {path: argument, factory: "Notebook"});
  await panel.context.ready;
  await panel.sessionContext.ready;
  await panel.sessionContext.session.kernel.info;
"""
RUN_AND_SAVE = """
  await app.commands.execute("notebook:run-all-cells");
  const ran = app.shell.currentWidget.content.model.sharedModel.toJSON().cells;
  await app.commands.execute("docmanager:save");
  return ran;
"""
# What a reader sees of every cell, and the area in which each picture is really there.
LOOK = """
  const seen = {text: "", images: []};
  for (const cell of app.shell.currentWidget.content.widgets) {
    cell.node.scrollIntoView();
    await pause(50);
    const isShown = () => cell.node.querySelector(".jp-OutputArea-output");
    for (let n = 0; n < 100 && cell.model.outputs?.length && !isShown(); n++) await pause(50);
    for (const shown of cell.node.querySelectorAll(".jp-MarkdownOutput, .jp-OutputArea-output"))
      seen.text += shown.innerText + "\\n";
    for (const image of cell.node.querySelectorAll("figure.hicp img")) {
      await image.decode().catch(() => null);
      seen.images.push([image.alt, Math.min(image.naturalWidth, image.offsetWidth) * image.offsetHeight]);
    }
  }
  return seen;
"""
CLOSE = """
  await app.shell.currentWidget.sessionContext.shutdown();
  app.shell.currentWidget.dispose();
"""


@dataclass(frozen=True)
class Lab:
    """A running JupyterLab: its address and its folder."""

    url: str
    folder: Path


@pytest.fixture(scope="module")
def lab(book, tmp_path_factory) -> Iterator[Lab]:
    """A JupyterLab as `make lab` starts it, on notebooks with the quick profile's parameters."""
    root, home = tmp_path_factory.mktemp("lab"), tmp_path_factory.mktemp("home")
    stage_notebooks(root / "notebooks")
    (root / "results").mkdir()
    (root / "results" / "full").symlink_to(REPORT)  # what a page takes from the pages before it
    environment = {key: value for key, value in os.environ.items() if key not in SET_BY_A_REPORT}
    environment |= {f"JUPYTER_{name}_DIR": str(home / name) for name in ("CONFIG", "DATA", "RUNTIME")} | {
        "JUPYTER_CONFIG_PATH": str(CHECKOUT / "tools" / "jupyter"),
        "IPYTHONDIR": str(home / "ipython"),
    }
    command = [sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root", "--port=0"]
    command += ["--IdentityProvider.token=", "--expose-app-in-browser", f"--notebook-dir={root}"]
    with open(home / "log.txt", "w") as log:
        server = subprocess.Popen(command, env=environment, stdout=log, stderr=log)
    try:
        yield Lab(_address(server, home), root)
    finally:
        server.terminate()
        server.wait()


def stage_notebooks(folder: Path) -> None:
    """Copies of the notebooks with the quick profile's parameters, put in as a report does."""
    folder.mkdir()
    notebooks = read_notebooks(CHECKOUT / "notebooks")
    chosen, _ = read_profile(CHECKOUT / "notebooks" / "profiles.toml", "quick", notebooks)
    shutil.copy(CHECKOUT / "notebooks" / "profiles.toml", folder)
    for notebook in notebooks:
        parameters = chosen.get(notebook.name, {})
        staged = parameterize_notebook(load_notebook_node(str(notebook.path)), parameters)
        del staged.metadata["papermill"]
        nbformat.write(staged, folder / notebook.path.name)


def _address(server: subprocess.Popen, home: Path) -> str:
    for _ in range(600):
        stated = [path.read_text() for path in (home / "RUNTIME").glob("jpserver-*.json")]
        if any(stated):
            return json.loads(stated[0])["url"]
        assert server.poll() is None, (home / "log.txt").read_text()
        time.sleep(0.1)
    raise AssertionError("JupyterLab did not start within a minute")


@pytest.fixture(scope="module")
def do(browser, lab):
    """Runs JavaScript in JupyterLab, where `app` is its application and `argument` what is given."""
    browser.get(f"{lab.url}lab")

    def run(script: str, argument: Any = None) -> Any:
        answer = browser.execute_async_script(CALL % script, argument)
        assert "error" not in answer, answer
        return answer.get("value")

    return run


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_page_runs_shows_and_gives_what_the_report_does(name, browser, lab, do):
    path = lab.folder / "notebooks" / f"{name}.ipynb"
    before = path.read_bytes()
    do(OPEN, f"notebooks/{path.name}")
    try:
        assert [problem for cell in do(RUN_AND_SAVE) for problem in _problems(cell)] == []
        seen = do(LOOK)
        assert RAW_MARKUP.findall(seen["text"]) == []
        words = json.loads((REPORT / name / "captions.json").read_text()).values()
        assert len(seen["images"]) == sum(of.get("file", ".mp4")[-4:] != ".mp4" for of in words)
        assert [alt for alt, area_px2 in seen["images"] if area_px2 < 200 * 100] == []
        scenes = browser.find_elements("css selector", ".js-plotly-plot")
        assert [_is_drawn(scene.screenshot_as_png) for scene in scenes] == [
            True for of in words if "alt" in of and "file" not in of
        ]
        assert [question.text for question in browser.find_elements("css selector", ASKS)] == []
    finally:
        do(CLOSE)
    assert path.read_bytes() == before, "saving changes nothing that git keeps"
    _compare_results(REPORT / name, lab.folder / "results" / "interactive" / name)


def _problems(cell: dict) -> Iterator[str]:
    for output in cell.get("outputs", []):
        if output["output_type"] == "error":
            yield f"{output['ename']}: {output['evalue']}"
        if output["output_type"] == "stream" and output["name"] == "stderr":
            yield "".join(output["text"])


def _is_drawn(png: bytes) -> bool:
    """Whether the picture of a 3D scene has many colours on a good part of it."""
    pixels = np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).reshape(-1, 3)
    return (pixels.max(axis=1) < 240).mean() > 0.02 and len(np.unique(pixels, axis=0)) > 1000


def _compare_results(report: Path, here: Path) -> None:
    """The same numbers to the last bit."""
    assert json.loads((here / "values.json").read_text()) == json.loads((report / "values.json").read_text())
    for table in report.glob("*.parquet"):
        pd.testing.assert_frame_equal(
            pd.read_parquet(here / table.name), pd.read_parquet(table), check_exact=True
        )

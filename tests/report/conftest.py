"""A study of two tiny notebooks and a one-page book."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from hicp_lib.core import cache
from hicp_lib.core.checkout import CHECKOUT
from hicp_lib.study import provenance
from tests.report.tiny_study import FINISH, MEASURE, START, write_notebook


@pytest.fixture(autouse=True)
def library(tmp_path_factory, monkeypatch) -> Path:
    """Stands for the library in keys: somebody may be editing the real one while the tests run."""
    folder = tmp_path_factory.mktemp("library")
    (folder / "study").mkdir()
    for name in ("__init__", "study/__init__", "study/page", "other"):
        (folder / f"{name}.py").write_text("a = 1")
    for module in (provenance, cache):
        monkeypatch.setattr(module, "LIBRARY_DIR", folder)
    return folder


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """Root of a checkout with two notebooks, the second after the first, and a book."""
    for name in ("00_first", "01_second"):
        write_notebook(tmp_path / "notebooks" / f"{name}.ipynb", START, MEASURE, FINISH)
    (tmp_path / "notebooks" / "profiles.toml").write_text(
        '[quick.00_first]\nseed = 3\n[full]\n[after]\n01_second = ["00_first"]\n'
    )
    book = tmp_path / "book"
    book.mkdir()
    for name in ("_ext", "_static"):
        shutil.copytree(CHECKOUT / "book" / name, book / name)
    shutil.copy(CHECKOUT / "book" / "_config.yml", book)
    (book / "_toc.yml").write_text(
        "format: jb-book\nroot: index\nchapters:\n- file: notebooks/00_first\n- file: notebooks/01_second\n"
    )
    (book / "index.md").write_text('# Home\n\nThe seed is {{ value("00_first", "seed") }}. $y^2$\n')
    return tmp_path

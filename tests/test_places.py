"""What texts say is somewhere is there: files, modules, their functions; and the drawing of the floors."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from hicp_lib.core.checkout import CHECKOUT
from tests.docstrings import MODULES
from tools.draw_floors import DRAWING, HOLDS, drawing, floors

FOLDERS = "hicp_lib|tests|tools|notebooks|book|data|benchmarks"
PATH = re.compile(rf"(?<![\w./-])(?:{FOLDERS})/[\w./-]*\w")
MADE = {"book/api"}  # when the book is built
DOTTED = re.compile(r"\bhicp_lib(?:\.(?!__)[A-Za-z_]\w*)+")
INSTALLED = {"hicp_lib.data"}  # the checkout's `data`, in a wheel
ITEM = re.compile(r"^(?:\d+\.|-|\|) .*\n(?: +.*\n)*", re.MULTILINE)
GUIDES = [CHECKOUT / "book" / "architecture.md", CHECKOUT / "CONTRIBUTING.md"]


def tracked(*patterns: str) -> list[Path]:
    """The checkout's own files; of a folder that is no repository, all."""
    listed = ["git", "ls-files", "--cached", "--others", "--exclude-standard", *patterns]
    done = subprocess.run(listed, cwd=CHECKOUT, capture_output=True, text=True)
    if done.returncode:
        return [path for pattern in patterns for path in CHECKOUT.rglob(pattern) if ".venv" not in path.parts]
    return [CHECKOUT / name for name in done.stdout.splitlines() if (CHECKOUT / name).is_file()]


def defines(path: Path, name: str) -> bool:
    """Whether a module has a function, class, method or value of this name."""
    return bool(re.search(rf"^ *(?:def|class) {name}\b|^{name}\b", path.read_text(), re.MULTILINE))


def unresolved(name: str) -> bool:
    """Whether a dotted name is neither a module nor something that a module defines."""
    module, rest = name, []
    while module not in MODULES:
        module, _, last = module.rpartition(".")
        rest.insert(0, last)
    return len(rest) > 2 or any(not defines(MODULES[module], part) for part in rest)


@pytest.mark.parametrize("path", tracked("*.md"), ids=lambda path: path.relative_to(CHECKOUT).as_posix())
def test_files_that_are_named_exist(path):
    text = re.sub(r"\]\([^)]*\)|https?://\S+", "", path.read_text())
    if path.name == "CHANGELOG.md":  # speaks of what was
        pytest.skip("tells of the past")
    missing = [name for name in PATH.findall(text) if not (CHECKOUT / name).exists() and name not in MADE]
    assert missing == []


def test_modules_and_functions_that_are_named_by_their_full_name_exist():
    unknown = {
        f"{path.relative_to(CHECKOUT)}: {name}"
        for path in tracked("*.md", "*.py", "*.ipynb", "*.sh", "*.toml")
        if path.name != "CHANGELOG.md" and "tests" not in path.relative_to(CHECKOUT).parts
        for name in DOTTED.findall(path.read_text())
        if unresolved(name) and name not in INSTALLED
    }
    assert unknown == set()


@pytest.mark.parametrize("guide", [*GUIDES, CHECKOUT / "book" / "api.md"], ids=lambda path: path.name)
def test_functions_named_after_a_file_are_in_it(guide):
    n_checked = 0
    for item in ITEM.findall(guide.read_text()):
        file = None
        for name in re.findall(r"`([^`]+)`", item):
            if PATH.fullmatch(name):
                file = CHECKOUT / name
            elif name in MODULES:
                file = MODULES[name]
            elif file and file.suffix == ".py" and name.isidentifier():
                assert defines(file, name), f"{file.relative_to(CHECKOUT)} has no {name}"
                n_checked += 1
    assert n_checked


def test_the_guides_list_every_floor_from_the_top_down():
    names = floors(CHECKOUT)
    for guide in GUIDES:
        assert all(f"`{name}`" in guide.read_text() or f"{name}, " in guide.read_text() for name in names)
    assert re.findall(r"^- `(\w+)`: ", GUIDES[1].read_text(), re.MULTILINE) == names


def test_the_drawing_is_that_of_the_contract():
    assert set(HOLDS) == set(floors(CHECKOUT))
    assert (CHECKOUT / DRAWING).read_text() == drawing(floors(CHECKOUT)), "run: python tools/draw_floors.py"


@pytest.mark.parametrize("name", ["hicp_lib.core.nothing", "hicp_lib.core.oks.nothing", "hicp_lib.rgbd"])
def test_what_does_not_exist_is_noticed(name):
    assert unresolved(name)
    assert not unresolved("hicp_lib.core.oks.oks")

"""A part that is missing says which extra brings it, to users of the command and of the library alike."""

from __future__ import annotations

import subprocess
import sys
import tomllib

import pytest

from hicp_lib.core.checkout import CHECKOUT
from hicp_lib.core.extras import MissingPartError, needs, require

# `hicp` where one package is not installed.
WITHOUT = """import sys
sys.modules[sys.argv[1]] = None
from hicp_lib.cli import main as cli
sys.exit(cli.run(sys.argv[2:]))"""


def test_both_doors_name_the_package_and_its_extra():
    said = r"^nowhere is not installed, and this needs it; .* pip install '\.\[robot\]'$"
    with pytest.raises(MissingPartError, match=said), needs("robot"):
        import nowhere  # noqa: F401
    with pytest.raises(MissingPartError, match=said):
        require("robot", "json", "nowhere")
    require("robot", "json")


def test_a_fault_within_a_package_is_not_called_a_missing_one():
    with pytest.raises(ImportError, match="cannot import name") as error, needs("robot"):
        from json import nothing_of_this_name  # noqa: F401
    assert not isinstance(error.value, MissingPartError)


@pytest.mark.parametrize(
    ("package", "arguments", "extra"),
    [
        ("open3d", ["scenes", "render", "OUT"], "render"),
        ("papermill", ["report"], "report"),
        (
            "pyarrow",
            ["lift", "--recording", "x", "--detector", "mediapipe", "--out", "OUT.parquet"],
            "analysis",
        ),
    ],
)
def test_a_command_answers_in_one_line(tmp_path, package, arguments, extra):
    words = [str(tmp_path / word) if word.startswith("OUT") else word for word in arguments]
    done = subprocess.run([sys.executable, "-c", WITHOUT, package, *words], capture_output=True, text=True)
    assert done.returncode == 2
    remedy = f"in hicp's checkout run: pip install '.[{extra}]'"
    assert done.stderr == f"hicp: {package} is not installed, and this needs it; {remedy}\n"


def test_every_extra_that_is_named_exists_and_every_dependency_has_a_lower_bound():
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]
    offered = project["optional-dependencies"]
    named = {
        word
        for path in (CHECKOUT / "hicp_lib").rglob("*.py")
        for marker in ('needs("', 'require("')
        for word in [piece.partition('"')[0] for piece in path.read_text().split(marker)[1:]]
    }
    assert named <= offered.keys()
    for requirement in [*project["dependencies"], *(row for rows in offered.values() for row in rows)]:
        assert ">=" in requirement or "==" in requirement or requirement.startswith("hicp["), requirement

"""The page on detectors: its options are the code's, its scripts are Python, what it fetches is there."""

from __future__ import annotations

import json
import re
from importlib import import_module
from inspect import Parameter, signature
from typing import get_args, get_type_hints

import pytest

from hicp_lib.core.checkout import CHECKOUT
from hicp_lib.detectors.combined.detector import Combined
from hicp_lib.detectors.mediapipe.tasks import _Task
from hicp_lib.detectors.onnx.session import open_model
from hicp_lib.detectors.onnx.top_down import TopDown
from hicp_lib.detectors.registry import DETECTORS
from hicp_lib.detectors.weights.published import published

TEXT = (CHECKOUT / "book" / "detectors.md").read_text()
ROW = re.compile(r"^\| `(\w+)` \| ((?:`[\w-]+`(?:, )?)+) \| ([^|]+) \| [^|]+ \|$", re.MULTILINE)
PARTS = {"body", "hands"}  # of a combination: detectors, not options
# Of options that several detectors declare together; the others' are None.
SHARED_DEFAULTS = {"provider": "cpu", "threads": 1, "min_score": 0.5, "tracking_hz": 0, "flip_test": False}
SCRIPTS = sorted((CHECKOUT / "tools").glob("export_*.py"))


def options_told() -> dict[tuple[str, str], str]:
    """What the page gives as default, by detector and option."""
    section = TEXT.partition("\n## Options\n")[2].partition("\n## ")[0]
    rows = ROW.findall(section)
    told = [
        ((name, option), default)
        for option, names, default in rows
        for name in names.strip("`").split("`, `")
    ]
    assert len(dict(told)) == len(told) > 0, "an option is told twice, or none"
    return dict(told)


def options_taken() -> dict[tuple[str, str], Parameter]:
    classes = {
        entry.name: getattr(import_module(entry.module), entry.class_name) for entry in DETECTORS.values()
    }
    taken = {
        (name, option): parameter
        for name, detector in (classes | {"combined": Combined}).items()
        for option, parameter in signature(detector, eval_str=True).parameters.items()
        if not (detector is Combined and option in PARTS)
    }
    several = {key: of for key, of in taken.items() if of.kind is Parameter.VAR_KEYWORD}
    for (name, shared), parameter in several.items():
        del taken[name, shared]
        for option in get_type_hints(*get_args(parameter.annotation)):
            default = SHARED_DEFAULTS.get(option)
            taken[name, option] = Parameter(option, Parameter.KEYWORD_ONLY, default=default)
    return taken


def test_the_page_names_every_option_and_no_other():
    assert options_told().keys() == options_taken().keys()


@pytest.mark.parametrize(("name", "option"), options_taken())
def test_the_page_gives_the_default_of_an_option(name, option):
    told, default = options_told()[name, option], options_taken()[name, option].default
    if default is Parameter.empty:
        assert told == "required"
    elif default is None:
        assert "`" not in told  # what takes its place, in words
    else:
        assert told == f"`{default if isinstance(default, str) else json.dumps(default)}`"


def test_shared_defaults_are_the_codes():
    taken = [
        of for make in (open_model, _Task._prepare, TopDown) for of in signature(make).parameters.values()
    ]
    defaults = {of.name: of.default for of in taken if of.default not in (None, Parameter.empty)}
    assert defaults == SHARED_DEFAULTS


@pytest.mark.parametrize("code", re.findall(r"^```python\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL))
def test_scripts_on_the_page_are_python(code):
    assert "torch.onnx.export" in code
    compile(code, "book/detectors.md", "exec")


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.name)
def test_export_scripts_are_python_and_on_the_page(path):
    compile(path.read_text(), str(path), "exec")
    assert f"tools/{path.name}" in TEXT


def test_the_page_fetches_what_is_published():
    names = re.findall(r"hicp models fetch ([\w-]+)", TEXT)
    assert names and set(names) <= published().keys()

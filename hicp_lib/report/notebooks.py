"""The notebooks of the study: their declared parameters, and the values in each profile."""

import ast
import json
import os
import re
import tomllib
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

import nbformat

from hicp_lib.core.cache import digest, imports_of, syntax_tree
from hicp_lib.core.errors import InputError, refuse_unknown
from hicp_lib.core.files import json_or_text, read_bytes

PARAMETERS_TAG = "parameters"
_COMMENTED = re.compile(r"((?:^#.*\n)+)(\w+)", re.MULTILINE)
_NUMBER = r"(\d+(?:\.\d+)?)"
_FROM = re.compile(rf"{_NUMBER} or more|from {_NUMBER} |{_NUMBER} to|above {_NUMBER}")
_UP_TO = re.compile(rf"\d to (?:below )?{_NUMBER}")
_MOST, _SHOWN = 2.0**63, 80  # largest number; characters of a refused value


@dataclass(frozen=True)
class Notebook:
    """A notebook in the repository.

    Attributes
    ----------
    path : Path
        The file; `name` is its name without `.ipynb`.
    defaults : dict of str to object
        The value of every parameter by its name, as its `parameters` cell assigns them.
    source_sha256 : str
        Hash of its cells' kinds, tags and text; outputs and other metadata are ignored.
    imports : frozenset of str
        Names of the modules it imports.
    allowed : dict of str to str
        By a parameter's name, its unit and range, from the brackets in the comment above it.
    """

    path: Path
    defaults: dict[str, Any]
    source_sha256: str
    imports: frozenset[str]
    allowed: dict[str, str] = field(default_factory=dict)

    @property
    def name(self) -> str:
        return self.path.stem


def read_notebooks(folder: Path) -> list[Notebook]:
    """Every notebook of a folder, in the order of their names, which is the order they run in.

    Raises
    ------
    InputError
        If the folder holds none, or one cannot be read or has no clear `parameters` cell.
    """
    paths = sorted(folder.glob("*.ipynb"))
    if not paths:
        raise InputError(f"{folder}: holds no notebook; expected files such as 00_quickstart.ipynb")
    return [read_notebook(path) for path in paths]


def read_notebook(path: Path) -> Notebook:
    """Read one notebook's declared parameters and hash its source.

    Raises
    ------
    InputError
        If it is not a notebook, or has not exactly one cell tagged `parameters` made of literal assignments.
    """
    try:
        cells = nbformat.read(path, as_version=4).cells
    except Exception as error:  # nbformat raises a dozen kinds for what is not a notebook
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{path}: is not a notebook ({reason}); restore the file") from None
    tagged = [cell.source for cell in cells if PARAMETERS_TAG in cell.metadata.get("tags", [])]
    if len(tagged) != 1:
        raise InputError(f"{path}: has {len(tagged)} cells tagged `{PARAMETERS_TAG}`; expected exactly one")
    code = [cell.source for cell in cells if cell.cell_type == "code"]
    declared = _assignments(tagged[0], path), source_sha256(cells), _imports(path, code)
    return Notebook(path, *declared, _allowed(tagged[0]))


def source_sha256(cells: list[Any]) -> str:
    """Hash of the code that a notebook runs, or that an executed one ran."""
    rows = [[cell.cell_type, cell.metadata.get("tags", []), cell.source] for cell in cells]
    return digest([row for row in rows if "injected-parameters" not in row[1]])  # papermill's own


def _imports(path: Path, cells: list[str]) -> frozenset[str]:
    lines = [line for cell in cells for line in cell.splitlines() if not line.startswith(("%", "!"))]
    try:
        return imports_of("\n".join(lines))
    except SyntaxError as error:
        raise InputError(f"{path}: its code is not Python ({error.msg}: {error.text}); correct it") from None


def _assignments(source: str, path: Path) -> dict[str, Any]:
    """Name -> value of `name = literal` lines. The text is parsed, never run."""
    values = {}
    try:
        for statement in syntax_tree(source).body:
            match statement:
                case ast.Assign(targets=[ast.Name(id=name)]) | ast.AnnAssign(target=ast.Name(id=name)):
                    values[name] = ast.literal_eval(statement.value or "")
                case _:
                    raise ValueError(ast.unparse(statement))
    except (SyntaxError, ValueError, TypeError):
        raise InputError(
            f"{path}: its parameters cell is not `name = value` lines with literal values; rewrite it so"
        ) from None
    return values


def _allowed(source: str) -> dict[str, str]:
    above = {name: text.replace("\n# ", " ") for text, name in _COMMENTED.findall(source)}
    return {name: found[1] for name, text in above.items() if (found := re.search(r"\[(.+)\]", text))}


def read_profile(
    path: Path, name: str, notebooks: list[Notebook]
) -> tuple[dict[str, dict[str, Any]], dict[str, list[str]]]:
    """Read a profile from the file of profiles and check it against the notebooks.

    Parameters
    ----------
    path : Path
        The TOML file; `[PROFILE.NOTEBOOK]` sets parameters, `[after]` names those that
        come before others.
    name : str
        Of the profile.
    notebooks : list of Notebook

    Returns
    -------
    parameters : dict of str to dict
        Per notebook, those that differ from the defaults.
    after : dict of str to list of str
        Per notebook, those whose results it reads or whose work it shares.

    Raises
    ------
    InputError
        If the file or the profile is missing, names a notebook or parameter that does not exist, or has
        notebooks wait for each other.
    """
    text = read_bytes(path, "restore the file")
    try:
        content = tomllib.loads(text.decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not TOML ({error}); correct the file") from None
    after = content.pop("after", {})
    refuse_unknown(f"{path}: profile", name, sorted(content))
    known = {notebook.name: notebook for notebook in notebooks}
    for notebook in [*content[name], *after, *(item for items in after.values() for item in items)]:
        refuse_unknown(f"{path}: notebook", notebook, known)
    try:
        TopologicalSorter(after).prepare()
    except CycleError as error:
        raise InputError(
            f"{path}, [after]: {' waits for '.join(reversed(error.args[1]))}; break the circle"
        ) from None
    given = content[name].items()
    parameters = {key: check_parameters(known[key], its, f"{path}, [{name}.{key}]") for key, its in given}
    return parameters, after


def check_parameters(notebook: Notebook, given: dict[str, Any], origin: str) -> dict[str, Any]:
    """`given` if the notebook declares every name with that type; int counts as float, paths as a path.

    Parameters
    ----------
    notebook : Notebook
    given : dict of str to object
        Values by the parameters' names.
    origin : str
        Their origin, in words, for the start of the message.

    Raises
    ------
    InputError
        Names the unknown parameter and the known ones, or the expected type and range.

    Examples
    --------
    >>> book = Notebook(Path("05_tiny.ipynb"), {"seed": 0, "share": 0.5}, "", frozenset())
    >>> check_parameters(book, {"share": 1}, "-p share")
    {'share': 1}
    >>> check_parameters(book, {"seed": "one"}, "-p seed")
    Traceback (most recent call last):
        ...
    hicp_lib.core.errors.InputError: -p seed: 05_tiny: 'seed' is "one"; expected an integer such as 0
    """
    for name, value in given.items():
        refuse_unknown(f"{origin}: {notebook.name}: parameter", name, notebook.defaults)
        default = notebook.defaults[name]
        values = value if isinstance(value, list) and is_path(name, default) else [value]
        allowed = notebook.allowed.get(name, "")
        if not values or not all(_fits(one, default, allowed) for one in values):
            raise InputError(
                f"{origin}: {notebook.name}: '{name}' is {json.dumps(value, default=str)[:_SHOWN]}; "
                f"expected {_article(type(default))} such as {default!r}{allowed and f' [{allowed}]'}"
            )
    return given


def _fits(value: Any, default: Any, allowed: str) -> bool:
    """Whether a value has the type of the default, and all its numbers are in the allowed range."""
    if isinstance(default, bool | None):
        return default is None or isinstance(value, bool)
    if isinstance(default, int | float):
        is_number = type(value) is int or isinstance(default, float) and type(value) is float
        return is_number and abs(value) < _MOST and _is_in_range(value, allowed)
    if type(value) is not type(default):
        return False
    if isinstance(default, str):
        choices = re.findall('"(.+?)"', allowed)
        is_one = value in choices if default in choices and len(choices) > 1 else value or not default
        return bool(is_one) and value.isprintable()
    if isinstance(default, dict):
        return all(_fits(one, known, allowed) for one in value.values() for known in [*default.values()][:1])
    if any(value.count(one) > 1 for one in value) or allowed.startswith("two ") and len(value) != 2:
        return False
    if not value:
        return not default or "some or none" in allowed
    return all(_fits(one, kind, allowed) for one in value for kind in default[:1])


def _is_in_range(value: float, allowed: str) -> bool:
    """Whether a number is in a range in words, such as "1 or more" or "0 to below 1"."""
    low, high = _FROM.search(allowed), _UP_TO.search(allowed)
    least = float(low[low.lastindex or 0]) if low else 0.0 if "standard deviation" in allowed else -_MOST
    most = float(high[1]) if high else _MOST
    is_low_enough = value < most if high and "below" in high[0] else value <= most
    return is_low_enough and (value > least if low and low[0].startswith("above") else value >= least)


def _article(kind: type) -> str:
    names = {int: "an integer", float: "a number", bool: "true or false", str: "text"}
    return (names | {list: "a list of different values"}).get(kind, f"a {kind.__name__}")


def is_path(name: str, default: Any) -> bool:
    """Whether a parameter names a file or folder: text, empty by default or called `*_path` or `*_dir`.

    Examples
    --------
    >>> is_path("images_dir", "data"), is_path("recording", ""), is_path("source", "rendered")
    (True, True, False)
    """
    return isinstance(default, str) and (default == "" or name.endswith(("_path", "_dir")))


def parse_overrides(pairs: list[tuple[str, str]], notebooks: list[Notebook]) -> dict[str, dict[str, Any]]:
    """Turn `-p NAME VALUE` pairs into parameters of every notebook that declares NAME.

    A value is read by the type of the notebook's default: `true`/`false`, numbers, lists as
    `a,b` or JSON; several paths as JSON. Paths are made absolute, since notebooks run in their own folder.

    Parameters
    ----------
    pairs : list of (str, str)
    notebooks : list of Notebook

    Returns
    -------
    dict of str to dict
        By every notebook's name, the values given for it.

    Raises
    ------
    InputError
        If no notebook declares the name, it is given twice, or the value does not fit.

    Examples
    --------
    >>> tiny = Notebook(Path("05_tiny.ipynb"), {"seed": 0, "detectors": ["mediapipe"]}, "", frozenset())
    >>> parse_overrides([("seed", "3"), ("detectors", "openpose,mmpose")], [tiny])
    {'05_tiny': {'seed': 3, 'detectors': ['openpose', 'mmpose']}}
    """
    overrides: dict[str, dict[str, Any]] = {notebook.name: {} for notebook in notebooks}
    known = sorted({name for notebook in notebooks for name in notebook.defaults})
    for name, text in pairs:
        refuse_unknown("-p: parameter", name, known)
        if [given for given, _ in pairs].count(name) > 1:
            raise InputError(f"-p {name}: is given twice; give it once")
        for notebook in (notebook for notebook in notebooks if name in notebook.defaults):
            value = _parse(name, text, notebook.defaults[name])
            overrides[notebook.name] |= check_parameters(notebook, {name: value}, f"-p {name}")
    return overrides


def _parse(name: str, text: str, default: Any) -> Any:
    """`text` as a value of the type of `default`; unchanged text when it is not one."""
    value = json_or_text(text)
    if text and is_path(name, default):
        several = isinstance(value, list)
        paths = [os.path.abspath(str(one)) for one in (value if several else [text])]
        return paths if several else paths[0]
    if isinstance(default, list) and not text.startswith("["):
        first = default[0] if default else ""
        return [_parse("", item, first) for item in text.split(",") if item]
    return text if isinstance(default, str) else value

"""What is wrong with a module's docstrings, as numpydoc reads them.

The type slot (after `name :`, and in the first line of a returned value) holds a type and nothing else:

    slot       type {", " qualifier}
    type       atom | atom " of " type | type " to " type | type " or " type | "(" type {", " type} ")"
    atom       a word of `WORDS`, a class that the module knows, a literal, {a, b}, or a Python annotation
    qualifier  "optional" | "default VALUE" | "shape (...)" | "dtype NAME"

What a value means, its unit and its frame stand in the lines below.

Modules that do not keep to it yet are listed in `docstrings_pending.txt`, which

    python -m tests.docstrings > tests/docstrings_pending.txt

writes anew; `python -m tests.docstrings MODULE ...` tells what is wrong in them.
"""

from __future__ import annotations

import ast
import builtins
import importlib
import inspect
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

from numpydoc.docscrape import NumpyDocString
from numpydoc.validate import validate

import hicp_lib

WORDS = frozenset(
    "any array bool bytes callable character class complex dataclass decorator dict file float frozenset "
    "function generator image int iterable iterator key list mapping module number object path scalar "
    "sequence set slice str table text tuple type None True False DataFrame Series".split()
)
PLURALS = frozenset(f"{word}s" for word in WORDS) | {"classes", "bytes", "None"}
# Of numpydoc's own checks: sections known and in order; parameters that exist, in order, with a type.
CHECKS = {"GL06", "GL07", "PR02", "PR03", "PR04"}
MANY_PARAMETERS = 3

_ROOT = Path(hicp_lib.__file__).parent
# Every module of the library, by name; none is imported yet.
MODULES = {
    ".".join(path.relative_to(_ROOT.parent).with_suffix("").parts).removesuffix(".__init__"): path
    for path in sorted(_ROOT.rglob("*.py"))
}

_QUALIFIER = re.compile(r"optional|default:? \S.*|shape \(.*\)( or \(.*\))*|dtype \w+|\(.*\)")
_JOINTS = re.compile(r" of | to | or ")


def public_objects(module: ModuleType) -> Iterator[tuple[str, Any]]:
    """Public functions and classes that a module defines, and their public methods."""
    for name, value in vars(module).items():
        if name.startswith("_") or getattr(value, "__module__", None) != module.__name__:
            continue
        if inspect.isclass(value):
            yield name, value
            for method, function in vars(value).items():
                if not method.startswith("_") and callable(inspect.unwrap(getattr(value, method))):
                    yield f"{name}.{method}", function
        elif callable(value) and hasattr(value, "__name__"):
            yield name, value


def problems(name: str) -> list[str]:
    """One line for each fault in a module's docstrings; empty if there is none."""
    module = importlib.import_module(name)
    found = []
    for path, value in public_objects(module):
        where = f"{name}.{path}"
        if not inspect.getdoc(value):
            found.append(f"{where}: has no docstring")
            continue
        try:
            sections = NumpyDocString(inspect.getdoc(value))
        except ValueError as error:
            found.append(f"{where}: {error}")
            continue
        errors = validate(where)["errors"]
        found += [f"{where}: {text}" for code, text in errors if code in CHECKS]
        if not inspect.isclass(value) and _n_parameters(value) >= MANY_PARAMETERS:
            if not sections["Parameters"]:
                found.append(f"{where}: {MANY_PARAMETERS} parameters or more, and no section Parameters")
        for entry in sections["Attributes"]:
            unknown = [one for one in entry.name.split(", ") if not _has_attribute(value, one)]
            found += [f"{where}: Attributes: there is no {one}" for one in unknown]
        for section in ("Parameters", "Other Parameters", "Attributes", "Returns", "Yields"):
            for entry in sections[section]:
                if not is_type(entry.type, module):
                    found.append(f"{where}: {section}: {entry.name or 'type'} : {entry.type!r} is no type")
    return found


def is_type(slot: str, module: ModuleType) -> bool:
    """Whether what stands in a type slot is a type, by the rule above."""
    first, *qualifiers = _split(slot.replace("`", ""), ", ")
    return _names_a_type(first, module) and all(_QUALIFIER.fullmatch(part) for part in qualifiers)


def _names_a_type(text: str, module: ModuleType) -> bool:
    text = re.sub(r" of shape \(.*?\)", "", text).strip()
    if _is_atom(text, module):
        return True
    if text.startswith("(") and text.endswith(")"):
        parts = _split(text[1:-1], ", ")
        return len(parts) > 1 and all(_names_a_type(part, module) for part in parts)
    for joint in _JOINTS.finditer(text):
        left, right = text[: joint.start()], text[joint.end() :]
        if left and _names_a_type(left, module) and _names_a_type(right, module):
            return True
    return False


def _is_atom(text: str, module: ModuleType) -> bool:
    if text in WORDS | PLURALS:
        return True
    if text.startswith("callable(") and text.endswith(")"):
        return True
    try:
        tree = ast.parse(text, mode="eval").body
    except SyntaxError:
        return False
    return _is_annotation(tree, module)


def _is_annotation(node: ast.expr, module: ModuleType) -> bool:
    if isinstance(node, ast.Constant):
        return node.value is not Ellipsis
    if isinstance(node, ast.Set):
        return all(_is_annotation(item, module) for item in node.elts)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitOr):
        return _is_annotation(node.left, module) and _is_annotation(node.right, module)
    if isinstance(node, ast.UnaryOp):
        return isinstance(node.operand, ast.Constant)
    if isinstance(node, ast.Subscript):
        return _is_annotation(node.value, module)
    if isinstance(node, (ast.Name, ast.Attribute)):
        return _is_class(ast.unparse(node), module)
    return False


def _is_class(name: str, module: ModuleType) -> bool:
    """A class that is known by this name: to the module (also for type checks alone), or by its full path."""
    first, *rest = name.split(".")
    if not rest and (hasattr(builtins, name) or hasattr(module, name)):
        return isinstance(getattr(module, name, getattr(builtins, name, None)), type) or name[0].isupper()
    if first == "hicp_lib":
        try:
            return hasattr(importlib.import_module(name.rpartition(".")[0]), rest[-1])
        except ImportError:
            return False
    return name.rpartition(".")[2] in _imported_names(module) or (bool(rest) and rest[-1][0].isupper())


def _imported_names(module: ModuleType) -> set[str]:
    tree = ast.parse(inspect.getsource(module))
    statements = (node for node in ast.walk(tree) if isinstance(node, (ast.Import, ast.ImportFrom)))
    return {alias.asname or alias.name for statement in statements for alias in statement.names}


def _has_attribute(value: Any, name: str) -> bool:
    annotated = any(name in vars(base).get("__annotations__", {}) for base in value.__mro__)
    return annotated or hasattr(value, name) or f"self.{name}" in inspect.getsource(value)


def _n_parameters(function: Any) -> int:
    parameters = inspect.signature(inspect.unwrap(getattr(function, "__func__", function))).parameters
    return sum(name not in ("self", "cls") for name in parameters)


def _split(text: str, separator: str) -> list[str]:
    """Split where no bracket is open."""
    parts, depth = [""], 0
    for piece in re.split(f"({re.escape(separator)})", text):
        if piece == separator and depth == 0:
            parts.append("")
        else:
            parts[-1] += piece
            depth += sum(piece.count(sign) for sign in "([{") - sum(piece.count(sign) for sign in ")]}")
    return parts


if __name__ == "__main__":
    if sys.argv[1:]:
        print("\n".join(line for name in sys.argv[1:] for line in problems(name)))
    else:
        print("\n".join(name for name in MODULES if problems(name)))

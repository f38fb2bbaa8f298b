"""Sphinx extension: one page for each package of the library, from the docstrings of its modules.

The code is read, not imported: that takes a fifth of the time, and shows parts that are not installed.
"""

from __future__ import annotations

import ast
import copy
import re
from collections.abc import Iterator
from pathlib import Path
from textwrap import indent
from typing import Any

from sphinx.ext.napoleon import Config
from sphinx.ext.napoleon.docstring import NumpyDocstring

import hicp_lib

FOLDER = "api"
_STYLE = Config(napoleon_use_param=False, napoleon_use_rtype=False, napoleon_use_ivar=True)
_SEVERAL = re.compile(r"^(\w+(?:, \w+)+) : (.*\n?)", re.MULTILINE)
_SECTION = re.compile(r"^(Parameters|Returns|Yields)\n-+$", re.MULTILINE)


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx; before the table of contents is read, at 900."""
    app.connect("config-inited", _write_pages, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _write_pages(app: Any, config: Any) -> None:
    """Into the book's source, where it has a page that leads to them."""
    source = Path(app.srcdir)
    if not (source / f"{FOLDER}.md").is_file():
        return
    config.default_role = "literal"  # in docstrings; Markdown has none
    config.toc_object_entries = False  # each would be copied into every page
    (source / FOLDER).mkdir()
    for package, text in pages(Path(hicp_lib.__file__).parent).items():
        (source / FOLDER / f"{package}.rst").write_text(text, encoding="utf-8")


def pages(library: Path) -> dict[str, str]:
    """The page of every package, in reStructuredText, by the package's name."""
    found: dict[str, list[str]] = {}
    for path in sorted(library.rglob("*.py")):
        package = path.relative_to(library).parts[0]
        tree = ast.parse(path.read_bytes())
        if path.parent != library and (path.name != "__init__.py" or any(_public(tree.body))):
            module = ".".join(path.relative_to(library.parent).with_suffix("").parts)
            parts = found.setdefault(package, [_heading(package, "=")])
            parts.append(_module(module.removesuffix(".__init__"), tree))
    return {package: "\n".join(parts) for package, parts in found.items()}


def _module(name: str, tree: ast.Module) -> str:
    heading = _heading(name.removeprefix("hicp_lib."), "-")
    parts = [heading, f".. py:module:: {name}\n", _docstring(tree, "module")]
    return "\n".join([*parts, *(_described(node) for node in _public(tree.body))])


def _described(node: ast.FunctionDef | ast.ClassDef, kind: str = "function") -> str:
    """The directive of a function or class, with the methods of a class within."""
    if isinstance(node, ast.ClassDef):
        kind, signature = "class", _class_signature(node)
        inner = "\n".join(_described(method, "method") for method in _public(node.body))
    else:
        if any(ast.unparse(decorator).endswith("property") for decorator in node.decorator_list):
            kind = "property"
        signature, inner = _signature(node, bound=kind != "function"), _hints(node)
    head = f".. py:{kind}:: {node.name}{'' if kind == 'property' else signature}\n\n"
    return head + indent(f"{_docstring(node, kind)}\n{inner}", "   ")


def _public(body: list[ast.stmt]) -> Iterator[ast.FunctionDef | ast.ClassDef]:
    for node in body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith("_"):
            yield node


def _signature(node: ast.FunctionDef, bound: bool) -> str:
    """Parameters with their defaults; the docstring tells the types, or `_hints`."""
    arguments = copy.deepcopy(node.args)
    if bound and not any(ast.unparse(name) == "staticmethod" for name in node.decorator_list):
        del (arguments.posonlyargs or arguments.args)[0]
    for argument in ast.walk(arguments):
        if isinstance(argument, ast.arg):
            argument.annotation = None
    return f"({ast.unparse(arguments)})"


def _hints(node: ast.FunctionDef) -> str:
    """Types of the parameters and of what is returned, where no section of the docstring tells them."""
    if _SECTION.search(ast.get_docstring(node) or ""):
        return ""
    arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
    typed = [f"{one.arg}: {ast.unparse(one.annotation)}" for one in arguments if one.annotation]
    if node.returns and ast.unparse(node.returns) != "None":
        typed.append(f"returns {ast.unparse(node.returns)}")
    return "".join(f"| ``{one}``\n" for one in typed)


def _class_signature(node: ast.ClassDef) -> str:
    """That of its `__init__`, or the fields of a dataclass."""
    for member in node.body:
        if isinstance(member, ast.FunctionDef) and member.name == "__init__":
            return _signature(member, bound=True)
    fields = [ast.unparse(member.target) for member in node.body if isinstance(member, ast.AnnAssign)]
    return f"({', '.join(fields)})" if fields else ""


def _docstring(node: ast.Module | ast.ClassDef | ast.FunctionDef, kind: str) -> str:
    text = ast.get_docstring(node) or ""
    if isinstance(node, ast.ClassDef):  # where each attribute has a field of its own
        text = _SEVERAL.sub(lambda found: "".join(f"{n} : {found[2]}" for n in found[1].split(", ")), text)
    return f"{NumpyDocstring(text, _STYLE, what=kind)}\n"


def _heading(text: str, line: str) -> str:
    return f"{text}\n{line * len(text)}\n"

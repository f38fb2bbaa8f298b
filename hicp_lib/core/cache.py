"""Keys of cached results: the code that makes a result, its data, the libraries it calls, its inputs.

The code is found automatically: every module of the library that the entry points import, anywhere in their
code, or name in a string of its own, and what these import in turn (the *import closure*). A module that
moves, or a new import, becomes part of the key without further work.
"""

import ast
import importlib.metadata
import json
import re
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from hicp_lib.core.datafiles import DATA_DIR, REFERENCE_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import sha256_bytes, sha256_file

LIBRARY_DIR = Path(__file__).resolve().parents[1]

# Distributions whose name differs from that of the imported package; of several, the installed one counts.
_DISTRIBUTIONS = {
    "bs4": ("beautifulsoup4",),
    "PIL": ("pillow",),
    "cv2": ("opencv-python-headless", "opencv-python", "opencv-contrib-python"),
    "google": ("protobuf",),
    "open3d": ("open3d-cpu", "open3d"),
    "pinocchio": ("pin",),
}
_NAMED = re.compile(r'"(hicp_lib(?:\.\w+)+)"')  # modules that are imported by name, or run as programs
_IMPORT = re.compile(r"^\s*from [\w.]+ import (?:\([^)]*\)|.*)$", re.MULTILINE)
_DATA = re.compile(r'\bDATA_DIR\b(?:\s*/\s*"([^"]+)")?')
ALL_DATA = "**/*"
_PARSING = threading.Lock()


@dataclass(frozen=True)
class Code:
    """What the results of some entry points depend on, besides their inputs.

    Attributes
    ----------
    modules, data : dict of str to str
        SHA-256 by module name, and by path below `data/`.
    libraries : dict of str to str
        Version by name, of every other library that one of the modules imports; "absent" where it is not
        installed.
    """

    modules: dict[str, str]
    data: dict[str, str]
    libraries: dict[str, str]


@dataclass(frozen=True)
class _Module:
    sha256: str
    imports: frozenset[str]
    data: frozenset[str]


def key(entry_points: Sequence[Callable | str], *, without: Sequence[str] = (), **inputs: Any) -> str:
    """SHA-256 of everything a result depends on.

    Parameters
    ----------
    entry_points : sequence of callable or str
        What makes the result, or its module's name. All code that the modules import, directly or indirectly,
        is part of the key.
    without : sequence of str
        Names of modules to leave out: their effect on the result is described by `inputs`.
    **inputs : any
        The code's inputs, under any names: plain values, arrays, tables, dataclasses of these; of a path, the
        names, sizes and modification times of its files are used.

    Raises
    ------
    TypeError
        For an input of an unsupported type.

    Examples
    --------
    >>> one = key([sha256_bytes], n_frames=3)
    >>> one == key([sha256_bytes], n_frames=3), one == key([sha256_bytes], n_frames=4)
    (True, False)
    """
    names = sorted({entry if isinstance(entry, str) else entry.__module__ for entry in entry_points})
    return digest([asdict(running_code(tuple(names), tuple(without))), content(inputs)])


@cache  # a process runs the code that it loaded first, even if the files change
def running_code(names: tuple[str, ...], without: tuple[str, ...] = ()) -> Code:
    """As `code`, for the code that this process runs."""
    return code(names, without)


def code_identity(*names: str) -> dict[str, Any]:
    """A short identity of modules as this process runs them, for cache keys.

    Parameters
    ----------
    *names : str

    Examples
    --------
    >>> sorted(code_identity("hicp_lib.core.errors"))
    ['code', 'libraries']
    """
    found = running_code(tuple(sorted(set(names))))
    return {"code": [digest(found.modules), digest(found.data)], "libraries": found.libraries}


def code(names: Iterable[str], without: Sequence[str] = ()) -> Code:
    """The import closure of modules of the library, with the data and the libraries it uses.

    Parameters
    ----------
    names : iterable of str
        Modules; one that is not part of this library counts as another library.
    without : sequence of str
        Modules to leave out, together with what only they import.

    Raises
    ------
    InputError
        If data that the code names are missing.

    Examples
    --------
    >>> sorted(code(["hicp_lib.core.errors"]).modules)
    ['hicp_lib', 'hicp_lib.core', 'hicp_lib.core.errors']
    """
    waiting, modules, others = list(names), {}, set()
    while waiting:
        name = waiting.pop()
        if name in modules or name in without:
            continue
        path = _path(name)
        if path is not None:
            modules[name] = _read(path, *_state(path))
            waiting += [name.rpartition(".")[0], *modules[name].imports]
        elif name.startswith("hicp_lib."):
            waiting.append(name.rpartition(".")[0])  # a name inside a module
        elif name:
            others.add(name.partition(".")[0])
    patterns = frozenset().union(*(module.data for module in modules.values()))
    return Code(
        # Sorted, since keys depend on their order, and that of a set differs from process to process.
        {name: modules[name].sha256 for name in sorted(modules)},
        _data_sha256(patterns),
        {name: _version(name) for name in sorted(others - sys.stdlib_module_names)},
    )


def imports_of(source: str | bytes) -> frozenset[str]:
    """Names that Python code imports, anywhere in it, except imports for type checks only.

    Examples
    --------
    >>> sorted(imports_of("import os.path\\nfrom json import loads"))
    ['json', 'json.loads', 'os.path']
    """
    return frozenset(_imported(syntax_tree(source)))


def syntax_tree(source: str | bytes) -> ast.Module:
    """As `ast.parse`, one thread at a time: it fails if a callback of the garbage collector switches threads.

    Examples
    --------
    >>> len(syntax_tree("a = 1").body)
    1
    """
    with _PARSING:
        return ast.parse(source)


def content(value: Any) -> Any:
    """A JSON-able value that differs whenever the given value differs.

    Parameters
    ----------
    value : any
        As inputs of `key`.

    Returns
    -------
    Any

    Raises
    ------
    TypeError
        For a value whose content is not known.
    """
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        if value.dtype.hasobject:
            return content(value.tolist())
        return [str(value.dtype), value.shape, sha256_bytes(np.ascontiguousarray(value).tobytes())]
    if isinstance(value, Path):
        state = value.stat()
        return input_sha256(value) if value.is_dir() else [value.name, state.st_size, state.st_mtime_ns]
    if isinstance(value, Mapping):
        return [[content(name), content(item)] for name, item in value.items()]
    if isinstance(value, Sequence):
        return [content(item) for item in value]
    if isinstance(value, set | frozenset):
        return sorted(map(content, value))
    if is_dataclass(value):
        return [type(value).__name__, {f.name: content(getattr(value, f.name)) for f in fields(value)}]
    if type(value).__name__ == "DataFrame":
        return _table_content(value)
    raise TypeError(f"the content of {type(value).__name__} is not known; no result of it can be cached")


def digest(value: Any) -> str:
    """SHA-256 of a JSON-able value, independent of the order of its keys.

    Examples
    --------
    >>> digest({"a": 1, "b": 2}) == digest({"b": 2, "a": 1})
    True
    """
    return sha256_bytes(json.dumps(value, sort_keys=True, ensure_ascii=False).encode())


def files_sha256(paths: Iterable[Path], base: Path) -> str:
    """One SHA-256 over the names (relative to `base`) and contents of files, independent of their order.

    Raises
    ------
    InputError
        If there are none: the hash of nothing would make different results look equal.
    """
    hashes = {path.relative_to(base).as_posix(): sha256_file(path) for path in paths}
    if not hashes:
        raise InputError(f"{base}: the files that a result depends on are missing; reinstall hicp")
    return digest(hashes)


def input_sha256(path: Path) -> str:
    """Identity of an input: a file's content, or a folder's file names, sizes and modification times.

    A folder of images is not read: hashing gigabytes on every call would cost more than it protects.

    Raises
    ------
    InputError
        If it is neither, or links in the folder form a cycle.
    """
    if path.is_file():
        return sha256_file(path)
    if not path.is_dir():
        raise InputError(f"{path}: is neither a file nor a folder; name one of them")
    states = [(p.relative_to(path).as_posix(), p.stat()) for p in sorted(files_below(path))]
    return digest([[name, state.st_size, state.st_mtime_ns] for name, state in states])


def files_below(folder: Path, above: frozenset[Path] = frozenset()) -> Iterator[Path]:
    """Every file in a folder and its subfolders, following links.

    Parameters
    ----------
    folder : Path
    above : frozenset of Path
        The folders it lies in, links resolved.

    Yields
    ------
    Path

    Raises
    ------
    InputError
        If a link leads to a folder that it lies in.
    """
    here = folder.resolve()
    if here in above:
        raise InputError(f"{folder}: leads to a folder that it lies in; remove the link")
    for path in folder.iterdir() if folder.is_dir() else ():
        if path.is_dir():
            yield from files_below(path, above | {here})
        elif path.is_file():
            yield path


def _path(name: str) -> Path | None:
    """The file of a module of the library; None if there is no such module."""
    parts = name.split(".")
    if parts[0] != "hicp_lib":
        return None
    path = LIBRARY_DIR.joinpath(*parts[1:])
    file = path / "__init__.py" if path.is_dir() else path.with_name(f"{path.name}.py")
    return file if file.is_file() else None


@cache
def _read(path: Path, *state: int) -> _Module:
    """A module's file, by its `_state`."""
    source = path.read_bytes()
    names = imports_of(source) | set(_NAMED.findall(source.decode()))
    data = frozenset(name or ALL_DATA for name in _DATA.findall(_IMPORT.sub("", source.decode())))
    if path.name in ("datafiles.py", "cache.py"):  # define and search the folder, and name no file of it
        data = frozenset()
    return _Module(sha256_bytes(source), names, data)


def _imported(tree: ast.AST) -> Iterator[str]:
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.ImportFrom):
            yield str(node.module)
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            yield from _imported(ast.Module(node.orelse, []))
        elif not isinstance(node, ast.expr):
            yield from _imported(node)


def _data_sha256(patterns: Iterable[str]) -> dict[str, str]:
    paths, reference = set[Path](), DATA_DIR / REFERENCE_DIR.name
    for pattern in patterns:
        found = [path for path in DATA_DIR.glob(pattern) if path.is_file() and reference not in path.parents]
        if not found:
            raise InputError(f"{DATA_DIR / pattern}: is missing, and a result depends on it; reinstall hicp")
        paths.update(found)
    return {p.relative_to(DATA_DIR).as_posix(): _file_sha256(p, *_state(p)) for p in sorted(paths)}


def _state(path: Path) -> tuple[int, int]:
    """What changes when a file is rewritten."""
    state = path.stat()
    return state.st_mtime_ns, state.st_size


@cache
def _file_sha256(path: Path, *state: int) -> str:
    return sha256_file(path)


@cache
def _version(name: str) -> str:
    for distribution in _DISTRIBUTIONS.get(name, (name,)):
        try:
            return importlib.metadata.version(distribution)
        except importlib.metadata.PackageNotFoundError:
            pass
    return "absent"


def _table_content(table: Any) -> list:
    from pandas.util import hash_pandas_object  # takes long to load, and is there already if it is a table

    hashes = hash_pandas_object(table).to_numpy()
    return [[str(name), str(kind)] for name, kind in table.dtypes.items()] + [sha256_bytes(hashes.tobytes())]

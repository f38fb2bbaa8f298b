"""Mutation testing: change operators and constants at random; a package's own tests must fail.

    make mutants MUTANTS_ARGS="--n 60 --seed 1"

Every mutant is one change in a copy of the checkout, where only the tests of its package run, to the first
that fails. Surviving mutants are printed. Mutants without an observable effect are listed, each with its
reason, in `tools/equivalent_mutants.toml`, and are not sampled. Exits with 1 below `FLOORS`.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

CHECKOUT = Path(__file__).resolve().parents[1]
EQUIVALENT = "tools/equivalent_mutants.toml"
PACKAGES = ("evaluation", "formats", "lifting", "mocap", "recordings", "robot", "study/claims")
FLOORS = {"operator": 0.9, "constant": 0.8}
LIMIT_FACTOR, LIMIT_S = 5, 60  # a mutant that takes this much longer than the unchanged code is noticed

_SWAPS = {
    ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "*"), ast.Mod: ("%", "*"), ast.Pow: ("**", "*"),
    ast.BitAnd: ("&", "|"), ast.BitOr: ("|", "&"),
    ast.Lt: ("<", "<="), ast.LtE: ("<=", "<"), ast.Gt: (">", ">="), ast.GtE: (">=", ">"),
    ast.Eq: ("==", "!="), ast.NotEq: ("!=", "=="),
    ast.Is: ("is", "is not"), ast.IsNot: ("is not", "is"),
    ast.In: ("in", "not in"), ast.NotIn: ("not in", "in"),
    ast.And: ("and", "or"), ast.Or: ("or", "and"),
}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """One change: the bytes from `start` to `end` of a file become `new`."""

    file: str
    kind: str
    start: int
    end: int
    line: int
    text: str
    old: str
    new: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.old} -> {self.new or 'nothing'}    {self.text}"

    def applied(self, source: bytes) -> bytes:
        """The file's content with the change."""
        return source[: self.start] + self.new.encode() + source[self.end :]


def mutants(path: Path, file: str) -> Iterator[Mutant]:
    """All changes of operators and numbers of a module, but those in type hints."""
    source = path.read_bytes()
    lines = source.splitlines(keepends=True)
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line))

    def mutant(kind: str, start: int, old: str, new: str) -> Mutant:
        number = source.count(b"\n", 0, start) + 1
        text = lines[number - 1].decode().strip()
        return Mutant(file, kind, start, start + len(old.encode()), number, text, old, new)

    def begin(node: ast.expr) -> int:
        return starts[node.lineno - 1] + node.col_offset

    def end(node: ast.expr) -> int:
        return starts[node.end_lineno - 1] + node.end_col_offset

    def between(left: ast.expr, operator: ast.AST, right: ast.expr) -> Iterator[Mutant]:
        if type(operator) in _SWAPS:
            old, new = _SWAPS[type(operator)]
            at = source.find(old.encode(), end(left), begin(right))
            if at >= 0:  # not where `not in` is broken over lines
                yield mutant("operator", at, old, new)

    for node in _evaluated(ast.parse(source)):
        if isinstance(node, ast.BinOp):
            yield from between(node.left, node.op, node.right)
        elif isinstance(node, ast.BoolOp):
            for left, right in zip(node.values, node.values[1:], strict=False):
                yield from between(left, node.op, right)
        elif isinstance(node, ast.Compare):
            for left, operator, right in zip(
                [node.left, *node.comparators], node.ops, node.comparators, strict=False
            ):
                yield from between(left, operator, right)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.Not)):
            yield mutant("operator", begin(node), "-" if isinstance(node.op, ast.USub) else "not ", "")
        elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
            old = source[begin(node) : end(node)].decode()
            yield mutant("constant", begin(node), old, _other_number(node.value))


def _other_number(value: int | float) -> str:
    return str(value + 1) if isinstance(value, int) else repr(value * 1.5 if value else 1.0)


def _evaluated(tree: ast.AST) -> Iterator[ast.AST]:
    """All nodes but type hints, which nothing evaluates, and what is looked at for type checks alone."""
    hints = {"annotation", "returns"}
    for name, value in ast.iter_fields(tree):
        for node in value if isinstance(value, list) else [value]:
            if isinstance(node, ast.AST) and name not in hints:
                yield node
                yield from _evaluated(node)


def all_mutants(checkout: Path, packages: list[str]) -> list[Mutant]:
    """Those of all modules of the packages, in order, without the equivalent ones."""
    named = tomllib.loads((checkout / EQUIVALENT).read_text()).get("mutant", [])
    equivalent = {(entry["file"], entry["text"], entry["old"], entry["new"]) for entry in named}
    found = [
        mutant
        for package in packages
        for path in sorted((checkout / "hicp_lib" / package).rglob("*.py"))
        for mutant in mutants(path, path.relative_to(checkout).as_posix())
    ]
    known = {(mutant.file, mutant.text, mutant.old, mutant.new) for mutant in found}
    for entry in equivalent - known:
        if entry[0].startswith(tuple(f"hicp_lib/{package}/" for package in packages)):
            raise SystemExit(f"{EQUIVALENT}: there is no such mutant any more: {entry}")
    return [each for each in found if (each.file, each.text, each.old, each.new) not in equivalent]


def package_of(mutant: Mutant) -> str:
    """The package of `PACKAGES` whose tests must notice."""
    return next(package for package in PACKAGES if mutant.file.startswith(f"hicp_lib/{package}/"))


class Copies:
    """Copies of the checkout, one for each mutant that is tried at a time, with a cache of their own."""

    def __init__(self, checkout: Path, folder: Path, n: int) -> None:
        listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        files = subprocess.run(listed, cwd=checkout, check=True, capture_output=True, text=True).stdout
        self.free: SimpleQueue[Path] = SimpleQueue()
        for i in range(n):
            for file in filter(None, files.split("\0")):
                if (checkout / file).is_file():
                    (folder / str(i) / file).parent.mkdir(parents=True, exist_ok=True)
                    shutil.copy(checkout / file, folder / str(i) / file)
            cache = folder / str(i) / "cache"
            cache.mkdir()
            weights = Path(os.environ.get("HICP_CACHE", Path.home() / ".cache" / "hicp")) / "weights"
            if weights.is_dir():
                (cache / "weights").symlink_to(weights)
            self.free.put(folder / str(i))

    def notices(self, mutant: Mutant | None, package: str, limit_s: float) -> bool:
        """Whether the package's tests fail with the mutant; of None: without one."""
        copy = self.free.get()
        path = copy / (mutant.file if mutant else "pyproject.toml")
        source = path.read_bytes()
        try:
            path.write_bytes(mutant.applied(source) if mutant else source)
            return _tests_fail(copy, package, limit_s)
        finally:
            path.write_bytes(source)
            self.free.put(copy)


def _tests_fail(copy: Path, package: str, limit_s: float) -> bool:
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
    environment = os.environ | {"PYTHONPATH": str(copy), "HICP_CACHE": str(copy / "cache")}
    environment["PYTHONDONTWRITEBYTECODE"] = "1"  # bytecode of a mutant as long and as old would be taken
    process = subprocess.Popen(
        [*command, f"tests/{package}"], cwd=copy, env=environment, start_new_session=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        status = process.wait(limit_s)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, 9)
        process.wait()
        return True
    if status not in (0, 1, 2):  # passed, failed, could not be imported
        raise SystemExit(f"tests/{package}: pytest ends with {status}; run it and see")
    return status != 0


def run(checkout: Path, chosen: list[Mutant], n_workers: int) -> dict[Mutant, bool]:
    """Mutant -> whether it was noticed."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder, ThreadPoolExecutor(n_workers) as pool:
        copies = Copies(checkout, Path(folder), n_workers)

        def base(package: str) -> float:
            start_s = time.perf_counter()
            if copies.notices(None, package, 3600):
                raise SystemExit(f"tests/{package}: fail without any change; mend them first")
            return max(LIMIT_S, LIMIT_FACTOR * (time.perf_counter() - start_s))

        packages = sorted({package_of(mutant) for mutant in chosen})
        limits_s = dict(zip(packages, pool.map(base, packages), strict=True))

        def one(mutant: Mutant) -> bool:
            noticed = copies.notices(mutant, package_of(mutant), limits_s[package_of(mutant)])
            print(f"{'noticed ' if noticed else 'SURVIVED'} {mutant}", flush=True)
            return noticed

        return dict(zip(chosen, pool.map(one, chosen), strict=True))


def summary(noticed: dict[Mutant, bool]) -> tuple[str, bool]:
    """A table of what was noticed, by package and kind, and whether it is enough."""
    lines, enough = [], True
    for kind, floor in FLOORS.items():
        results = {mutant: seen for mutant, seen in noticed.items() if mutant.kind == kind}
        for package in PACKAGES:
            seen = [seen for mutant, seen in results.items() if package_of(mutant) == package]
            if seen:
                lines.append(f"{kind:9} {package:14} {sum(seen):4} of {len(seen):4} noticed")
        share = sum(results.values()) / len(results) if results else 1.0
        lines.append(
            f"{kind:9} {'all':14} {sum(results.values()):4} of {len(results):4} noticed: {share:.0%}"
        )
        lines[-1] += f" (at least {floor:.0%})"
        enough &= share >= floor
    return "\n".join(lines), enough


def main(arguments: list[str], checkout: Path = CHECKOUT) -> int:
    """Draw, try, tell; 1 if too few were noticed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--n", type=int, default=200, help="mutants, half of them operators")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="tried at a time")
    parser.add_argument(
        "packages", nargs="*", metavar="PACKAGE", help=f"of {', '.join(PACKAGES)}; all if none"
    )
    options = parser.parse_args(arguments)
    if unknown := set(options.packages) - set(PACKAGES):
        parser.error(f"{', '.join(unknown)}: expected some of {', '.join(PACKAGES)}")
    found = all_mutants(checkout, options.packages or list(PACKAGES))
    draw = random.Random(options.seed)
    chosen = []
    for kind in FLOORS:
        of_kind = [mutant for mutant in found if mutant.kind == kind]
        print(f"{len(of_kind)} {kind}s")
        chosen += draw.sample(of_kind, min(options.n // len(FLOORS), len(of_kind)))
    text, enough = summary(run(checkout, chosen, options.workers))
    print(text)
    return 0 if enough else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

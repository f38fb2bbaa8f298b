"""What a built book promises: nothing loads from a network, every image has words."""

import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from bs4 import BeautifulSoup

from hicp_lib.core.environment import usable_cores
from hicp_lib.core.executor import run_jobs

# Attributes through which an element loads something by itself; links that a reader clicks are fine.
_LOADING = ("src", "srcset", "poster", "data")
_HARMLESS_LINKS = {
    "canonical", "author", "license", "index", "search", "next", "prev", "top", "copyright", "help",
}  # fmt: skip
_REMOTE = re.compile(r"\s*(https?:)?//", re.IGNORECASE)
_REMOTE_IN_CSS = re.compile(r"(url\(\s*['\"]?|@import\s+['\"])\s*(https?:)?//", re.IGNORECASE)
_LOADS = r"(import|importScripts|fetch|\.src\s*=|\.href\s*=)"
_LOADING_IN_SCRIPT = re.compile(_LOADS + r"\s*\(?\s*['\"`](https?:)?//")


def _page_problems(page: BeautifulSoup) -> Iterator[str]:
    for tag in page.find_all(True):
        given = {name: str(value) for name, value in tag.attrs.items()}
        if tag.name == "img" and _says_nothing(given.get("alt", "")):
            yield f"image without alt text: {given.get('src', '')[:60]}"
        is_moving = tag.name == "video" or "hicp-scene" in given.get("class", "")
        if is_moving and not given.get("aria-label", "").strip():
            yield "film or 3D scene without a description"
        is_harmless = _HARMLESS_LINKS.intersection(str(rel).lower() for rel in tag.get("rel") or ())
        loading = _LOADING if tag.name != "link" else () if is_harmless else ("href",)
        for name in loading:
            if _REMOTE.match(given.get(name, "")):
                yield f"loads from the network: <{tag.name} {name}={given[name][:80]}>"
        if _REMOTE_IN_CSS.search(given.get("style", "")):
            yield f"loads from the network: style of <{tag.name}>"
        if tag.name == "style" and _REMOTE_IN_CSS.search(tag.string or ""):
            yield "loads from the network: a style sheet inside the page"
        if tag.name == "script" and _LOADING_IN_SCRIPT.search(tag.string or ""):
            yield "loads from the network: a script inside the page"


def _says_nothing(alt: str) -> bool:
    """Empty, or the file's name, which is what Sphinx puts where a page gives no text."""
    return not alt.strip() or alt.lower().endswith((".png", ".svg", ".jpg", ".jpeg", ".gif", ".webp"))


def _judged(path: Path, finish: Callable[[BeautifulSoup, Path], None] | None) -> list[str]:
    page = BeautifulSoup(path.read_text(errors="replace"), "html.parser")
    if finish is not None:
        finish(page, path)
        path.write_text(str(page))
    return list(_page_problems(page))


def book_problems(folder: Path, finish: Callable[[BeautifulSoup, Path], None] | None = None) -> list[str]:
    """What in a built book needs a network or lacks words, one line each; empty when it is sound.

    Parameters
    ----------
    folder : Path
        Of the built pages; all HTML and CSS files in it are read.
    finish : callable, optional
        Changes a page before it is judged; takes what was read of it, and its path. A function of a module,
        or a partial of one: pages are read side by side.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "index.html").write_text('<img src="https://a.org/b.png" alt="A bird">')
    ...     book_problems(Path(folder))
    ['index.html: loads from the network: <img src=https://a.org/b.png>']
    """
    pages = sorted(folder.rglob("*.html"))
    found = dict(run_jobs([(path, partial(_judged, path, finish)) for path in pages], usable_cores()))
    problems = [f"{path.relative_to(folder)}: {problem}" for path in pages for problem in found[path]]
    for path in sorted(folder.rglob("*.css")):
        if _REMOTE_IN_CSS.search(path.read_text(errors="replace")):
            problems.append(f"{path.relative_to(folder)}: loads from the network")
    return problems

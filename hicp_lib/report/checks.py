"""What a built book promises: nothing loads from a network, every image has words."""

import re
from html.parser import HTMLParser
from pathlib import Path

# Attributes through which an element loads something by itself; links that a reader clicks are fine.
_LOADING = ("src", "srcset", "poster", "data")
_HARMLESS_LINKS = {
    "canonical", "author", "license", "index", "search", "next", "prev", "top", "copyright", "help",
}  # fmt: skip
_REMOTE = re.compile(r"\s*(https?:)?//", re.IGNORECASE)
_REMOTE_IN_CSS = re.compile(r"(url\(\s*['\"]?|@import\s+['\"])\s*(https?:)?//", re.IGNORECASE)
_LOADS = r"(import|importScripts|fetch|\.src\s*=|\.href\s*=)"
_LOADING_IN_SCRIPT = re.compile(_LOADS + r"\s*\(?\s*['\"`](https?:)?//")


class _Page(HTMLParser):
    """Collects the problems of one page."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.problems: list[str] = []
        self._inside = ""

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attributes}
        self._inside = tag
        if tag == "img" and _says_nothing(given.get("alt", "")):
            self.problems.append(f"image without alt text: {given.get('src', '')[:60]}")
        is_moving = tag == "video" or "hicp-scene" in given.get("class", "")
        if is_moving and not given.get("aria-label", "").strip():
            self.problems.append("film or 3D scene without a description")
        is_harmless = set(given.get("rel", "").lower().split()) & _HARMLESS_LINKS
        loading = _LOADING if tag != "link" else () if is_harmless else ("href",)
        for name in loading:
            if _REMOTE.match(given.get(name, "")):
                self.problems.append(f"loads from the network: <{tag} {name}={given[name][:80]}>")
        if _REMOTE_IN_CSS.search(given.get("style", "")):
            self.problems.append(f"loads from the network: style of <{tag}>")

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""

    def handle_data(self, data: str) -> None:
        if self._inside == "style" and _REMOTE_IN_CSS.search(data):
            self.problems.append("loads from the network: a style sheet inside the page")
        if self._inside == "script" and _LOADING_IN_SCRIPT.search(data):
            self.problems.append("loads from the network: a script inside the page")


def _says_nothing(alt: str) -> bool:
    """Empty, or the file's name, which is what Sphinx puts where a page gives no text."""
    return not alt.strip() or alt.lower().endswith((".png", ".svg", ".jpg", ".jpeg", ".gif", ".webp"))


def book_problems(folder: Path) -> list[str]:
    """What in a built book needs a network or lacks words, one line each; empty when it is sound.

    Parameters
    ----------
    folder : Path
        Of the built pages; all HTML and CSS files in it are read.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "index.html").write_text('<img src="https://a.org/b.png" alt="A bird">')
    ...     book_problems(Path(folder))
    ['index.html: loads from the network: <img src=https://a.org/b.png>']
    """
    problems = []
    for path in sorted(folder.rglob("*.html")):
        page = _Page()
        page.feed(path.read_text(errors="replace"))
        problems += [f"{path.relative_to(folder)}: {problem}" for problem in page.problems]
    for path in sorted(folder.rglob("*.css")):
        if _REMOTE_IN_CSS.search(path.read_text(errors="replace")):
            problems.append(f"{path.relative_to(folder)}: loads from the network")
    return problems

"""What a built page is given beyond Sphinx: less to load, and names for what has none."""

import re
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Any

from bs4 import BeautifulSoup
from PIL import Image

_ICON = re.compile(r'[{,]"?([a-z][a-z0-9-]*)"?:\[(\d+),(\d+),\[[^\]]*\],"\w+","([^"]+)"\]')
# Scripts of the theme that need not run before a page is drawn.
_CAN_WAIT = re.compile(
    r"doctools|sphinx_highlight|clipboard|copybutton|book-theme\.js|toggle\w+\.js|design-tabs"
)
# What writes an icon as a letter of a font.
_LETTERS = re.compile(r"\.fa-[\w-]+:+before(,\.fa-[\w-]+:+before)*\{content:[^{}]*\}")


def drop_icon_font(book: Path) -> None:
    """Take the letters of two thousand icons from the style sheet that all pages load and none uses."""
    sheet = book / "_static" / "styles" / "pydata-sphinx-theme.css"
    sheet.write_text(_LETTERS.sub("", sheet.read_text()))


def finish_page(page: BeautifulSoup, path: Path, book: Path) -> None:
    """Change a page of a built book in place.

    Parameters
    ----------
    page : BeautifulSoup
    path : Path
        Where it lies; the files that it shows lie there already.
    book : Path
    """
    # The theme loads the search on every page, and a megabyte for a dozen icons, which become drawings.
    searches = path.name == "search.html"  # its scripts use those before them
    unused = "fontawesome" + ("" if searches else "|searchindex|searchtools|language_data")
    unused += "" if page.find(class_=re.compile("^sd-")) else "|sphinx-design"
    for tag in page.find_all(["script", "link"]):
        address = str(tag.get("src") or tag.get("href"))
        if re.search(unused, address) or tag.get("rel") == ["preload"]:
            tag.decompose()
        elif not searches and _CAN_WAIT.search(address):
            tag["defer"] = ""
    for icon in page.find_all("i", class_=re.compile("^fa-")):
        _draw(page, icon, book / "_static" / "scripts" / "fontawesome.js")
    n_named = Counter(str(tag["id"]) for tag in page.find_all(id=True))
    for figure in page.find_all("figure", class_="hicp"):
        if n_named[str(figure.get("id"))] > 1:
            del figure["id"]  # a heading has it, and is a line above
        _show_file(page, figure, path.parent)
    for table in page.find_all("table"):
        _name(page, table)
    for summary in page.find_all(lambda tag: tag.name == "summary" and tag.find(class_="toctree-toggle")):
        summary["aria-label"] = "Pages within"
    if sidebar := page.find(id="pst-primary-sidebar"):
        sidebar.attrs |= {"role": "complementary", "aria-label": "Book"}


@cache
def _icons(script: Path) -> dict[str, list[str]]:
    """Width, height and path by name."""
    return {name: of for name, *of in _ICON.findall(script.read_text())}


def _draw(page: BeautifulSoup, icon: Any, script: Path) -> None:
    drawings = _icons(script)
    width, height, path = next(filter(None, (drawings.get(name[3:]) for name in icon["class"])))  # fa-NAME
    icon.name, icon["class"] = "svg", ["svg-inline--fa", *icon["class"]]
    icon.attrs |= {"viewBox": f"0 0 {width} {height}", "aria-hidden": "true"}
    icon.append(page.new_tag("path", attrs={"fill": "currentColor", "d": path}))


def _show_file(page: BeautifulSoup, figure: Any, folder: Path) -> None:
    """The file that lies beside the page in place of the copy within, and in full when asked for."""
    shown, link = figure.find("img"), figure.find("a", download=True)
    if shown is not None and link is not None:
        shown["src"] = link["href"]
    if shown is None or shown["src"].startswith("data:"):
        return
    file = folder / shown["src"]
    with Image.open(file) as image:
        shown.attrs |= dict(zip(("width", "height"), image.size, strict=True)) | {"loading": "lazy"}
    kind = "hicp-zoom" + " hicp-chart" * file.with_suffix(".svg").is_file()
    shown.wrap(page.new_tag("a", attrs={"class": kind, "href": shown["src"], "title": "Enlarge"}))


def _name(page: BeautifulSoup, table: Any) -> None:
    """A caption for those who hear the page: that of its figure, or the heading above it."""
    figure = table.find_parent("figure")
    named = figure.figcaption if figure else table.find_previous(["h1", "h2", "h3", "summary"])
    if table.caption is None and named is not None:
        words = named.contents[0].get_text()
        table.insert(0, page.new_tag("caption", attrs={"class": "visually-hidden"}, string=words))
    if table.parent.get("class") not in (["hicp-table"], ["pst-scrollable-table-container"]):
        table.wrap(page.new_tag("div", attrs={"class": "hicp-table"}))
    for empty in table.find_all("th"):
        if not empty.get_text(strip=True):
            empty.name = "td"

"""What a built page is given beyond Sphinx: less to load, code folded away, names for what has none."""

import re
from functools import cache
from pathlib import Path

from bs4 import BeautifulSoup, Tag
from PIL import Image

# What the theme loads on every page -> what a page holds that needs it.
_LOADED_FOR = {
    "fontawesome.js": "<fontawesome>",  # a megabyte for a dozen icons: they are put in as drawings
    "searchindex.js": 'id="search-results"',
    "searchtools.js": 'id="search-results"',
    "language_data.js": 'id="search-results"',
    "sphinx-design": 'class="sd-',
}
_SHOWN_CODE = {"tag_look-inside", "tag_try-it"}
_FOLDED = {"tag_parameters": "Parameters", "tag_injected-parameters": "Parameters of this run"}
_ICON = re.compile(r'[{,]"?([a-z][a-z0-9-]*)"?:\[(\d+),(\d+),\[[^\]]*\],"\w+","([^"]+)"\]')


def finish_page(page: BeautifulSoup, path: Path, book: Path) -> None:
    """Change a page of a built book in place.

    Parameters
    ----------
    page : BeautifulSoup
    path : Path
        Where it lies; the files that it shows lie there already.
    book : Path
    """
    text = str(page)
    unused = [name for name, sign in _LOADED_FOR.items() if sign not in text]
    for tag in page.find_all(["script", "link"]):
        if any(name in str(tag.get("src") or tag.get("href")) for name in unused):
            tag.decompose()
    for icon in page.find_all("i", class_=re.compile("^fa-")):
        _draw(icon, book / "_static" / "scripts" / "fontawesome.js")
    for figure in page.find_all("figure", class_="hicp"):
        _show_file(page, figure, path.parent)
    for source in page.find_all("div", class_="cell_input"):
        _fold(page, source)
    for table in page.find_all("table"):
        _name(page, table)
    for summary in page.find_all("summary"):
        if not summary.get_text(strip=True):
            summary["aria-label"] = "Pages within"
    if sidebar := page.find(id="pst-primary-sidebar"):
        sidebar.attrs |= {"role": "complementary", "aria-label": "Book"}


@cache
def _icons(script: Path) -> dict[str, list[str]]:
    """Width, height and path by name."""
    return {name: of for name, *of in _ICON.findall(script.read_text())}


def _draw(icon: Tag, script: Path) -> None:
    drawings = _icons(script)
    names = [name.removeprefix("fa-") for name in icon["class"]]
    width, height, path = next(drawings[name] for name in names if name in drawings)
    icon.name = "svg"
    icon.attrs |= {"class": ["svg-inline--fa", *icon["class"]], "viewBox": f"0 0 {width} {height}"}
    icon.attrs |= {"aria-hidden": "true"}
    icon.append(BeautifulSoup(f'<path fill="currentColor" d="{path}"></path>', "html.parser"))


def _show_file(page: BeautifulSoup, figure: Tag, folder: Path) -> None:
    """The file that lies beside the page in place of the copy within, and in full when asked for."""
    shown, link = figure.find(["img", "video"]), figure.find("a", download=True)
    if shown is None:
        return
    if link is not None:
        shown["src"] = link["href"]
    if shown.name == "video" or shown["src"].startswith("data:"):
        return
    with Image.open(folder / shown["src"]) as image:
        width_px, height_px = image.size
    shown.attrs |= {"width": width_px, "height": height_px, "loading": "lazy"}
    shown.wrap(page.new_tag("a", attrs={"class": "hicp-zoom", "href": shown["src"], "title": "Enlarge"}))


def _fold(page: BeautifulSoup, source: Tag) -> None:
    """Put a cell's code out of sight until it is asked for."""
    cell = source.find_parent("div", class_="cell")
    if _SHOWN_CODE.intersection(cell["class"]):
        return
    fold = source.find_parent("details")  # where the notebook says so itself
    if fold is None:
        fold = source.wrap(page.new_tag("details"))
    else:
        fold.summary.decompose()
    fold["class"] = "hicp-code"
    summary = page.new_tag("summary")
    summary.string = next((word for tag, word in _FOLDED.items() if tag in cell["class"]), "Code")
    fold.insert(0, summary)


def _name(page: BeautifulSoup, table: Tag) -> None:
    """A caption for those who hear the page: that of its figure, or the heading above it."""
    figure = table.find_parent("figure")
    named = figure.figcaption if figure else table.find_previous(["h1", "h2", "h3", "summary"])
    if table.caption is None and named is not None:
        caption = page.new_tag("caption", attrs={"class": "visually-hidden"})
        caption.string = named.contents[0].get_text()
        table.insert(0, caption)
    if table.parent.get("class") not in (["hicp-table"], ["pst-scrollable-table-container"]):
        table.wrap(page.new_tag("div", attrs={"class": "hicp-table"}))
    for empty in table.find_all("th"):
        if not empty.get_text(strip=True):
            empty.name = "td"

"""Names that are scripts: no page that is made with them executes one, in headless Chromium."""

from __future__ import annotations

import json

import pytest

from hicp_lib.cli import main as cli
from hicp_lib.report.build import make_report
from tests.hostile.good import make_good
from tests.report.conftest import library, study  # noqa: F401
from tests.report.tiny_study import FINISH, START, write_notebook

pytestmark = pytest.mark.browser

SCRIPTS = (
    "<svg onload=window.hacked=1>",
    "<img src=x onerror=window.hacked=1>",
    "</script><script>window.hacked=1</script>",
    "<script>window.hacked=1</script>",
    "\"' onmouseover=window.hacked=1 autofocus onfocus=window.hacked=1 x='\"",
    "[a](javascript:window.hacked=1)",
    "<a href=javascript:window.hacked=1>a</a>",
    "![a](x)`{=html}<script>window.hacked=1</script>`",
    "{raw:html}`<script>window.hacked=1</script>`",
    "a\n\n```{raw} html\n<script>window.hacked=1</script>\n```\n",
    "a\n\n```{include} /etc/passwd\n```\n",
    "{{ 7 * 191 }}{% raw %}",
    "$\\href{javascript:window.hacked=1}{x}$",
    "a|b`c\\`<svg onload=window.hacked=1>",
    "<!--", "<style>*{display:none}</style>", "<iframe srcdoc='<script>parent.hacked=1</script>'>",
)  # fmt: skip
# What would execute if it were clicked on or passed over, too.
LOOK = """
  const bad = [];
  for (const element of document.querySelectorAll("*")) {
    for (const attribute of element.attributes)
      if (attribute.name.startsWith("on") && attribute.value.includes("hacked")
          || /^\\s*javascript:/i.test(attribute.value) && attribute.value.includes("hacked"))
        bad.push(element.outerHTML.slice(0, 200));
    if (element.tagName === "SCRIPT" && /^\\s*(window|parent).hacked/.test(element.textContent))
      bad.push("script");
  }
  if (window.hacked !== undefined) bad.push("executed");
  return bad;
"""


# Said by the book's theme at every first visit.
OF_THE_THEME = "Got invalid theme mode"


def looked_at(browser, page) -> list:
    """What is executed or could be on a page, and what its console says."""
    browser.get_log("browser")
    browser.get(page.as_uri())
    found = browser.execute_script(LOOK)
    severe = [entry["message"] for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
    return found + [message for message in severe if OF_THE_THEME not in message]


def test_pages_of_detections_execute_no_name(browser, tmp_path):
    make_good(tmp_path / "good")
    annotations = json.loads((tmp_path / "good" / "annotations.json").read_text())
    pictures = tmp_path / "good" / "pictures"
    names = [text.replace("/", "\u2215").replace("\n", " ") + ".png" for text in SCRIPTS]
    image, person = annotations["images"][0], annotations["annotations"][0]
    annotations["images"] = [image | {"id": i, "file_name": name} for i, name in enumerate(names)]
    annotations["annotations"] = [person | {"id": i, "image_id": i} for i in range(len(names))]
    for name in names:
        (pictures / name).write_bytes((pictures / "a.png").read_bytes())
    truth, found = tmp_path / "<svg onload=window.hacked=1>.json", tmp_path / f"{names[1]}.json"
    truth.write_text(json.dumps(annotations))
    rows = [
        {"image_id": i, "category_id": 1, "score": 0.5, "keypoints": person["keypoints"]}
        for i in range(len(names))
    ]
    found.write_text(json.dumps(rows))
    out = tmp_path / "page.html"
    options = ["--detections", str(found), "--images", str(pictures), "--annotations", str(truth)]
    assert cli.run(["draw", *options, "--out", str(out)]) == 0
    assert looked_at(browser, out) == []
    text = browser.execute_script("return document.body.innerText")
    assert all(name.split()[0] in text for name in names), "names are shown as they are"


def test_books_execute_no_name(browser, study):  # noqa: F811
    """Names in tables, values, figures, parameters, and in what a page tells of its inputs."""
    cell = f"""import pandas as pd
texts = {list(SCRIPTS)!r}
table = pd.DataFrame({{"name": texts, texts[0]: texts}})
study.table("t", table, "Of " + " ".join(texts[:5]))
study.value("text", " ".join(texts))
study.value("texts", texts)"""
    parameters = f"seed = 0\nscale = 1.5\ndetectors = {list(SCRIPTS)!r}\nimages = {SCRIPTS[0]!r}"
    write_notebook(study / "notebooks" / "00_first.ipynb", START, cell, FINISH, parameters=parameters)
    home = study / "book" / "index.md"
    shown = '{{ value("00_first", "text") }}\n\n{{ rows("00_first", "t")[0] | join(", ") }}\n\n'
    shown += '{% for row in rows("00_first", "t") %}\n{{ row.values() | join(", ") }}\n\n{% endfor %}\n'
    home.write_text(f"# Home\n\n{shown}\nAll: {{{{ raw('00_first', 'texts') | join(', ') }}}}\n")
    page = make_report("quick", [], print, sources=study, root=study)
    for name in ("index.html", "notebooks/00_first.html"):
        assert looked_at(browser, page.parent / name) == []
        text = browser.execute_script("return document.body.innerText")
        assert "<svg onload=window.hacked=1>" in text and "1337" not in text and "root:" not in text

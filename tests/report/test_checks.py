"""The checks of a built book find what a network or a missing description would break."""

from __future__ import annotations

import pytest

from hicp_lib.report.checks import book_problems

SOUND = """<html><head><link rel="stylesheet" href="_static/a.css"><script src="_static/a.js"></script>
<link rel="canonical" href="https://example.org/"></head>
<body><a href="https://example.org">a link</a><img src="a.png" alt="A line."><p>see https://example.org</p>
<div class="hicp-scene" aria-label="Two points"></div><script>const url = "https://example.org";</script>
</body></html>"""


def test_a_sound_page_has_no_problem(tmp_path):
    (tmp_path / "index.html").write_text(SOUND)
    (tmp_path / "a.css").write_text("a { background: url(../b.png) } /* https://example.org */")
    assert book_problems(tmp_path) == []


@pytest.mark.parametrize(
    ("page", "problem"),
    [
        ("<img src=a.png>", "image without alt text: a.png"),
        ("<img src=a.png alt=' '>", "image without alt text"),
        ("<img src=_images/a.png alt=_images/a.png>", "image without alt text: _images/a.png"),
        ("<img src=_images/a.png alt='A.WEBP'>", "image without alt text: _images/a.png"),
        ("<div class='x hicp-scene'></div>", "3D scene without a description"),
        ("<video src='data:video/mp4;base64,A'></video>", "film or 3D scene without a description"),
        ("<script src='https://cdn.example/x.js'></script>", "loads from the network: <script src="),
        ("<script src='//cdn.example/x.js'></script>", "loads from the network"),
        ("<link rel=stylesheet href='http://x.example/a.css'>", "loads from the network: <link href="),
        ("<link rel='preload' as='font' href='https://x.example/a.woff'>", "loads from the network"),
        ("<img alt=a src='HTTPS://x.example/a.png'>", "loads from the network: <img src="),
        ("<iframe src='https://x.example'></iframe>", "loads from the network"),
        (
            "<video aria-label=a poster='https://x.example/a.jpg'></video>",
            "loads from the network: <video poster=",
        ),
        ("<img alt=a srcset='//x.example/a.png 2x'>", "loads from the network: <img srcset="),
        ("<object data='https://x.example/a.svg'></object>", "loads from the network: <object data="),
        ("<track src='https://x.example/a.vtt'>", "loads from the network: <track src="),
        ("<link rel='next stylesheets' href='//x.example/a.css'><img src=a.png>", "image without alt"),
        ("<p>url(https://x.example)</p><script src='//x.example/y.js'></script>", "<script src="),
        ("<style>a {}</style>@import 'https://x.example/a'<img src=a.png>", "image without alt"),
        ("<style>@import 'https://x.example/a.css';</style>", "a style sheet inside the page"),
        ("<p style='background: url(https://x.example/a.png)'>", "style of <p>"),
        ("<script>import('https://x.example/a.js')</script>", "a script inside the page"),
        ("<script>s.src = 'https://x.example/a.js'</script>", "a script inside the page"),
    ],
)
def test_each_fault_is_found(tmp_path, page, problem):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "page.html").write_text(f"<html><body>{page}</body></html>")
    problems = book_problems(tmp_path)
    assert len(problems) == 1
    assert problems[0].startswith("sub/page.html: ")
    assert problem in problems[0]


def test_style_sheets_are_read_too(tmp_path):
    (tmp_path / "a.css").write_text("@font-face { src: url('https://fonts.example/a.woff2') }")
    assert book_problems(tmp_path) == ["a.css: loads from the network"]

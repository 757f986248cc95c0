"""A page as a file that stands alone: nothing in it requests, sends or leads anywhere."""

import re
from html import unescape
from typing import Final

import pytest

from app.web.assets import Asset, Assets
from app.web.pages.standalone import MOST_PICTURE, stands_alone

NO_PICTURE: Final = '<p class="not-kept">No picture</p>'
FOLDER: Final = '<img data-folder="/static/abc123/pictures" alt="">'
SVG: Final = b"<svg/>"
ASSETS: Final = Assets(
    {
        "kiosk.css": Asset(
            b'@font-face{font-family:"A";src:url("fonts/a.woff2")}p{color:red}', "text/css"
        ),
        "pictures/arm 1.svg": Asset(SVG, "image/svg+xml"),
        "pictures/large.png": Asset(bytes(MOST_PICTURE + 1), "image/png"),
    },
    "abc123",
)
ROOT: Final = "/line1"
BASE: Final = f"{ROOT}/robots/left"


def made(inside: str) -> str:
    html = f"<!doctype html><html><head></head><body>{inside}</body></html>"
    return stands_alone(html, ASSETS, {"main", "more"}, BASE, "As shown <now>", "No picture")


@pytest.mark.parametrize(
    ("inside", "becomes"),
    [
        ("<p>text</p>", "<p>text</p>"),
        ("<script data-src='x'>alert('</p>')</script>", ""),
        ('<script type="application/json" id="page">{"a": 1}</script>', ""),
        ('<link rel="modulepreload" href="/static/x.js">', ""),
        ('<link rel="preload" href="/f.woff2" as="font" crossorigin>', ""),
        ('<link rel="expect" href="#more" blocking="render">', ""),
        ('<noscript><meta http-equiv="refresh" content="5; url=/pages/main"></noscript>', ""),
        ("<template><p>row</p></template>", ""),
        ("<noscript><b>Floor 2</b></noscript>", "<b>Floor 2</b>"),
        (
            f'<link rel="stylesheet" href="{ROOT}/static/abc123/kiosk.css">',
            "<style>p{color:red}</style>",
        ),
        (f'<link rel="stylesheet" href="{ROOT}/static/abc123/gone.css">', ""),
        ('<noscript><img src="/widgets/c/frame" alt=""></noscript>', NO_PICTURE),
        ('<img class="a" src="/widgets/m/map.png">', NO_PICTURE),
        ('<img src="https://elsewhere.example/x.png">', NO_PICTURE),
        ('<img src="/static/abc123/pictures/large.png">', NO_PICTURE),
        ('<img src="/static/abc123/pictures/gone.png">', NO_PICTURE),
        (
            '<img class="a" src="/static/abc123/pictures/arm%201.svg" alt="Arm">',
            '<img class="a" src="data:image/svg+xml;base64,PHN2Zy8+" alt="Arm">',
        ),
        ('<img src="data:image/png;base64,AA">', '<img src="data:image/png;base64,AA">'),
        (FOLDER, FOLDER),
        (f'<a class="t" href="{BASE}/pages/more">', '<a class="t" href="more.html">'),
        (f'<a href="{BASE}/pages/hidden">', "<a>"),
        (f'<a href="{ROOT}/robots/right/pages/more">', "<a>"),
        (f'<a href="{ROOT}/log?robot=left" class="t">', '<a class="t">'),
        ('<a href="https://elsewhere.example/pages/more">', "<a>"),
        ('<a href="#reasons">', '<a href="#reasons">'),
        ('<use class="end" href="#mark-0">', '<use class="end" href="#mark-0">'),
    ],
)  # fmt: skip
def test_a_part_of_a_page(inside: str, becomes: str) -> None:
    html = made(inside)
    body = html.partition("<body>")[2].partition('<p class="shown-at">')[0]
    assert body == becomes


def test_when_it_was_shown_stands_on_it_and_nothing_may_be_requested() -> None:
    html = made("<p>text</p>")
    assert '<p class="shown-at">As shown &lt;now&gt;</p></body>' in html
    policy = re.search(r'<head><meta http-equiv="Content-Security-Policy" content="([^"]*)">', html)
    assert policy is not None
    rules = dict(rule.strip().split(" ", 1) for rule in unescape(policy[1]).split(";"))
    assert rules["default-src"] == rules["form-action"] == "'none'"

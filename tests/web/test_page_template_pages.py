"""Pages with a template of their own, as a server makes them."""

import re
from collections.abc import Iterator
from pathlib import Path
from shutil import copytree

import pytest

from tests.support.parts import ROOT, Server
from tests.support.servers import ready


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(copytree(ROOT / "docs/examples/plan", tmp_path / "plan"))


@pytest.fixture
def server(folder: Path) -> Iterator[Server]:
    (folder / "plan.html").write_text(
        (folder / "plan.html").read_text() + "<p>{{ title }} {{ 'a < b' }} {{ icon('map') }}</p>"
    )
    with ready(Server(ROOT, KIOSK_PANEL=str(folder / "panel.toml"))) as mine:
        yield mine


def test_widgets_stand_where_the_template_places_them(server: Server, folder: Path) -> None:
    html = server.http.get("/").text
    inside = html.partition('<div class="own page-plan">')[2].partition("</main>")[0]
    assert re.findall('data-widget="([a-z]+)"', inside) == ["robot", "heard", "start"]
    assert re.findall('data-widget="([a-z]+)"', html) == ["stop", "robot", "heard", "start"]
    assert 'class="at-robot"><div class="cell" id="at-robot" data-cell="indicator">' in inside
    assert "<p>Plan a &lt; b <svg" in inside
    assert inside.count('<p class="why"') == 1  # macros with the icons and texts of every other page
    picture = re.search(r'<img class="picture" src="([^"]+)" alt="The cell from above', inside)
    assert picture is not None
    assert server.http.get(picture[1]).text == (folder / "pictures/cell.svg").read_text()


def test_styles_of_a_page_template_are_last_in_the_stylesheet(server: Server, folder: Path) -> None:
    sheet = re.search('href="(/static/[^"]+/kiosk.css)"', server.http.get("/").text)
    assert sheet is not None
    assert server.http.get(sheet[1]).text.endswith((folder / "plan.css").read_text())


def test_another_template_is_another_revision(server: Server, folder: Path) -> None:
    """So that open pages load again when a server has it."""
    before = server.snapshot()["revision"]
    (folder / "plan.html").write_text((folder / "plan.html").read_text() + "<p>More</p>")
    with_more = Server(ROOT, KIOSK_PANEL=str(folder / "panel.toml"))
    assert with_more.snapshot()["revision"] != before
    with_more.end()

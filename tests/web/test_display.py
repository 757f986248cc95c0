"""How the pages look in one browser: as chosen in the menu, else as the panel file says."""

import re
from collections.abc import Iterator
from typing import Final

import pytest

from app.web.pages.display_choice import KEPT_S
from tests.support.parts import REFERENCE, ROOT, Server
from tests.support.servers import ready

HTML: Final = {"accept": "text/html"}
LOOK: Final = re.compile(
    r'<html lang="en" data-theme="(\w+)" data-text-size="(\w+)" data-hand="(\w+)"[ >]'
)
PAGES: Final = ("/", "/pages/operation", "/log", "/nothing")


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Its panel is dark."""
    panel = tmp_path_factory.mktemp("panel") / "panel.toml"
    panel.write_text(REFERENCE.read_text().replace("\ntitle =", '\ntheme = "dark"\ntitle =', 1))
    with ready(Server(ROOT, KIOSK_PANEL=str(panel))) as mine:
        yield mine


def looks(kiosk: Server, path: str, cookie: str = "") -> tuple[str, ...]:
    """(theme, text size, hand) of a page."""
    answer = kiosk.http.get(path, headers={**HTML, "cookie": cookie}, follow_redirects=True)
    match = LOOK.search(answer.text)
    assert match is not None, path
    return match.groups()


@pytest.mark.parametrize("path", PAGES)
def test_every_page_looks_as_the_panel_file_says_or_as_was_chosen(kiosk: Server, path: str) -> None:
    assert looks(kiosk, path) == ("dark", "normal", "right")
    assert looks(kiosk, path, "kiosk_theme=contrast") == ("contrast", "normal", "right")
    chosen = "kiosk_theme=light; kiosk_text_size=large; kiosk_hand=left"
    assert looks(kiosk, path, chosen) == ("light", "large", "left")


def test_cookie_with_an_invalid_choice_is_ignored(kiosk: Server) -> None:
    assert looks(kiosk, "/", 'kiosk_theme="><script>; kiosk_hand=up') == ("dark", "normal", "right")


def test_a_choice_is_kept_and_goes_back_to_its_page(kiosk: Server) -> None:
    chosen = {"theme": "contrast", "page": "/pages/operation"}
    answer = kiosk.http.post("/display", data=chosen)
    assert (answer.status_code, answer.headers["location"]) == (303, "/pages/operation")
    (cookie,) = answer.headers.get_list("set-cookie")
    kept = {part.strip().lower() for part in cookie.split(";")}
    assert {"kiosk_theme=contrast", f"max-age={KEPT_S}", "path=/", "samesite=strict"} <= kept


def test_invalid_choice_is_ignored_and_others_are_kept(kiosk: Server) -> None:
    form = {"theme": "neon", "text_size": "large", "font": "Comic", "hand": ""}
    answer = kiosk.http.post("/display", data=form)
    assert answer.status_code == 303
    (cookie,) = answer.headers.get_list("set-cookie")
    assert cookie.startswith("kiosk_text_size=large;")


@pytest.mark.parametrize(
    ("page", "goes_to"),
    [
        ("/pages/operation", "/pages/operation"),
        ("/robots/r1/pages/operation", "/robots/r1/pages/operation"),
        ("", "/"),
        ("/log", "/log"),
        ("/log.csv", "/"),
        ("https://example.org/pages/operation", "/"),
        ("//example.org/pages/operation", "/"),
        ("/\\example.org/pages/a", "/"),
        ("/pages/operation?receipt=x", "/"),
        ("/pages/operation\r\nset-cookie: a=b", "/"),
        ("/pages/../log", "/"),
    ],
)
def test_form_redirects_to_the_panels_pages_only(kiosk: Server, page: str, goes_to: str) -> None:
    answer = kiosk.http.post("/display", data={"page": page, "hand": "left"})
    assert (answer.status_code, answer.headers["location"]) == (303, goes_to)


def test_other_sites_choose_nothing(kiosk: Server) -> None:
    headers = {"origin": "http://wiki.example", "sec-fetch-site": "cross-site"}
    answer = kiosk.http.post("/display", data={"theme": "light"}, headers=headers)
    assert answer.status_code == 403
    assert "set-cookie" not in answer.headers


def test_invalid_form_is_refused(kiosk: Server) -> None:
    assert kiosk.http.post("/display", content=b"theme=light&theme=dark").status_code == 422
    assert kiosk.http.post("/display", content=b"\xff=1").status_code == 422


def test_menu_shows_the_chosen_values(kiosk: Server) -> None:
    html = kiosk.http.get("/pages/operation", headers={"cookie": "kiosk_hand=left"}).text
    pressed = re.findall(r'<button name="(\w+)" value="(\w+)" aria-pressed="true">', html)
    assert pressed == [
        ("theme", "dark"),
        ("text_size", "normal"),
        ("hand", "left"),
        ("sounds", "off"),
    ]
    assert '<input type="hidden" name="page" value="/pages/operation">' in html

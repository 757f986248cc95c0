"""Every error of a browser is a page in the frame: with Stop, the menu, and the reader's language."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest

from tests.support.parts import ROOT, SHIPPED, Server
from tests.support.servers import ready
from tests.support.users import Browsers, add_user

HTML: Final = {"accept": "text/html", "sec-fetch-dest": "document"}
LANGUAGES: Final = ("en", "de", "ja")
STOP: Final = 'data-widget="stop"'
NO_WAY: Final = {"/nowhere": 404, "/recipes/none": 404, "/pages/none": 404, "/log?before=x": 422}


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    data = tmp_path_factory.mktemp("data")
    add_user(data, "M. Sato", "operator", pin="2580")
    add_user(data, "J. Brandt", "engineer", pin="1470")
    app = "tests.support.apps.broken_page:app"
    more: Any = {"KIOSK_PANEL": str(SHIPPED), "KIOSK_DATA": str(data), "KIOSK_MODE": "demo"}
    with ready(Server(ROOT, app=app, **more)) as mine:
        yield mine


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(("path", "status"), [*NO_WAY.items(), ("/users", 403), ("/broken", 500)])
def test_an_error_page_stands_in_the_frame(
    cell: Server, browsers: Browsers, path: str, status: int, language: str
) -> None:
    name, pin = ("J. Brandt", "1470") if status != 403 else ("M. Sato", "2580")
    client = browsers.signed_in(cell.url, name, pin=pin)
    answer = client.get(path, headers=HTML | {"accept-language": language})
    assert answer.status_code == status
    assert f'<html lang="{language}"' in answer.text
    assert STOP in answer.text
    assert f'data-user="{name}"' in answer.text
    assert ("/signin" in answer.text.split('class="ways"')[1].split("</p>")[0]) is (status == 403)
    assert answer.headers["content-security-policy"].startswith("default-src 'none'")
    assert answer.headers["cache-control"] == "no-store"
    assert "swordfish" not in answer.text


def test_a_program_gets_an_error_as_json(cell: Server) -> None:
    answer = cell.http.get("/nowhere", headers={"accept": "application/json"})
    assert (answer.status_code, set(answer.json())) == (404, {"error"})


def test_a_form_that_fails_is_answered_by_such_a_page(cell: Server, browsers: Browsers) -> None:
    client = browsers.signed_in(cell.url, "M. Sato", pin="2580")
    answer = client.post("/widgets/none", data={"_page": "cell"}, headers=HTML)
    assert (answer.status_code, STOP in answer.text) == (404, True)


def test_recipes_of_a_panel_without_recipes_are_such_a_page(browsers: Browsers, tmp_path: Path) -> None:
    with ready(Server(ROOT, KIOSK_DATA=str(tmp_path), KIOSK_MODE="demo")) as server:
        answer = browsers.opened(server.url).get("/recipes", headers=HTML)
    assert answer.status_code == 404
    assert "This panel has no recipes." in answer.text
    assert 'class="menu-key"' in answer.text

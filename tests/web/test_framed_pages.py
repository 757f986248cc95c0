"""Every page but the panel's question before a press: its frame with Stop, its language, and who is
signed in."""

import re
from collections.abc import Iterator
from importlib import import_module
from typing import Final

import httpx
import pytest
from fastapi.responses import HTMLResponse
from fastapi.routing import APIRoute

from app.web.requests import PAGE
from app.web.route_tables import all_modules
from tests.cell.recipes.panels import PANEL
from tests.support.parts import ROOT, Server, until
from tests.support.servers import panel_file, ready
from tests.support.users import Browsers, add_user
from tests.web.test_acts_by_form import HALL

MORE: Final = """
[access]
open = false
[[frame.widget]]
id = "halt"
kind = "publish"
role = "stop"
label = { en = "Halt", de = "Anhalten", ja = "停止" }
topic = "/halt"
type = "std_msgs/msg/Empty"
message = {}
[[alarm]]
id = "air"
topic = "/air"
type = "std_msgs/msg/Float64"
text = "Air pressure low"
low = 5.0
confirm_act = "pin"
[demo]
"/air" = { values = [4.5] }
"""
LANGUAGES: Final = ("en", "de", "ja")
PIN: Final = "2580"
# Each page by the path of its route, with the status of its answer.
PAGES: Final = {
    "/": ("/", 200),
    "/pages/{page}": ("/pages/main", 200),
    "/alarms": ("/alarms", 200),
    "/alarms/history": ("/alarms/history", 200),
    "/alarms/report": ("/alarms/report", 200),
    "/alarms/{alarm:path}/{act}/confirm": ("/alarms/air/acknowledge/confirm", 200),
    "/diagnostics": ("/diagnostics", 200),
    "/help": ("/help", 200),
    "/log": ("/log", 200),
    "/places/{widget}": ("/places/goal", 200),
    "/recipes/{set}": ("/recipes/boxes", 200),
    "/sessions": ("/sessions", 200),
    "/signin": ("/signin", 200),
    "/stops": ("/stops", 200),
    "/oee": ("/oee", 404),
    "/stops/{key}": ("/stops/alarm-1", 200),
    "/users": ("/users", 200),
    "an unknown path": ("/nothing", 404),
    "a wrong query": ("/log?before=x", 422),
}
# Parts of pages, and a page that leads on to the next.
NOT_FRAMED: Final = {
    "/diagnostics/look",
    "/widgets/{widget}/confirm",
    "/widgets/{widget}/lock",
    "/session/oidc/back",
}


@pytest.fixture(scope="module")
def signed_in(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    folder = tmp_path_factory.mktemp("cell")
    data = folder / "data"
    data.mkdir(mode=0o700)
    add_user(data, "Sato", "engineer", pin=PIN)
    panel = panel_file(folder, PANEL + MORE + HALL)
    browsers = Browsers()
    with ready(Server(ROOT, KIOSK_DATA=str(data), KIOSK_PANEL=str(panel), KIOSK_MODE="demo")) as server:
        client = browsers.signed_in(server.url, "Sato", pin=PIN)
        until(lambda: client.get("/stops/alarm-1").status_code == 200, "the alarm is raised")
        yield client
    browsers.close()


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("page", PAGES)
def test_every_page_has_its_frame(signed_in: httpx.Client, page: str, language: str) -> None:
    path, status = PAGES[page]
    headers = {"accept": "text/html", "accept-language": language}
    answer = signed_in.get(path, headers=headers)
    assert (answer.status_code, answer.headers["cache-control"]) == (status, "no-store")
    text = answer.text
    assert re.search(r'<html lang="(\w+)"', text)[1] == language  # type: ignore[index]
    frame = text.partition('class="frame-keys"')[2].partition("</section>")[0]
    assert re.findall(r'data-widget="(\w+)"', frame) == ["halt"]
    assert {"en": "Halt", "de": "Anhalten", "ja": "停止"}[language] in frame
    assert re.findall(r'data-user="([^"]*)"', text) == ["Sato"]
    assert text.count('<nav class="pages">') == 1
    assert text.count('id="menu"') == 1


@pytest.mark.parametrize("page", [page for page, (_, status) in PAGES.items() if status == 200])
def test_a_choice_in_the_menu_leads_back_to_the_page(signed_in: httpx.Client, page: str) -> None:
    path, _ = PAGES[page]
    menu = signed_in.get(path, headers={"accept": "text/html"}).text.partition('id="menu"')[2]
    back = re.findall(r'name="page" value="([^"]*)"', menu)[0]
    answer = signed_in.post("/display", data={"page": back, "hand": "right"})
    leads_to = {"/": "/pages/main", "/alarms/air/acknowledge/confirm": "/"}.get(path, path)
    assert answer.headers["location"] == leads_to


def test_all_pages_are_here() -> None:
    routers = (import_module(f"app.web.routes.{name}").router for name in all_modules())
    routes = [route for router in routers for route in router.routes]
    pages = {route.path for route in routes if isinstance(route, APIRoute) and _is_page(route)}
    assert pages == {page for page in PAGES if page.startswith("/")} | NOT_FRAMED


def _is_page(route: APIRoute) -> bool:
    content = route.responses.get(200, {}).get("content", {})
    return route.methods == {"GET"} and (
        route.response_class is HTMLResponse or PAGE.keys() <= content.keys()
    )

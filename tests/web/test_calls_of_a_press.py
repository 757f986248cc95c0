"""How many of its own functions the server calls for a press and a sign-in, up to the answer: with what
is drawn until then, on a page with many other widgets."""

from collections.abc import Iterator
from typing import Any, Final

import httpx
import pytest

from tests.budgets import check
from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.support.users import Browsers, add_user

TRIES: Final = 20
PANEL: Final = """
title = "Cell"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/start"
type = "std_msgs/msg/Bool"
message = { data = true }
[[page.widget]]
id = "home"
kind = "call"
label = "Home"
service = "/home"
type = "std_srvs/srv/Trigger"
""" + "".join(
    f"""
[[page.widget]]
id = "value_{number}"
kind = "readout"
label = "Value {number}"
topic = "/value_{number}"
type = "std_msgs/msg/Float64"
field = "data"
"""
    for number in range(60)
)
ROWS: Final[dict[str, tuple[str, dict[str, Any]]]] = {
    "calls of a published press": ("/widgets/start", {"inputs": {}}),
    "calls of a service's press, drawn": ("/widgets/home", {"inputs": {}}),
    "calls of a sign-in": ("/session", {"user": "M. Sato", "pin": "2580"}),
}


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    data = tmp_path_factory.mktemp("data")
    add_user(data, "M. Sato", "operator", pin="2580")
    counts = "tests.support.apps.call_counts:app"
    with demo_server(tmp_path_factory.mktemp("cell"), PANEL, app=counts, KIOSK_DATA=str(data)) as mine:
        yield mine


@pytest.fixture
def browser(cell: Server) -> Iterator[httpx.Client]:
    browsers = Browsers()
    yield browsers.signed_in(cell.url, "M. Sato", pin="2580")
    browsers.close()


@pytest.mark.parametrize("name", ROWS)
def test_a_press_and_a_sign_in_draw_only_what_they_change(
    cell: Server, browser: httpx.Client, name: str
) -> None:
    path, body = ROWS[name]

    def sent() -> bool:
        answer = browser.post(path, json=body)
        browser.get("/calls")  # waits until they are counted
        return answer.status_code == 200

    def calls() -> int:
        assert sent()
        return int(browser.get("/calls").json())

    browser.get("/calls")  # those of the fixture's sign-in
    until(sent, "it is permitted")
    with browser.stream("GET", "/events?page=main"):  # the page is on a screen
        check(name, min(calls() for _ in range(TRIES)))

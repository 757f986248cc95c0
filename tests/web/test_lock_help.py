"""`GET /widgets/{widget}/lock`: for the page that shows it, in its language, from the present state."""

from collections.abc import Iterator
from typing import Final

import pytest

from tests.support.parts import Server, until
from tests.support.servers import demo_server

PANEL: Final = """
title = "Cell"
mode = "demo"
[[interlock]]
id = "order"
label = { en = "Order", de = "Auftrag" }
topic = "/last_heard"
type = "std_msgs/msg/String"
equals = "go (/operation2)"
[interlock.help]
text = { en = "Send <go>.", de = "<go> senden." }
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/operation"
type = "std_msgs/msg/Empty"
message = {}
interlock = "order"
[[page.widget]]
id = "order"
kind = "text"
label = "Order"
[[page.widget]]
id = "send"
kind = "publish"
label = "Send"
topic = "/operation2"
type = "std_msgs/msg/String"
message = { data = "{order}" }
[[page.widget]]
id = "heard"
kind = "readout"
label = "Heard"
topic = "/last_heard"
type = "std_msgs/msg/String"
"""


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("panel"), PANEL) as mine:
        until(lambda: mine.widget("send")["enabled"], "the robot is there")
        yield mine


def order(cell: Server, text: str) -> None:
    cell.http.post("/widgets/send", json={"inputs": {"order": text}})
    heard = f"{text} (/operation2)"
    until(lambda: cell.widget("heard")["text"] == heard, f"{text} is heard")


def test_it_is_of_the_present_state(cell: Server) -> None:
    order(cell, "halt")
    answer = cell.http.get("/widgets/start/lock")
    assert answer.status_code == 200
    assert answer.headers["cache-control"] == "no-store"
    assert 'data-title="Start is locked"' in answer.text
    assert "halt (/operation2)" in answer.text
    assert "Send &lt;go&gt;." in answer.text
    order(cell, "go")
    answer = cell.http.get("/widgets/start/lock")
    assert (answer.status_code, answer.text) == (204, "")


def test_it_is_in_the_readers_language(cell: Server) -> None:
    order(cell, "halt")
    german = cell.http.get("/widgets/start/lock", headers={"accept-language": "de"}).text
    assert 'data-title="Start ist gesperrt"' in german
    assert "Auftrag" in german
    assert "&lt;go&gt; senden." in german


def test_only_controls_have_it_and_only_the_panels_own_pages_get_it(cell: Server) -> None:
    assert cell.http.get("/widgets/order/lock").status_code == 404
    assert cell.http.get("/widgets/nothing/lock").status_code == 404
    foreign = {"sec-fetch-site": "cross-site"}
    assert cell.http.get("/widgets/start/lock", headers=foreign).status_code == 403

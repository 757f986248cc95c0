"""More presses than a client may make: by every way, on a server with the demo robot."""

import csv
import io
import json
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.sync_api import Page
from websockets.exceptions import ConnectionClosed

from app.cell.permission.client_limits import RATE_LIMITS
from app.web.routes.presses import MOST_REFUSED
from tests.support.apps.small import PRESSES
from tests.support.holds import PANEL
from tests.support.parts import TAP_AGAIN_MS, Server, until
from tests.support.servers import demo_server
from tests.web.test_hold_socket import opened

FREE = """
[[page.widget]]
id = "free"
kind = "publish"
label = "Free"
topic = "/operation"
type = "std_msgs/msg/String"
message = { data = "free" }

[[page.widget]]
id = "count"
kind = "action"
label = "Count"
action = "/count"
type = "example_interfaces/action/Fibonacci"
goal = { order = 40 }
"""
CLIENT_QUOTA = RATE_LIMITS["presses"].quota
FORM = {"content-type": "application/x-www-form-urlencoded"}
TOO_OFTEN = "too many presses in a short time. Wait a second, then press again."
numbers = count()


def serving(folder: Path, **more: Any) -> Server:
    return demo_server(folder, PANEL + FREE, **more)


@pytest.fixture(scope="module")
def strict(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with serving(tmp_path_factory.mktemp("strict"), app="tests.support.apps.strict:app") as mine:
        yield mine


def free(server: Server, **more: Any) -> httpx.Response:
    return server.http.post("/widgets/free", json={"inputs": {}, **more})


def used_up(server: Server) -> httpx.Response:
    """The answer to the first press that is one too many."""
    response: httpx.Response = until(
        lambda: (response := free(server)).status_code == 429 and response, "too many", every_s=0
    )
    return response


def test_a_flood_reaches_the_robot_at_the_rate_of_a_client(
    tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    mine = servers(serving(tmp_path))
    presses = 600
    began = time.monotonic()
    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(lambda _: free(mine), range(presses)))
    took = time.monotonic() - began
    came = Counter(answer.status_code for answer in answers)
    assert came[200] <= CLIENT_QUOTA.burst + CLIENT_QUOTA.per_s * took + 1
    assert came[200] + came[429] == presses
    metrics = mine.http.get("/metrics").text
    assert f"kiosk_presses_limited_total {came[429]:.1f}" in metrics
    assert 'kiosk_presses_total{outcome="refused"}' not in metrics
    assert mine.process.text.count("press ") <= came[200] + 2


def test_press_over_the_rate_limit_gets_429_and_may_be_repeated_with_its_id(strict: Server) -> None:
    answer = used_up(strict)
    assert answer.headers["retry-after"] == "1"
    assert (answer.json()["outcome"], answer.json()["widget"]) == ("refused", "free")
    assert TOO_OFTEN in answer.json()["reason"]
    press_id = f"later-{next(numbers)}"
    until(lambda: free(strict, id=press_id).status_code == 200, "it may press again", every_s=0.1)
    assert strict.process.count(f"press {press_id} of") == 1


def test_invalid_requests_do_not_count_as_presses(
    tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    mine = servers(serving(tmp_path, app="tests.support.apps.strict:app"))
    for _ in range(2 * PRESSES):
        assert mine.http.post("/widgets/nothing", json={"inputs": {}}).status_code == 404
        assert mine.http.post("/widgets/free", content=b"{").status_code == 422
    assert free(mine).status_code == 200


def test_a_form_goes_back_to_its_page_with_the_reason(strict: Server) -> None:
    def refused() -> str:
        used_up(strict)
        body = f"_id={next(numbers):016}"
        answer = strict.http.post("/widgets/free", content=body, headers=FORM)
        assert answer.status_code == 303
        location = answer.headers["location"]
        return "" if location.endswith(".free") else location

    assert TOO_OFTEN in strict.http.get(until(refused, "a form is one too many")).text


def test_a_page_without_scripts_shows_the_reason(strict: Server, without_scripts: Page) -> None:
    page = without_scripts

    def said() -> str:
        page.goto(strict.url)
        page.wait_for_timeout(TAP_AGAIN_MS)
        for _ in range(2 * PRESSES):  # by the same browser
            page.request.post(f"{strict.url}/widgets/free", data={"inputs": {}})
        page.get_by_role("button", name="Free", exact=True).click()
        return page.locator("#receipt-free").inner_text()

    until(lambda: TOO_OFTEN in said(), "it is one too many")


def test_a_press_on_a_socket_gets_that_answer_and_a_flood_closes_it(strict: Server) -> None:
    used_up(strict)
    with strict.socket() as socket:
        answer = socket.press(widget="free", inputs={})
        while answer.status_code == 200:
            answer = socket.press(widget="free", inputs={})
        assert (answer.status_code, TOO_OFTEN in answer.json()["reason"]) == (429, True)
        with suppress(ConnectionClosed):  # the server may close it during the flood
            for number in range(3 * MOST_REFUSED):
                socket.say(json.dumps({"widget": "free", "inputs": {}, "id": f"flood-{number}"}))
        assert socket.closed() == 1008
    with strict.socket() as socket:
        for _ in range(MOST_REFUSED):
            socket.say("no press at all")
        assert socket.closed() == 1008
    with strict.socket() as socket:
        assert socket.press(widget="nothing", inputs={}).status_code == 404


def test_the_begin_of_a_hold_is_a_press(strict: Server) -> None:
    def begun() -> dict[str, Any]:
        with opened(strict) as socket:
            said = socket.begin()
            if said["state"] == "refused":
                assert socket.closed() == 4000 + said["status"]
            return said

    said = until(lambda: (message := begun()).get("status") == 429 and message, "too many", within_s=40)
    assert (said["state"], TOO_OFTEN in said["reason"]) == ("refused", True)
    assert "hold of jog" not in strict.process.text


def test_a_cancel_is_sent_however_much_was_pressed(strict: Server) -> None:
    goal = {"inputs": {}, "id": "goal"}
    until(lambda: strict.http.post("/widgets/count", json=goal).status_code == 200, "it is under way")
    used_up(strict)
    answer = strict.http.post("/widgets/count/cancel", json={"press": "goal"})
    assert (answer.status_code, answer.json()["outcome"]) == (200, "accepted")
    until(lambda: strict.widget("count")["outcome"] == "canceled", "it was canceled")


def test_cancels_of_the_same_goal_again_and_again_are_refused(strict: Server) -> None:
    def cancel(**form: Any) -> httpx.Response:
        return strict.http.post("/widgets/count/cancel", **form)

    answer = until(
        lambda: (response := cancel()).status_code == 429 and response, "too many", every_s=0
    )
    assert answer.headers["retry-after"] == "1"
    assert "too many cancel requests" in answer.json()["reason"]
    location = until(
        lambda: (
            "receipt=" in (to := cancel(content="_press=", headers=FORM).headers["location"]) and to
        ),
        "a form is one too many",
        every_s=0,
    )
    assert "too many cancel requests" in strict.http.get(location).text


def test_the_operators_log_sums_them_up(tmp_path: Path, servers: Callable[[Server], Server]) -> None:
    mine = serving(tmp_path, app="tests.support.apps.strict:app", KIOSK_DATA=str(tmp_path))
    used_up(mine)
    for _ in range(20):
        free(mine)
    mine.end()
    again = servers(serving(tmp_path, KIOSK_DATA=str(tmp_path)))
    text = again.http.get("/log.csv?outcome=refused&every=true").text
    entries = list(csv.DictReader(io.StringIO(text.removeprefix("\ufeff"))))
    (summed,) = [entry for entry in entries if "exceeded the limit" in entry["reason"]]
    assert summed["reason"].partition(" ")[2].startswith("presses from a program (127.0.0.1) since ")
    assert json.loads(summed["values"])["more"] >= 15

"""Why the machine stopped, of a running server: the list, the story as a page and as JSON, the way to
it from the header and from an alarm."""

import re
from collections.abc import Iterator
from typing import Any

import pytest

from tests.support.parts import Server, until
from tests.support.servers import demo_server

pytestmark = pytest.mark.promise("stops")

# The guard is opened, and the machine stops a second later; then all is well for some seconds.
PANEL = """
title = "Cell"
languages = ["en", "ja"]
[state]
topic = "/state"
type = "std_msgs/msg/String"
stops = ["FAULT"]
effects = ["no_fault"]
states = [
  { value = "RUNNING", text = "Running", shape = "play" },
  { value = "FAULT", text = { en = "Fault", ja = "異常" }, shape = "cross", colour = "red" },
]
[[interlock]]
id = "guard"
label = { en = "Guard door", ja = "安全扉" }
topic = "/guard"
max_age_s = 5.0
help.text = "Close the door\\nPress Reset"
[[interlock]]
id = "no_fault"
topic = "/no_fault"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/start"
type = "std_msgs/msg/Empty"
message = {}
interlock = ["guard", "no_fault"]
[[alarm]]
id = "speed_low"
topic = "/speed"
type = "std_msgs/msg/Float64"
text = "Belt is slow"
low = 5.0
priority = 3
[demo]
"/state" = { period_s = 8, values = ["RUNNING", "RUNNING", "RUNNING", "RUNNING", "FAULT", "FAULT"] }
"/guard" = { period_s = 8, values = [true, true, true, false, false, true] }
"/no_fault" = { period_s = 8, values = [true, true, true, true, false, false] }
"/speed" = { period_s = 8, values = [8.0, 8.0, 8.0, 8.0, 8.0, 3.0] }
"""


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """It has stopped twice at least, the second time not right after the start of the server."""
    with demo_server(tmp_path_factory.mktemp("cell"), PANEL) as server:
        until(lambda: len(keys(server)) > 1, "the machine has stopped", within_s=40)
        yield server


def keys(server: Server) -> list[str]:
    """The stops that the list has, the newest first."""
    text = server.http.get("/stops").text
    return re.findall(r'href="/stops/((?:state|alarm)-[0-9]+)"', text)


def story(server: Server, key: str, language: str = "en") -> dict[str, Any]:
    answer = server.http.get(f"/stops/{key}/story.json", headers={"accept-language": language})
    assert answer.status_code == 200, answer.text
    told: dict[str, Any] = answer.json()
    return told


def test_the_story_names_the_first_cause_and_what_followed(cell: Server) -> None:
    key = keys(cell)[-2]
    told = story(cell, key)
    assert told["first_cause"] == {"sort": "interlock", "id": "guard"}
    assert told["not_told"] is None
    assert "Guard door: not met" in told["sentence"]
    lines = {(line["sort"], line["id"]): line for line in told["lines"]}
    assert lines["interlock", "guard"]["first_cause"]
    assert lines["state", "FAULT"]["before"] == "Running"
    assert 0.3 < lines["state", "FAULT"]["offset_s"] < 2.5
    assert told["lines"] == sorted(told["lines"], key=lambda line: line["offset_s"])


def test_the_page_tells_it_without_scripts_and_in_the_readers_language(cell: Server) -> None:
    key = keys(cell)[-2]
    page = cell.http.get(f"/stops/{key}", headers={"accept-language": "ja"}).text
    assert "最初の原因" in page
    assert "安全扉：不成立" in page
    assert "<li>Close the door</li><li>Press Reset</li>" in page
    whole = cell.http.get(f"/stops/{key}?all=1").text
    assert whole.count("<li data-sort=") >= page.count("<li data-sort=")


def test_the_header_leads_to_the_newest_stop_while_it_stands(cell: Server) -> None:
    until(lambda: ">Why did it stop?</a>" in cell.http.get("/").text, "the header offers the story")
    until(lambda: 'data-text="why"></a>' in cell.http.get("/").text, "the machine runs again")
    answer = cell.http.get("/stops/latest")
    assert answer.status_code == 303
    assert answer.headers["location"] == f"/stops/{keys(cell)[0]}"


def test_an_alarm_of_any_priority_has_its_story(cell: Server) -> None:
    until(lambda: raised(cell), "the alarm is raised")
    row = raised(cell)[0]
    asked = {"id": row["id"], "occurrence": row["occurrence"]}
    answer = cell.http.get("/stops/alarm", params=asked)
    assert answer.status_code == 303
    told = story(cell, answer.headers["location"].removeprefix("/stops/"))
    assert told["stop"]["text"] == "Belt is slow"
    assert cell.http.get("/stops/alarm", params={**asked, "occurrence": 999}).status_code == 404


def raised(server: Server) -> list[dict[str, Any]]:
    rows = server.http.get("/alarms", params={"history": "true"}).json()["history"]
    return [row for row in rows if row["event"] == "raised"]


def test_right_after_the_start_of_the_server_the_first_cause_is_not_told(cell: Server) -> None:
    told = story(cell, keys(cell)[-1])
    assert (told["first_cause"], told["not_told"]) == (None, "restarted")


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("state-999999", 404),
        ("alarm-1000000", 404),
        ("goal-1000000", 404),
        ("link-1000000", 404),
        ("x-1", 422),
    ],
)
def test_a_stop_without_a_record_is_refused_with_a_sentence(
    cell: Server, path: str, status: int
) -> None:
    answer = cell.http.get(f"/stops/{path}", headers={"accept": "application/json"})
    assert answer.status_code == status
    if status == 404:
        assert "There is no record of this stop any more." in answer.text

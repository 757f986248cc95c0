"""Reasons of stops and the figures of a shift, of a running server: the question after a stop, the
answer and its change, the figures as a page, JSON and CSV."""

import csv
import io
import re
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, Final

import pytest

from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.support.users import Browsers, add_user

PIN: Final = "2580"
# It stands still for 2 s of 8.
PANEL = """
title = "Cell"
languages = ["en", "ja"]
[state]
topic = "/state"
type = "std_msgs/msg/String"
states = [
  { value = "RUNNING", text = "Running", shape = "play" },
  { value = "WAITING", text = { en = "Waiting", ja = "待ち" }, shape = "pause" },
]
[oee]
reason_after_s = 1.0
ideal_cycle_s = 0.2
target = 75
target_quality = 99.5
counter = [
  { parts = "all", topic = "/parts", type = "std_msgs/msg/UInt32" },
  { parts = "bad", topic = "/rejects", type = "std_msgs/msg/UInt32" },
]
reason = [
  { id = "material", label = { en = "Material", ja = "材料" }, icon = "package" },
  { id = "break", label = "Break", planned = true },
]
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
interlock = "ready"
[[interlock]]
id = "ready"
topic = "/ready"
[[alarm]]
id = "speed_low"
topic = "/speed"
type = "std_msgs/msg/Float64"
text = "Belt is slow"
low = 5.0
priority = 3
[demo]
"/state" = { period_s = 8, values = ["RUNNING", "RUNNING", "RUNNING", "WAITING"] }
"/speed" = { values = [8.0] }
"""

TWO_ROBOTS = (
    PANEL.replace('languages = ["en", "ja"]', 'languages = ["en", "ja", "de"]')
    .replace("[state]", '[state]\nstops = ["WAITING"]')
    .replace(
        "[[page]]",
        """[[robot]]
id = "left"
name = { en = "Left", ja = "左", de = "Links" }
namespace = "/left"
[[robot]]
id = "right"
name = { en = "Right", ja = "右", de = "Rechts" }
namespace = "/right"
[[page]]""",
        1,
    )
)


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """It has stood still twice at least."""
    with demo_server(tmp_path_factory.mktemp("cell"), PANEL) as server:
        until(lambda: len(ended(server)) > 1, "the machine has stood still", within_s=40)
        yield server


def figures(server: Server) -> dict[str, Any]:
    """Of the only robot."""
    answer = server.http.get("/oee/figures")
    assert answer.status_code == 200, answer.text
    told: dict[str, Any] = answer.json()
    (robot,) = told.pop("robots")
    return {**told, **robot}


def ended(server: Server) -> list[dict[str, Any]]:
    return [stop for stop in figures(server)["stops"] if stop["ended"] and stop["key"]]


def asked_stops(server: Server) -> list[dict[str, Any]]:
    asked = server.snapshot()["alarms"]["asked"]
    return asked["stops"] if asked else []


def give(server: Server, key: str, reason: str) -> dict[str, Any]:
    answer = server.http.post(f"/stops/{key}/reason", json={"reason": reason})
    receipt: dict[str, Any] = answer.json()
    return {**receipt, "status": answer.status_code}


def test_the_figures_are_of_what_was_recorded(cell: Server) -> None:
    until(lambda: figures(cell)["produced_quantity"], "parts are counted")
    told = figures(cell)
    assert 0 < told["availability"] < 1
    stops = sum(stop["seconds"] for stop in told["stops"])
    assert told["actual_unit_down_time_s"] == pytest.approx(stops)
    assert told["planned_busy_time_s"] == pytest.approx(stops + told["actual_production_time_s"])
    parts = (told["availability"], told["performance"], told["quality"])
    assert told["oee"] == pytest.approx(parts[0] * parts[1] * parts[2])
    assert told["not_recorded_s"] > 0
    assert (told["robot"], told["name"]) == ("", "")


def test_targets_are_marked(cell: Server) -> None:
    assert figures(cell)["targets"] == {
        "availability": None,
        "performance": None,
        "quality": 0.995,
        "oee": 0.75,
    }
    page = cell.http.get("/oee", headers={"accept-language": "ja"}).text
    assert "<span>目標\u00a075</span>" in page or "<span>目標 75</span>" in page
    assert page.count('<line x1="99.5"') == 1
    assert page.count('class="around"') == 1


def test_prometheus_has_the_figures_of_the_shift(cell: Server) -> None:
    told, text = figures(cell), cell.http.get("/metrics").text
    values = dict(re.findall(r"^(kiosk_shift_\S+) (\S+)$", text, re.MULTILINE))
    assert 0 < float(values['kiosk_shift_availability{robot=""}']) < 1
    assert float(values['kiosk_shift_oee{robot=""}']) > 0
    names = {
        f'kiosk_shift_stop_seconds{{reason="{r}",robot=""}}' for r in ("", "-", "material", "break")
    }
    assert names <= values.keys()
    stopped = sum(float(values[name]) for name in names)
    assert 0 < stopped <= told["actual_unit_down_time_s"] + 0.01


def test_the_line_of_alarms_asks_after_the_restart(cell: Server) -> None:
    line = re.compile(r'class="asked" role="status"><b data-text="text">Stood still for [^<]+<')
    until(lambda: line.search(cell.http.get("/").text), "the panel asks", within_s=20)
    answer = cell.http.get("/stops/asked")
    assert answer.status_code == 303
    path, _, fragment = answer.headers["location"].partition("#")
    assert fragment == "reasons"
    page = cell.http.get(path, headers={"accept-language": "ja"}).text
    assert "<b>材料</b>" in page
    assert "未回答" in page
    key = path.removeprefix("/stops/")
    assert give(cell, key, "")["outcome"] == "succeeded"
    asked = cell.http.get("/stops/asked").headers["location"]
    assert key not in asked


def test_an_answer_counts_until_it_is_changed(cell: Server) -> None:
    key = ended(cell)[0]["key"]
    for reason in ("material", "break", "material"):
        assert give(cell, key, reason)["outcome"] == "succeeded"
        page = cell.http.get(f"/stops/{key}").text
        assert re.findall(r'name="reason" value="(\w+)" aria-pressed="true"', page) == [reason]
        counted = {stop["key"]: stop["reason"] for stop in figures(cell)["stops"]}
        assert counted.get(key) == (None if reason == "break" else reason)
    assert figures(cell)["planned_stops_s"] == pytest.approx(0.0, abs=0.01)
    log = cell.http.get("/log", params={"text": "Material"}).text
    assert "Reason of a stop" in log


def test_the_page_and_the_table_have_the_stops(cell: Server) -> None:
    stop = ended(cell)[0]
    page = cell.http.get("/oee").text
    assert f'href="/stops/{stop["key"]}"' in page
    assert 'data-kind="running"' in page
    rows = list(csv.DictReader(io.StringIO(cell.http.get("/oee/stops.csv").text.lstrip("\ufeff"))))
    assert stop["key"] in [row["key"] for row in rows]
    last = cell.http.get("/oee", params={"shift": "last"}).text
    assert "No state is recorded in this time." in last


def test_a_form_answers_with_the_page_of_the_stop(cell: Server) -> None:
    key = ended(cell)[1]["key"]
    form = {"id": "form-1", "reason": "material"}
    answer = cell.http.post(f"/stops/{key}/reason", data=form)
    assert (answer.status_code, answer.headers["location"]) == (303, f"/stops/{key}#reasons")
    assert "Material, by" in cell.http.get(f"/stops/{key}").text
    refused = cell.http.post(f"/stops/{key}/reason", data={"id": "form-2", "reason": "luck"})
    shown = cell.http.get(refused.headers["location"]).text
    assert "This reason is not in the panel file." in shown


def test_what_is_no_reason_is_refused(cell: Server) -> None:
    receipt = give(cell, ended(cell)[0]["key"], "luck")
    assert (receipt["outcome"], receipt["code"]) == ("refused", "oee_reason_unknown")
    assert give(cell, "state-999999", "material")["status"] == 404


def test_open_reasons_are_asked_together_before_the_shift_ends(tmp_path: Path) -> None:
    def line() -> list[dict[str, Any]]:
        return asked_stops(server)

    with demo_server(tmp_path, PANEL, app="tests.support.apps.shift_end:app") as server:
        until(lambda: ended(server), "the machine has stood still", within_s=20)
        first = ended(server)[0]["key"]
        assert give(server, first, "")["outcome"] == "succeeded"
        until(lambda: len(line()) > 1, "it is asked together", within_s=60)
        location = server.http.get("/stops/asked").headers["location"]
        assert location == "/oee?shift=this&open=1#stops"
        page = server.http.get(location).text
        listed = re.findall(r'class="answer" href="/stops/([a-z0-9-]+)#reasons"', page)
        assert first in listed
        before = len(line())
        assert give(server, first, "material")["outcome"] == "succeeded"
        until(lambda: len(line()) < before, "one less is asked")
        page = server.http.get(location).text
        assert f'class="answer" href="/stops/{first}#reasons"' not in page


def test_open_reasons_of_all_robots_are_asked_together(tmp_path: Path) -> None:
    """Each robot's stops stand under its name. The stops of one robot do not take away the question
    about the other's."""

    def robots() -> set[str]:
        return {stop["robot"] for stop in asked_stops(left)}

    def listed(of_server: Server) -> dict[str, list[str]]:
        parts = re.split(r'class="of-robot"[^>]*>([^<]+)<', of_server.http.get(address).text)[1:]
        keys = re.compile(r'class="answer" href="/stops/([a-z0-9-]+)#reasons"')
        return {name: keys.findall(rows) for name, rows in zip(parts[::2], parts[1::2], strict=True)}

    with demo_server(tmp_path, TWO_ROBOTS, app="tests.support.apps.shift_end:app") as server:
        left = server.robot("left")
        until(lambda: robots() == {"left", "right"}, "both are asked together", within_s=60)
        address = server.http.get("/stops/asked").headers["location"]
        assert address == "/oee?shift=this&open=1#stops"
        line = re.search(r'data-text="times">([^<]+)<', server.http.get("/robots/left/pages/main").text)
        assert line
        assert re.fullmatch(r"Left: \d+, Right: \d+\. Say why before the shift ends\.", line[1])
        keys = listed(server)
        assert [*keys] == ["Left", "Right"]
        assert not set(keys["Left"]) & set(keys["Right"])
        for name, of_robot in keys.items():
            assert f"<b>{name}</b>" in server.http.get(f"/stops/{of_robot[0]}").text
            assert give(server, of_robot[0], "material")["outcome"] == "succeeded"
        rest = listed(server)
        assert not {keys[name][0] for name in keys} & {
            key for answers in rest.values() for key in answers
        }
        until(lambda: robots() == {"left", "right"}, "both are asked about their next stops")


# Which robots are chosen → those that each table is about, by id and by name.
CHOSEN: Final = {
    "": {"left": "Links", "right": "Rechts"},
    "left": {"left": "Links"},
    "right": {"right": "Rechts"},
}


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Both robots have stood still."""
    with demo_server(tmp_path_factory.mktemp("two"), TWO_ROBOTS) as server:
        server.http.headers["accept-language"] = "de"

        def stood() -> bool:
            robots = server.http.get("/oee/figures").json()["robots"]
            return all(any(stop["ended"] and stop["key"] for stop in r["stops"]) for r in robots)

        until(stood, "both have stood still", within_s=40)
        yield server


def _in_json(server: Server, query: str) -> dict[str, str]:
    robots = server.http.get(f"/oee/figures{query}").json()["robots"]
    assert all(robot["reasons"] and robot["stops"] for robot in robots)
    return {robot["robot"]: robot["name"] for robot in robots}


def _in_csv(server: Server, query: str) -> dict[str, str]:
    text = server.http.get(f"/oee/stops.csv{query}").text.lstrip("\ufeff")
    return {row["robot"]: row["name"] for row in csv.DictReader(io.StringIO(text))}


def _in_page(path: str, pattern: str) -> Callable[[Server, str], dict[str, str]]:
    """The names of robots beside which a table stands."""

    def shown(server: Server, query: str) -> dict[str, str]:
        names = dict.fromkeys(re.findall(pattern, server.http.get(f"{path}{query}").text))
        return {id: name for id, name in CHOSEN[""].items() if name in names}

    return shown


TABLES: Final[dict[str, Callable[[Server, str], dict[str, str]]]] = {
    "figures": _in_page("/oee", r'<h3 class="robot-name">([^<]+)</h3>'),
    "longest stops": _in_page("/oee", r'class="of-robot"[^>]*>([^<]+)<'),
    "states on paper": _in_page("/alarms/report", r'<svg class="state-times"[^>]*, ([^"]+)">'),
    "list of stops": _in_page("/stops", r"</b><small>([^<]+)</small>"),
    "JSON": _in_json,
    "CSV": _in_csv,
}


@pytest.mark.parametrize("robot", CHOSEN)
@pytest.mark.parametrize("table", TABLES)
def test_a_table_is_about_the_chosen_robots_or_all(two: Server, table: str, robot: str) -> None:
    query = f"?robot={robot}" if robot else ""
    assert TABLES[table](two, query) == CHOSEN[robot]


@pytest.mark.parametrize("path", ["/oee", "/oee/figures", "/oee/stops.csv", "/stops", "/alarms/report"])
def test_a_robot_that_is_not_there_has_no_table(two: Server, path: str) -> None:
    assert two.http.get(f"{path}?robot=middle").status_code == 404


def test_the_choice_of_a_robot_stays(two: Server) -> None:
    """The other shifts, the other table of stops and the CSV are of the chosen robot too."""
    page = two.http.get("/oee?robot=left").text
    main = page[page.index('<main class="oee">') :]
    links = [link for link in re.findall(r'href="(/oee[^"]*)"', main) if "shift" in link]
    others = [link for link in links if "robot=left" not in link]
    assert others == ["/oee?shift=this", "/oee?shift=this&amp;robot=right"]


def test_prometheus_has_each_robot_with_its_name(two: Server) -> None:
    text = two.http.get("/metrics").text
    for robot, name in (("left", "Left"), ("right", "Right")):
        assert f'kiosk_robot_info{{name="{name}",robot="{robot}"}} 1.0' in text
        assert f'kiosk_shift_availability{{robot="{robot}"}} ' in text


def test_the_story_of_a_stop_names_its_robot(two: Server) -> None:
    for robot in two.http.get("/oee/figures").json()["robots"]:
        key = robot["stops"][0]["key"]
        stop = two.http.get(f"/stops/{key}/story.json").json()["stop"]
        assert (stop["robot"], stop["robot_name"]) == (robot["robot"], robot["name"])


def test_who_may_not_answer_is_told_why(tmp_path: Path) -> None:
    panel = PANEL.replace("[oee]", '[oee]\nneeds = "maintenance"')
    add_user(tmp_path, "ann", "operator", pin=PIN)
    browsers = Browsers()
    with demo_server(tmp_path, panel, KIOSK_DATA=str(tmp_path)) as server, closing(browsers):
        ann = browsers.signed_in(server.url, "ann", pin=PIN)

        def keys() -> list[str]:
            (robot,) = ann.get("/oee/figures").json()["robots"]
            return [stop["key"] for stop in robot["stops"] if stop["key"]]

        until(keys, "the machine has stood still", within_s=20)
        answer = ann.post(f"/stops/{keys()[0]}/reason", json={"reason": "material"})
        assert answer.json()["code"] == "role_needed"


def test_without_the_table_there_is_no_page(tmp_path: Path) -> None:
    begin, rest = PANEL.split("[oee]")
    panel = begin + rest[rest.index("[[page]]") :]
    with demo_server(tmp_path, panel) as server:
        assert server.http.get("/oee").status_code == 404
        assert 'href="/oee"' not in server.http.get("/alarms", headers={"accept": "text/html"}).text

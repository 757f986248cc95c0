"""Trends of a whole server: over HTTP, in the page without scripts, over SIGKILL, on a full disk."""

import re
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.records.test_on_server import MOUNT, SMALL_DISK, fill, inside
from tests.support.parts import Server, until
from tests.support.servers import demo_server

PANEL = """
title = "Trends"
mode = "demo"
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "course"
kind = "trend"
label = "Air pressure"
window = "1m"
windows = ["10m"]
disk = true
[[page.widget.pen]]
topic = "/inlet"
type = "std_msgs/msg/Float64"
label = "Inlet"
unit = "bar"
[[page.widget.pen]]
topic = "/gripper"
type = "std_msgs/msg/Float64"
label = "Gripper"
unit = "bar"
[[page.widget]]
id = "battery"
kind = "readout"
label = "Battery"
topic = "/inlet"
type = "std_msgs/msg/Float64"
"""
PATH = "/widgets/course/trend"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("trends"), PANEL) as mine:
        yield mine


def history(server: Server, **query: Any) -> dict[str, Any]:
    answer = server.http.get(PATH, params={"span_s": 60, **query})
    assert answer.status_code == 200, answer.text
    values: dict[str, Any] = answer.json()
    return values


def columns(server: Server, pen: int = 0, **query: Any) -> list[list[float]]:
    return [column for column in history(server, **query)["pens"][pen] if column]


def test_the_history_of_each_pen_is_read(server: Server) -> None:
    until(lambda: all(len(columns(server, pen)) > 5 for pen in (0, 1)), "both pens have values")
    answer = history(server, points=100)
    assert answer["width_s"] == 0.6
    assert abs(answer["now"] - answer["end"]) < 1
    numbers = [column[0] for column in answer["pens"][0] if column]
    assert numbers == sorted(set(numbers))
    assert (numbers[-1] + 1) * 0.6 > answer["end"] - 5
    assert answer["pens"][0][0] is None


def test_follower_gets_new_columns(server: Server) -> None:
    until(lambda: len(columns(server)) > 5, "there are values")
    last = columns(server)[-1][0]
    columns_after = until(
        lambda: [column for column in columns(server, since=last + 1) if column[0] > last],
        "there are new ones",
    )
    assert len(columns_after) < 50


@pytest.mark.long("detail")
def test_a_time_that_is_over_does_not_change(server: Server) -> None:
    until(lambda: len(columns(server)) > 20, "there are values")
    end = history(server)["end"] - 2.0
    first = columns(server, end=end)
    until(lambda: history(server)["end"] > end + 3.0, "time passes")
    assert [column for column in columns(server, end=end) if column in first] == first
    assert history(server, end=4e9)["end"] < 4e9


@pytest.mark.parametrize(
    ("path", "query", "status"),
    [
        ("/widgets/battery/trend", {"span_s": 60}, 404),
        ("/widgets/other/trend", {"span_s": 60}, 404),
        (PATH, {}, 422),
        (PATH, {"span_s": 0.5}, 422),
        (PATH, {"span_s": 86_401}, 422),
        (PATH, {"span_s": "nan"}, 422),
        (PATH, {"span_s": "inf"}, 422),
        (PATH, {"span_s": 60, "points": 5}, 422),
        (PATH, {"span_s": 60, "points": 100_000}, 422),
        (PATH, {"span_s": 60, "since": -1}, 422),
        (PATH, {"span_s": 60, "end": "today"}, 422),
    ],
)
def test_invalid_query_is_refused(
    server: Server, path: str, query: dict[str, Any], status: int
) -> None:
    answer = server.http.get(path, params=query)
    assert answer.status_code == status
    assert answer.json()["error"]


def test_without_scripts_a_trend_is_a_picture(server: Server) -> None:
    until(lambda: len(columns(server)) > 20, "there are values")
    page = server.http.get("/").text
    paths = re.findall(r'<path class="line pen-(\d)" d="(M[^"]+)"', page)
    assert [number for number, _ in paths] == ["0", "1"]
    assert all(path.count("L") > 10 for _, path in paths)
    assert re.search(r'<text x="[\d.]+%" y="100%" dy="18">\d\d:\d\d:\d\d</text>', page)
    assert re.search(r'data-text="text0">[−\d.]+ bar</b>', page)


def kept(server: Server) -> int:
    return len(columns(server, span_s=600, points=600))


def test_a_killed_server_has_the_values_from_before(
    tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    """SIGKILL while it records; the next one shows what was written, then a gap, then what is new."""
    data = str(tmp_path / "data")
    first = servers(demo_server(tmp_path, PANEL, KIOSK_DATA=data))
    until(lambda: kept(first) >= 8, "some seconds are recorded", within_s=60)
    before = columns(first, span_s=600, points=600)
    first.end(signal.SIGKILL)
    second = servers(demo_server(tmp_path, PANEL, KIOSK_DATA=data))
    until(lambda: columns(second, span_s=600, points=600)[-1][0] > before[-1][0] + 1, "it records")
    answer = history(second, span_s=600, points=600)["pens"][0]
    after = {column[0]: column for column in answer if column}
    # What is written every 5 s is there, as it was; columns begin a little elsewhere after a restart.
    survived = [column for column in before if column[0] in after]
    assert len(survived) >= 2
    assert survived[0][0] <= before[1][0]
    assert all(len(column) == 2 or abs(after[column[0]][-1] - column[-1]) < 5 for column in survived)
    begins = [answer[i + 1][0] for i, column in enumerate(answer[:-1]) if column is None]
    assert begins[-1] >= before[-1][0], "the time without a server is a gap"


@pytest.mark.long("detail")
def test_a_full_disk_is_reported_and_trends_go_on(
    tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    panel = PANEL.replace("[[page]]", "[log]\nenabled = false\n[[page]]", 1)
    kiosk = servers(demo_server(tmp_path, panel, before=[*SMALL_DISK, MOUNT, "sh"]))
    until(lambda: kept(kiosk) >= 3, "it records")
    filler = fill(inside(kiosk))
    note = "Not kept on disk: no space left on device"
    until(lambda: kiosk.widget("course")["fault"] == note, "the widget says so", within_s=60)
    assert note in kiosk.http.get("/").text
    before = columns(kiosk)[-1][0]
    until(lambda: columns(kiosk)[-1][0] > before, "it goes on")
    assert kiosk.process.count("trends are not written") == 1
    filler.unlink()
    until(lambda: kiosk.widget("course")["fault"] == "", "it is written again", within_s=60)

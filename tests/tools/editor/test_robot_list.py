"""The robot's list beside the page that is edited, of the shipped panel's simulated robot."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import pytest

from app.panel import Panel, load_panel
from app.panel.layout import Frame
from app.ros.messages import Type, load_interfaces
from app.system.settings import shipped_path
from app.system.texts import render
from app.tools.editor.robot_list import RobotList, Row, fields_of, short, uses_of
from app.tools.robot.link import Place
from app.tools.simulator.in_process import in_process
from tests.support.places import SHIPPED

WITHIN_S: Final = 20.0
WITH_ALARM: Final = """
title = "Cell"
[[page]]
id = "main"
title = "Main"
[[alarm]]
id = "not_ready"
text = "Not ready"
when = { topic = "/ready", type = "std_msgs/msg/Bool", equals = false }
"""
ZENOH: Final = shipped_path("zenoh.json5")


@asynccontextmanager
async def listing(place: Place | None) -> AsyncIterator[RobotList]:
    async def where() -> Place | None:
        return place

    robots = RobotList(where)
    task = asyncio.create_task(robots.run())
    try:
        robots.look()
        yield robots
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


async def until(robots: RobotList, is_so: Callable[[], Any]) -> None:
    async with asyncio.timeout(WITHIN_S):
        while not is_so():
            robots.look()
            await asyncio.sleep(0.05)


def row(robots: RobotList, panel: Panel, section: Any, key: str) -> Row | None:
    return next((row for row in robots.rows(panel)[section] if row.key == key), None)


def valued(robots: RobotList, panel: Panel, topic: str) -> Row | None:
    """The row of a topic whose value is known."""
    known = row(robots, panel, "topics", topic)
    return known if known and known.value else None


def test_the_list_has_the_robot_with_live_values_and_where_the_panel_uses_them() -> None:
    panel = load_panel(SHIPPED)

    async def read() -> None:
        with in_process(panel) as endpoint:
            async with listing(Place(zenoh=ZENOH, connect=(endpoint,))) as robots:
                await until(robots, lambda: valued(robots, panel, "/air_pressure"))
                pressure = valued(robots, panel, "/air_pressure")
                assert pressure is not None
                assert pressure.type == "sensor_msgs/msg/FluidPressure"
                assert 3 < float(str(pressure.value)) < 9  # bar, not Pa
                assert [render(place, "en") for place in pressure.used] == ["Cell", "Watch", "alarm"]
                state = row(robots, panel, "topics", "/cell/state")
                assert state is not None
                assert "header" in [render(place, "en") for place in state.used]
                assert 3 < float(str(robots.values(panel)["/air_pressure"])) < 9
                known = robots.suggestions("topics", "/air_pressure", panel)
                assert known is not None
                assert known.choices[0].kind == "gauge"

    asyncio.run(read())


def test_a_panel_with_a_story_lists_what_its_robot_can_play() -> None:
    shipped = load_panel(SHIPPED)
    bare = {"pages": (), "interlocks": (), "alarms": (), "own_conditions": (), "state": None}
    panel = shipped.model_copy(update={**bare, "frame": Frame(widget=()), "recipes": ()})
    robots = RobotList(_nowhere)
    names = [row.name for row in robots.rows(panel)["topics"]]
    assert {"/boxes", "/cell/state"} <= {*names}
    assert robots.suggestions("topics", "/boxes", panel) is not None
    assert robots.suggestions("topics", "/none", panel) is None
    assert [row.name for row in robots.rows(panel)["topics"] if row.used] == []


def test_topic_of_an_alarms_condition_is_used(tmp_path: Path) -> None:
    file = tmp_path / "cell.toml"
    file.write_text(WITH_ALARM)
    panel = load_panel(file)
    used = uses_of(panel)["topics", "/ready"]
    assert [render(place, "en") for place in used] == ["alarm"]


async def _nowhere() -> Place | None:
    return None


def test_a_robot_that_is_not_there_is_said() -> None:
    async def read() -> None:
        place = Place(zenoh=ZENOH, connect=("tcp/127.0.0.1:9",), within_s=0.2)
        async with listing(place) as robots:
            await until(robots, lambda: robots.fault)
            assert "tcp/127.0.0.1:9" in robots.fault
            assert robots.robot is None

    asyncio.run(read())


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, ""),
        (5.6789, "5.68"),
        (12345.6, "12346"),
        (True, "true"),
        (92, "92"),
        ("RUNNING", "RUNNING"),
        ("a\nb", "a b"),
        ("x" * 40, "x" * 23 + "…"),
        ([1, 2], "[1, 2]"),
    ],
)
def test_a_value_is_a_short_line(value: Any, text: str) -> None:
    assert short(value) == text


def test_words_filter_rows() -> None:
    line = Row("/air", "/air", "std_msgs/msg/Float64", "plc", "", ())
    assert line.matches("AIR plc")
    assert not replace(line, nodes="").matches("air plc")


def test_plain_fields_of_a_message_have_their_paths() -> None:
    interfaces = load_interfaces("jazzy")
    kind = "geometry_msgs/msg/PoseStamped"
    fields = {"header": {"frame_id": "map"}, "pose": {"position": {"x": 1.25}}}
    message = interfaces.decode(kind, interfaces.encode(kind, fields))
    values = dict(fields_of(message, Type(kind), interfaces))
    assert values["header.frame_id"] == "map"
    assert values["pose.position.x"] == "1.25"
    assert values["header.stamp.sec"] == "0"

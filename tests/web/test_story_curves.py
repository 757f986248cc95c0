"""The curves of a story: which values they show, and that they are on the page without scripts."""

import re
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from app.cell.robot.history import FieldHistory
from app.cell.robot.state import RobotState
from app.cell.stops.sources import PanelNames
from app.cell.stops.story import Event, Sort, Source, Stop, Story, story_of
from app.panel.model import Panel
from app.system.texts import render
from app.web.pages.story_curves import AFTER_S, BEFORE_S, MOST_CURVES, StoryCurves, story_curves
from tests.support.builders import panel_of, robot_there
from tests.support.parts import until
from tests.support.servers import demo_server
from tests.web.test_stops import PANEL, keys

WALL: Final = float(round(time.time()) - 60)  # the time of the stop
NUMBER: Final = "std_msgs/msg/Float64"


def pen(topic: str, **more: Any) -> dict[str, Any]:
    return {"topic": topic, "type": NUMBER, "field": "data", "label": topic[1:], **more}


def panel_with(*pens: dict[str, Any], **more: Any) -> Panel:
    return panel_of({"id": "t", "kind": "trend", "label": "T", "window": "60s", "pen": [*pens]}, **more)


def robot_with(panel: Panel, *topics: str, values: Sequence[float] = (1.0, 2.0, 4.0)) -> RobotState:
    """A robot whose topics had these values, one a second, the last one at the stop."""
    robot = robot_there(panel)
    for topic in topics:
        history = robot.history.fields[robot.key(topic), "data"] = FieldHistory(3600.0, 60.0)
        for number, value in enumerate(values):
            history.add(WALL + 1.0 + number - len(values), value)
    return robot


def event(sort: Sort, id: str, source: Source, at: float = WALL - 1.0) -> Event:
    return Event(at, sort, id, id, breaks=True, sources=frozenset({source}))


def story(*events: Event) -> Story:
    return story_of(Stop(WALL, "", "state", 1, "FAULT", "Fault"), events)


def shown(told: Story, panel: Panel, robot: RobotState) -> StoryCurves | None:
    return story_curves(told, PanelNames(panel), robot, time.monotonic(), time.time())


def labels(curves: StoryCurves | None) -> list[str]:
    return [render(curve.label) for curve in curves.curves] if curves else []


def test_those_of_the_first_cause_come_first_and_others_of_its_topic_beside_it() -> None:
    panel = panel_with(pen("/air"), pen("/speed"), pen("/other"))
    robot = robot_with(panel, "/air", "/speed", "/other")
    told = story(
        event("condition", "slow", ("/speed", "data")),
        event("alarm", "low", ("/air", "data"), WALL - 0.5),
    )
    assert told.first is not None
    curves = shown(told, panel, robot)
    assert labels(curves) == ["speed", "air"]
    assert curves is not None
    assert [render(curve.value) for curve in curves.curves] == ["2", "2"]  # a second before the stop
    assert curves.zero_at == round(BEFORE_S / (BEFORE_S + AFTER_S) * 100, 2)
    assert set(curves.ticks) == {
        curves.zero_at,
        round((BEFORE_S + 0.5) / (BEFORE_S + AFTER_S) * 100, 2),
    }


def test_there_are_at_most_three() -> None:
    topics = [f"/t{number}" for number in range(6)]
    panel = panel_with(*map(pen, topics))
    told = story(*(event("condition", topic[1:], (topic, "data")) for topic in topics))
    assert len(labels(shown(told, panel, robot_with(panel, *topics)))) == MOST_CURVES


def test_an_alarm_with_limits_has_a_curve_without_a_trend() -> None:
    alarm = {
        "id": "low", "topic": "/air", "type": NUMBER, "field": "data", "text": "Air low", "low": 1.5,
        "unit": "bar",
    }  # fmt: skip
    panel = panel_of(alarm=[alarm])
    curves = shown(story(event("alarm", "low", ("/air", "data"))), panel, robot_with(panel, "/air"))
    assert curves is not None
    (curve,) = curves.curves
    assert (render(curve.label), render(curve.unit), len(curve.limits)) == ("Air low", "bar", 1)
    assert re.fullmatch(r"M[\d. ]+h0(L[\d. ]+){2}", curve.path)


def test_there_is_none_where_nothing_was_kept_or_named() -> None:
    panel = panel_with(pen("/air"))
    named = event("condition", "air", ("/air", "data"))
    of_link = Event(WALL - 1.0, "link", "", "", breaks=True, sources=frozenset({("/air", "data")}))
    kept = robot_with(panel, "/air")
    assert shown(story(named), panel, kept) is not None
    assert shown(story(of_link), panel, kept) is None
    assert shown(story(named), panel, robot_there(panel)) is None
    assert shown(story(named), panel, robot_with(panel, "/air", values=(1.0, 2.0))) is None
    assert shown(story(event("condition", "x", ("/x", "data"))), panel, kept) is None


def test_the_page_has_them_without_scripts(tmp_path: Path) -> None:
    with demo_server(tmp_path, PANEL) as server:

        def page() -> str:
            texts = (server.http.get(f"/stops/{key}").text for key in keys(server))
            return next((text for text in texts if "story-curves" in text), "")

        text = str(until(page, "a story has a curve", within_s=60))
    assert "<p>Belt is slow</p>" in text
    (path,) = re.findall(r'<path class="line" d="([^"]+)"/>', text)
    assert path.startswith("M")
    assert 'class="limit"' in text
    assert 'class="zero"' in text
    assert "at 0 s" in text

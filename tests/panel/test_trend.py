"""The keys of a trend: what is checked, and what it takes of memory."""

from typing import Any, Final

import pytest
from pydantic import ValidationError

from app.panel.checks.notes import find_notes
from app.panel.checks.panel import find_faults
from app.panel.model import Panel
from app.panel.widgets.trend import MAX_BYTES, Trend, history_bytes, memory_of, trends_of
from app.tools.simulator.kinds import needs_of
from app.tools.simulator.needs import DisplayedField
from tests.support.builders import INTERFACES, Table, panel_of

PEN: Final[Table] = {"topic": "/speed", "type": "std_msgs/msg/Float64", "label": "Speed"}
TREND: Final[Table] = {"id": "course", "kind": "trend", "label": "Course", "pen": [PEN]}


def faults(trend: Table, **more: Any) -> list[str]:
    return [
        f"{fault.place}: {fault.message}" for fault in find_faults(panel_of(trend, **more), INTERFACES)
    ]


def trend(**more: Any) -> Trend:
    return Trend.model_validate({**TREND, **more})


@pytest.mark.parametrize(
    ("pen", "words"),
    [
        ({"low": 5.0, "high": 5.0}, ".low: 5 is not below high, which is 5"),
        ({"normal": [2.0, 1.0]}, ".normal: the first number must be below the second"),
    ],
)  # fmt: skip
def test_faults_of_a_pen_have_its_place(pen: Table, words: str) -> None:
    (fault,) = faults({**TREND, "pen": [PEN, {**PEN, "topic": "/other", **pen}]})
    assert fault.startswith(f"page[0].widget[0].pen[1]{words}")


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"window": "2h", "keep": "1h"}, '.window: "2h" is longer than what is kept, which is "1h"'),
        ({"windows": ["1m", "2d"]}, '.windows[1]: "2d" is longer than what is kept, which is "24h"'),
        ({"min": 2.0, "max": 1.0}, ".min: 2 is not below max, which is 1"),
    ],
)
def test_faults_of_a_trend(keys: Table, words: str) -> None:
    assert faults({**TREND, **keys}) == [f"page[0].widget[0]{words}"]


def test_a_topic_has_one_type_in_all_pens() -> None:
    other = {**PEN, "type": "std_msgs/msg/Float32"}
    (fault,) = faults({**TREND, "pen": [PEN, other]})
    assert "page[0].widget[0].pen[1].type: /speed is std_msgs/msg/Float32 here" in fault


@pytest.mark.parametrize("window", ["10", "5s", "32d", "0m", "1 h", "-1h", "1w"])
def test_invalid_duration_is_refused(window: str) -> None:
    with pytest.raises(ValidationError, match=r"is not a duration|is out of range"):
        trend(window=window)


def test_a_trend_has_one_to_eight_pens() -> None:
    for pens in ([], [PEN] * 9):
        with pytest.raises(ValidationError):
            trend(pen=pens)
    assert len(trend(pen=[PEN] * 8).pens) == 8


def test_the_windows_to_choose_from_have_the_one_shown_first() -> None:
    assert trend(window="10m", windows=["1h", "1m"]).choices == [60, 600, 3600]


def taken(panel: Panel) -> int:
    return memory_of(trends_of(panel), len(panel.robots) or 1)


def many(count: int, **more: Any) -> Panel:
    pens = [{**PEN, "topic": f"/t{n}"} for n in range(count)]
    each = [{**TREND, "id": f"c{i}", "pen": pens[i : i + 8], **more} for i in range(0, count, 8)]
    return panel_of(*each)


def test_all_trends_together_have_a_limit() -> None:
    most = MAX_BYTES // history_bytes(31 * 86_400)
    assert not list(find_faults(many(most, keep="31d"), INTERFACES))
    (fault,) = find_faults(many(most + 1, keep="31d"), INTERFACES)
    assert fault.message.startswith("all trends together would take 128 MB of memory")


def test_a_field_counts_once_and_for_each_robot() -> None:
    robots = [{"id": f"r{n}", "name": f"R{n}", "namespace": f"/r{n}"} for n in range(3)]
    single, shared = panel_of(TREND), panel_of(TREND, {**TREND, "id": "b"})
    assert taken(single) == taken(shared) == history_bytes(86_400)
    assert taken(panel_of(TREND, robot=robots)) == 3 * taken(single)


def test_check_reports_the_memory_of_a_trend() -> None:
    pens = [{**PEN, "topic": f"/t{n}"} for n in range(4)]
    panel = panel_of({**TREND, "pen": pens, "disk": True})
    notes = [note.message for note in find_notes(panel, INTERFACES) if ".widget" in note.place]
    assert notes == ["keeps 24h of 4 pens: 3.9 MB of memory, and as much on disk"]
    single_pen_notes = find_notes(panel_of({**TREND, "pen": pens[:1]}), INTERFACES)
    assert [note.message for note in single_pen_notes][-1:] == ["keeps 24h of 1 pen: 1.0 MB of memory"]


def test_the_simulated_robot_has_each_pen() -> None:
    pens = [PEN, {**PEN, "topic": "/other", "unit": "%", "scale": 100.0}]
    shown = [need for need in needs_of(trend(pen=pens), INTERFACES) if isinstance(need, DisplayedField)]
    rows = [(need.topic, need.unit, need.scale) for need in shown]
    assert rows == [("/speed", "", 1.0), ("/other", "%", 100.0)]

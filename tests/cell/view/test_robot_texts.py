"""A text of the robot is read in its reader's language in every place that shows one."""

import asyncio
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import pytest

from app.cell.alarms.published import entries_of
from app.cell.alarms.states import AlarmInstance, define
from app.cell.commands.goals import FEEDBACK, RESULT
from app.cell.commands.parameters import set_all_request, set_request
from app.cell.commands.press import PressHandle
from app.cell.commands.services import ServiceCalls, with_fields
from app.cell.robot.log_lines import Line
from app.cell.view.view import build_view
from app.panel import check_panel, load_panel
from app.panel.model import Panel
from app.panel.widgets.displays import LogView
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.service_action import Call
from app.ros.messages import Fields
from app.ros.zenoh.sample import Sample
from app.system.errors import PanelError
from app.system.texts import TextLike, render
from app.web.pages.log_lines import line_values, wanted_lines
from tests.cell.commands.test_calls_and_goals import CALL, TRIGGER
from tests.cell.commands.test_calls_and_goals import Line as Link
from tests.support.builders import BRIDGE, INTERFACES, NOW, TEXT, panel_of, robot_there, says

TEXTS: Final = {
    "E101": {"en": "Motor hot", "de": "Motor heiß"},
    "No vacuum. Check/hose": {"en": "The gripper has no vacuum", "de": "Der Greifer hat kein Vakuum"},
}
ARRAY: Final = "diagnostic_msgs/msg/DiagnosticArray"
LAMP: Final = [{"value": "ON", "text": "On", "shape": "circle"}]
SHOWN: Final = {"id": "shown", "label": "Shown", "topic": "/said", "type": TEXT}
LISTED: Final = {"field": "status", "code": "name", "text": "message"}
SPEED: Final = {
    "id": "speed", "kind": "parameter", "label": "Speed", "node": "/arm", "parameter": "speed",
    "type": "double", "min": 0, "max": 1,
}  # fmt: skip


def texts_panel(*widgets: Any, **more: Any) -> Panel:
    return panel_of(*widgets, texts=TEXTS, **more)


def alarm_text(said: tuple[str, str], **source: Any) -> TextLike:
    """The text of the alarm of a status with this (name, message)."""
    panel = texts_panel(alarm=[{"id": "a", "topic": "/d", "type": ARRAY, **source}])
    row: tuple[Any, ...] = said if "list" in source else (said[0], 2, said[1], "", ())
    (entry,) = entries_of(panel.alarms[0], [row], texts=panel.robot_texts)
    return AlarmInstance(next(define(panel, "")), entry=entry).text


def shown(said: str, widget: dict[str, Any], key: str = "text") -> TextLike:
    panel = texts_panel({**SHOWN, **widget})
    robot = robot_there(panel)
    says(robot, "/said", said)
    text: TextLike = build_view(panel, robot, NOW).view["widgets"]["shown"][key]
    return text


def cell(said: str) -> TextLike:
    table = {"kind": "table", "type": ARRAY, "topic": "/parts", "field": "status"}
    columns = [{"label": "Message", "field": "message"}]
    panel = texts_panel({**SHOWN, **table, "column": columns})
    robot = robot_there(panel)
    payload = INTERFACES.encode(ARRAY, {"status": [{"name": "a", "message": said}]})
    sample = Sample(payload, 1, NOW, NOW, BRIDGE)
    robot.update("parts", sample)
    robot.table_entries.record_sample("parts", sample)
    view: Any = build_view(panel, robot, NOW).view["widgets"]["shown"]
    text: TextLike = view["table_rows"][0]["cells"][0]["text"]
    return text


def answer(said: str) -> TextLike:
    """The receipt of a call whose response has this message."""

    async def called() -> TextLike:
        panel = texts_panel(CALL)
        (widget,) = panel.widgets()
        assert isinstance(widget, Call)
        link = Link()
        calls = ServiceCalls(INTERFACES, robot_there(panel), link, lambda _: None)
        request = INTERFACES.encode(f"{TRIGGER}_Request", {})
        call = asyncio.create_task(calls.call(widget, request, PressHandle("p", lambda _: None)))
        while not link.queries:
            await asyncio.sleep(0)
        link.answer(f"{TRIGGER}_Response", success=False, message=said)
        return (await call).text

    return asyncio.run(called())


def parameter_refused(said: str, *, several: bool) -> TextLike:
    panel = texts_panel(SPEED)
    widget = next(panel.parameters())
    assert isinstance(widget, Parameter)
    texts = panel.robot_texts
    request = (
        set_all_request(INTERFACES, "load", [(widget, 0.5)], 1.0, texts, atomically=False)
        if several
        else set_request(INTERFACES, widget, 0.5, texts)
    )
    return request.read(Fields({"results[0].successful": False, "results[0].reason": said})).text


def of_goal(said: str, within: str) -> TextLike:
    return with_fields("{text}", Fields({f"{within}text": said}), within, texts_panel().robot_texts)


def log_line(said: str, language: str) -> str:
    panel = texts_panel({"id": "log", "kind": "log", "label": "Log"})
    (widget,) = panel.widgets()
    assert isinstance(widget, LogView)
    wanted = wanted_lines(panel, widget, language)
    return str(line_values(1, Line(20, 0.0, "arm", said), wanted.translate, language)["text"])


PLACES: Final[dict[str, Callable[[str], TextLike]]] = {
    "text of a list": lambda said: alarm_text(("A7", said), list=LISTED),
    "code of a list": lambda said: alarm_text((said, ""), list=LISTED),
    "diagnostics": lambda said: alarm_text(("arm", said), diagnostics="*"),
    "answer": answer,
    "feedback": lambda said: of_goal(said, FEEDBACK),
    "result": lambda said: of_goal(said, RESULT),
    "parameter": lambda said: parameter_refused(said, several=False),
    "several parameters": lambda said: parameter_refused(said, several=True),
    "readout": lambda said: shown(said, {"kind": "readout"}),
    "lamp": lambda said: shown(said, {"kind": "indicator", "states": LAMP}),
    "table": cell,
}


@pytest.mark.parametrize("place", PLACES)
def test_each_place_has_the_readers_text(place: str) -> None:
    said = PLACES[place]
    for robots, texts in TEXTS.items():
        for language, text in texts.items():
            assert text in render(said(robots), language)
            assert text in render(said(f" {robots} "), language)
    assert "Other words" in render(said("Other words"), "de")


@pytest.mark.parametrize(("language", "text"), TEXTS["E101"].items())
def test_a_line_of_a_log_has_the_readers_text_and_is_found_by_either(language: str, text: str) -> None:
    assert log_line("E101", language) == text
    assert log_line("Other words", language) == "Other words"
    panel = texts_panel({"id": "log", "kind": "log", "label": "Log"})
    (widget,) = panel.widgets()
    assert isinstance(widget, LogView)
    for search, is_found in ((text.upper(), True), ("e101", True), ("vacuum", False)):
        wanted = wanted_lines(panel, widget, language, search=search)
        assert wanted.has(Line(20, 0.0, "arm", "E101")) is is_found


HEAD: Final = 'title = "Cell"\n[[page]]\nid = "p"\ntitle = "P"\n'
READOUT: Final = """[[page.widget]]
id = "said"
kind = "readout"
label = {{ en = "Said", de = "Sagt" }}
topic = "/said"
type = "std_msgs/msg/{kind}"
"""


def panel_file(folder: Path, entry: str, kind: str = "String") -> Path:
    file = folder / "panel.toml"
    file.write_text(f"{HEAD}{READOUT.format(kind=kind)}[texts]\n{entry}\n", encoding="utf-8")
    return file


@pytest.mark.parametrize(
    ("entry", "place", "words"),
    [
        ('" E1" = { en = "Hot" }', "texts. E1", "without spaces around it"),
        ('"" = { en = "Hot" }', "texts.", "a code or a text of the robot"),
        ('E1 = { de = "Heiß" }', "texts.E1", "no text in the panel's language"),
        ('E1 = { en = "Hot", xx = "?" }', "texts.E1.xx", "no language with a catalogue"),
    ],
)
def test_an_invalid_entry_is_a_fault(tmp_path: Path, entry: str, place: str, words: str) -> None:
    with pytest.raises(PanelError) as caught:
        load_panel(panel_file(tmp_path, entry))
    (fault,) = caught.value.faults
    assert fault.place == place
    assert words in fault.message


@pytest.mark.parametrize(
    ("entry", "kind", "place", "words"),
    [
        ('E1 = { en = "Hot" }', "String", "texts.E1", "has no de"),
        ('"a/b. c" = { en = "Hot" }', "String", 'texts."a/b. c"', "has no de"),
        ('E1 = "E1"', "String", "texts.E1", "is what the robot says"),
        ('E1 = "Hot"', "Float64", "texts", "nothing here shows a text of the robot"),
    ],
)
def test_an_entry_that_is_not_used_or_lacks_a_language_is_named(
    tmp_path: Path, entry: str, kind: str, place: str, words: str
) -> None:
    notes = [note for note in own_notes(panel_file(tmp_path, entry, kind))]
    assert [(note.place, words in note.message) for note in notes] == [(place, True)]
    assert notes[0].line == (12 if place != "texts" else 11)


def own_notes(file: Path) -> Iterator[Any]:
    return (note for note in check_panel(file).notes if note.place.startswith("texts"))

"""Commands whose effect shows on a topic, presses that ask first, and buttons that wait."""

import asyncio
import itertools
from pathlib import Path
from typing import Any

import pytest

from app.cell.commands import confirmations
from app.cell.commands.confirmations import Confirmations, equal
from app.cell.commands.receipts import Receipt
from app.cell.robot.sample_handlers import SampleHandlers
from app.cell.robot.state import RobotState, Sample, SkippedPayload
from app.cell.session.ingest import Ingest
from app.panel import load_panel
from app.panel.model import Panel
from app.ros.zenoh.inbox import Changes
from app.system.errors import PanelError
from tests.cell.commands.test_presses import Way
from tests.support.builders import (
    BOOL,
    BRIDGE,
    FREE,
    HEARD,
    INTERFACES,
    MESSAGE,
    TEXT,
    faults_text,
    press_widget,
    presses_of,
    robot_there,
    says,
)
from tests.support.builders import panel_of as panel_with
from tests.support.waiting import pass_time

pytestmark = pytest.mark.promise("receipt")

CONFIRM = {"topic": "/heard", "field": "data", "equals": "{message}", "within_s": 0.2}


def panel_of(**more: Any) -> Panel:
    return panel_with(MESSAGE, {**FREE, "confirm": CONFIRM, **more}, HEARD)


class Desk:
    """Presses on a robot that is there, whose topic says what it says."""

    def __init__(self, panel: Panel) -> None:
        self.now = 100.0
        self.way = Way()
        self.robot: RobotState = robot_there(panel)
        self.confirmations = Confirmations(self.robot, lambda _: None)
        self.presses = presses_of(
            panel,
            self.robot,
            self.way,
            confirmations=self.confirmations,
            monotonic=lambda: self.now,
        )
        self._seq = itertools.count(1)

    async def press(self, text: str = "on", press_id: str = "p1") -> Receipt:
        return await press_widget(self.presses, "free", {"message": text}, press_id)

    def says(self, text: str, at: float) -> None:
        says(self.robot, "/heard", text, at=at, seq=next(self._seq))
        self.confirmations.update(self.robot.key("/heard"), self.robot.reading("/heard"))


def test_only_messages_after_a_command_confirm_it() -> None:
    async def pressed() -> Receipt:
        desk = Desk(panel_of())
        desk.says("on", 99.0)
        press = asyncio.create_task(desk.press())
        await asyncio.sleep(0)
        desk.says("on", 99.9)  # it was on the way before the press
        desk.says("off", 100.1)
        await asyncio.sleep(0)
        assert not press.done()
        desk.says("on", 100.2)
        return await press

    receipt = asyncio.run(pressed())
    assert receipt.outcome == "confirmed"
    assert str(receipt.reason).startswith("Confirmed by the robot at ")


def test_the_name_of_a_constant_confirms_by_its_value() -> None:
    """As the value of an option, too."""
    status = "diagnostic_msgs/msg/DiagnosticStatus"
    options = [{"value": name, "label": name} for name in ("OK", "WARN")]
    select = {"id": "level", "kind": "select", "label": "Level", "options": options}
    confirm = {**CONFIRM, "type": status, "field": "level", "equals": "{level}"}
    press = {**FREE, "type": status, "message": {"level": "{level}"}, "confirm": confirm}

    async def pressed() -> Receipt:
        desk = Desk(panel_with(select, press))
        task = asyncio.create_task(press_widget(desk.presses, "free", {"level": "WARN"}, "p1"))
        await asyncio.sleep(0)
        payload = INTERFACES.encode(status, {"level": 1})
        desk.robot.update("heard", Sample(payload, 9, 100.2, 100.2, BRIDGE))
        desk.confirmations.update("heard", desk.robot.reading("/heard"))
        return await task

    assert asyncio.run(pressed()).outcome == "confirmed"


def test_unread_message_confirms_by_its_arrival_time() -> None:
    """All in one turn: of what came and went before the newest, only what is later than the command."""

    async def pressed(came_at: float) -> Receipt:
        panel = panel_of()
        desk = Desk(panel)
        handlers = SampleHandlers()
        desk.confirmations.register(handlers, panel.confirmations())
        intake = Ingest(panel, desk.robot, handlers)
        press = asyncio.create_task(desk.press())
        await asyncio.sleep(0)
        on, off = (INTERFACES.encode(TEXT, {"data": text}) for text in ("on", "off"))
        between = (SkippedPayload(on, came_at, came_at),)
        newest = Sample(off, 9, 100.2, 100.2, BRIDGE, skipped_payloads=between)
        changes = Changes({desk.robot.key("/heard"): newest}, {}, link_up=True)
        for updates in intake.steps(changes):
            for key, reading in updates.readings:
                desk.confirmations.update(key, reading)
        return await press

    outcomes = [asyncio.run(pressed(came_at)).outcome for came_at in (99.9, 100.1)]
    assert outcomes == ["unknown", "confirmed"]


def test_an_older_entry_does_not_confirm_with_a_message_of_another_node() -> None:
    """Each entry of a list with keys has the time of the last message that had it."""
    state, lift = "sensor_msgs/msg/JointState", "position[name=lift]"
    confirm = {**CONFIRM, "type": state, "field": lift, "equals": 0.5}

    async def pressed() -> Receipt:
        desk = Desk(panel_with(MESSAGE, {**FREE, "confirm": confirm}))

        def says(name: str, at: float) -> None:
            payload = INTERFACES.encode(state, {"name": [name], "position": [0.5]})
            desk.robot.update("heard", Sample(payload, int(at * 10), at, at, BRIDGE))
            desk.confirmations.update("heard", desk.robot.reading("/heard"))

        says("lift", 99.0)
        press = asyncio.create_task(desk.press())
        await asyncio.sleep(0)
        says("finger", 100.1)
        return await press

    assert asyncio.run(pressed()).outcome == "unknown"


def test_command_without_confirmation_is_unknown_and_corrected_later() -> None:
    async def pressed() -> tuple[Receipt, Receipt | None, str]:
        desk = Desk(panel_of())
        first = await desk.press()
        desk.says("on", 101.0)
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        return first, desk.presses.receipt("p1"), desk.robot.command_status["free"].outcome

    first, corrected, shown = asyncio.run(pressed())
    assert first.outcome == "unknown"
    assert str(first.reason).startswith("Sent at ")
    assert "The robot did not confirm it within 0.2 s" in str(first.reason)
    assert corrected is not None
    assert (corrected.outcome, shown) == ("confirmed", "confirmed")


def test_two_commands_with_one_effect_are_confirmed_by_later_messages_only() -> None:
    """The effect of the first came before the second was sent: the second is not known."""

    async def pressed() -> list[Receipt]:
        desk = Desk(panel_of())
        first = asyncio.create_task(desk.press())
        await asyncio.sleep(0)
        desk.says("on", 100.1)
        desk.now = 100.2
        second = asyncio.create_task(desk.press(press_id="p2"))
        return [await first, await second]

    first, second = asyncio.run(pressed())
    assert (first.outcome, second.outcome) == ("confirmed", "unknown")
    assert "did not confirm it" in str(second.reason)


@pytest.mark.parametrize(
    ("said", "outcomes"),
    [
        (["on"], ["confirmed", "unknown"]),
        (["on", "on"], ["confirmed", "confirmed"]),
        (["off", "on"], ["confirmed", "unknown"]),
    ],
)
def test_one_effect_confirms_one_of_two_commands(said: list[str], outcomes: list[str]) -> None:
    async def pressed() -> list[Receipt]:
        desk = Desk(panel_of())
        both = [asyncio.create_task(desk.press(press_id=name)) for name in ("p1", "p2")]
        await asyncio.sleep(0)
        for number, text in enumerate(said):
            desk.says(text, 100.1 + number)
        return [await press for press in both]

    assert [receipt.outcome for receipt in asyncio.run(pressed())] == outcomes


def test_no_confirmation_stays_pending_in_the_long_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(confirmations, "LATE_S", 0.05)

    async def pressed() -> list[Any]:
        desk = Desk(panel_of())
        await asyncio.gather(*(desk.press(press_id=f"p{n}") for n in range(200)))
        await pass_time(1.0)
        return list(desk.confirmations._waiting["heard"])

    assert asyncio.run(pressed()) == []


def test_a_one_shot_button_is_locked_until_its_command_is_answered() -> None:
    async def pressed() -> list[Receipt]:
        desk = Desk(panel_of(one_shot=True))
        first = asyncio.create_task(desk.press())
        await asyncio.sleep(0)
        second = await desk.press(press_id="p2")
        desk.says("on", 100.1)
        await first
        third = await desk.press(press_id="p3")
        assert len(desk.way.sent) == 2
        return [await first, second, third]

    first, second, third = asyncio.run(pressed())
    assert [r.outcome for r in (first, second, third)] == ["confirmed", "refused", "unknown"]
    assert "waiting for the robot" in str(second.reason)


@pytest.mark.parametrize(
    ("value", "wanted", "is_it"),
    [
        (True, True, True),
        (1, True, False),
        (0.10000000149011612, 0.1, True),
        (0.2, 0.1, False),
        (float("nan"), 0.1, False),
        (2.0, 2, True),
        ("on", "on", True),
        (None, "on", False),
    ],
)
def test_confirmation_compares_with_the_precision_of_the_field(
    value: Any, wanted: Any, is_it: bool
) -> None:
    assert equal(value, wanted) is is_it


PANEL = """
title = "Cell"
mode = "demo"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "message"
kind = "text"
label = "Message"
[[page.widget]]
id = "fan"
kind = "toggle"
label = "Fan"
[[page.widget]]
id = "go"
kind = "publish"
label = "Start"
topic = "/operation"
type = "std_msgs/msg/String"
message = { data = "{message}" }
{more}
"""
CONFIRMED = 'confirm = { topic = "/last_heard", equals = "{message} (/operation)"%s }'
TYPED = CONFIRMED % ', type = "std_msgs/msg/String"'


def panel_file(folder: Path, more: str) -> Path:
    path = folder / "panel.toml"
    path.write_text(PANEL.replace("{more}", more))
    return path


@pytest.mark.parametrize(
    ("more", "fault"),
    [
        ("one_shot = true", "page[0].widget[2].one_shot: needs `confirm`"),
        (CONFIRMED % "", "page[0].widget[2].confirm.type: is missing: nothing else in the panel says"),
        (
            'confirm = { topic = "/last_heard", type = "std_msgs/msg/Bool", equals = "x" }',
            'page[0].widget[2].confirm.equals: must be true or false (bool), not "x"',
        ),
        (
            'confirm = { topic = "/s", type = "std_msgs/msg/UInt8", equals = 300 }',
            "page[0].widget[2].confirm.equals: 300 is out of range: uint8",
        ),
        (
            'confirm = { topic = "/s", type = "std_msgs/msg/Bool", equals = "{messag}" }',
            'page[0].widget[2].confirm.equals: no input "messag"; did you mean "message"?',
        ),
        (
            'confirm = { topic = "/s", type = "std_msgs/msg/Bool", field = "dat", equals = true }',
            "page[0].widget[2].confirm.field:",
        ),
    ],
)
def test_faulty_confirmation_is_reported_at_load(tmp_path: Path, more: str, fault: str) -> None:
    with pytest.raises(PanelError) as caught:
        load_panel(panel_file(tmp_path, more))
    assert fault in faults_text(caught.value)


def test_confirmation_uses_the_topics_type_in_the_panel(tmp_path: Path) -> None:
    interlock = f'\n[[interlock]]\nid = "a"\ntopic = "/last"\ntype = "{BOOL}"\n'
    path = panel_file(tmp_path, 'confirm = { topic = "/last", equals = "{fan}" }' + interlock)
    assert load_panel(path).subscriptions() == {"/last": BOOL}

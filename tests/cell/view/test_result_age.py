"""The result of a press looks old after some seconds, and goes."""

import math
import re
from collections.abc import Callable
from typing import Any, Final

import pytest

from app.cell.commands.services import with_reply
from app.cell.permission.roles import BY_ONE
from app.cell.view.times import AGED_S, BAD_S, GOOD_S, result_age
from app.cell.view.view import build_view
from app.records.entry import CommandStatus, CommandStatuses, OutcomeCode
from app.system.texts import Text, TextLike, joined, say
from app.system.texts.catalogue import ENGLISH, sentences
from tests.support.builders import NOW, panel_of, robot_there
from tests.support.words import english

CALL: Final = {
    "id": "light",
    "kind": "call",
    "label": "Light",
    "service": "/light",
    "type": "std_srvs/srv/Trigger",
}
WALL: Final = 1_790_000_000.0


def shown(status: CommandStatus, age_s: float) -> Any:
    panel = panel_of(CALL)
    robot = robot_there(panel)
    robot.command_status = CommandStatuses(lambda: NOW, lambda: WALL)
    robot.command_status["light"] = status
    return english(build_view(panel, robot, NOW + age_s).view["widgets"]["light"])


@pytest.mark.parametrize(
    ("outcome", "kept_s"),
    [("succeeded", GOOD_S), ("confirmed", GOOD_S), ("rejected", BAD_S), ("unknown", BAD_S)],
)
def test_a_result_ages_and_goes_in_every_browser(outcome: OutcomeCode, kept_s: float) -> None:
    status = CommandStatus(outcome=outcome, text="The light is on")
    view = shown(status, AGED_S - 0.1)
    assert (view["result"], view["aged"], view["outcome"]) == ("The light is on", False, outcome)
    view = shown(status, AGED_S)
    assert view["aged"]
    assert view["result"].startswith("The light is on (")
    assert ":" in view["result"]
    assert shown(status, kept_s - 0.1)["result"] == view["result"]
    view = shown(status, kept_s)
    assert (view["result"], view["outcome"], view["aged"]) == ("", "", False)


DATED: Final = ("published", "goal_succeeded", "goal_canceled", "goal_aborted", "goal_rejected",
                "goal_still_in_progress", "cancel_sent", "call_succeeded", "confirmed")  # fmt: skip
AS_SHOWN: Final[dict[str, Callable[[Text], TextLike]]] = {
    "alone": lambda text: text,
    "with_stop": lambda text: with_reply(text, ""),
    "with_reply": lambda text: with_reply(text, "pallet full"),
    "with_reason": lambda text: with_reply(text, say("nav2_goal_occupied", error=206)),
    "with_person": lambda text: joined((with_reply(text, ""), say(BY_ONE["pin"], user="Sato"))),
    "not_in_log": lambda text: say("log_not_on_disk", said=text, why="disk full"),
}


@pytest.mark.parametrize("frame", AS_SHOWN)
@pytest.mark.parametrize("code", DATED)
def test_a_text_that_has_its_time_gets_no_second_one(code: str, frame: str) -> None:
    assert "{time}" in sentences(ENGLISH)[code]
    text = AS_SHOWN[frame](say(code, topic="/light", service="/light", time="14:02:11"))
    view = shown(CommandStatus(outcome="succeeded", text=text), AGED_S)
    assert view["aged"]
    assert re.findall(r"\d\d:\d\d:\d\d", view["result"]) == ["14:02:11"]


def test_the_time_of_something_else_is_not_that_of_the_result() -> None:
    changed = say("recipe_changed_since", name="Carton", by="Sato", time="14:02:11")
    view = shown(
        CommandStatus(outcome="unknown", text=say("goal_recovery_failed", why=changed)), AGED_S
    )
    assert len(re.findall(r"\d\d:\d\d:\d\d", view["result"])) == 2


def test_what_is_under_way_does_not_age() -> None:
    status = CommandStatus(busy=True, outcome="accepted", text="Accepted")
    assert result_age(status, (NOW, WALL), NOW + 1000) == ({}, math.inf)


def test_the_view_is_made_again_when_it_ages_and_when_it_goes() -> None:
    status = CommandStatus(outcome="succeeded", text="Done")
    assert result_age(status, (NOW, WALL), NOW)[1] == NOW + AGED_S
    assert result_age(status, (NOW, WALL), NOW + AGED_S)[1] == NOW + GOOD_S


def test_the_same_status_again_is_no_new_result() -> None:
    times = iter([1.0, 2.0])
    statuses = CommandStatuses(lambda: next(times), lambda: WALL)
    statuses["light"] = CommandStatus(outcome="succeeded", text="Done")
    statuses["light"] = CommandStatus(outcome="succeeded", text="Done")
    assert statuses.set_at["light"] == (1.0, WALL)
    statuses["light"] = CommandStatus(outcome="rejected", text="No")
    assert statuses.set_at["light"] == (2.0, WALL)

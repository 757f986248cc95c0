"""The question for the reasons of stops: whose they are, and what becomes of it by further stops and by
answers."""

import asyncio
from collections.abc import Callable
from datetime import datetime
from typing import Any, Final

import pytest

from app.cell.alarms.shown import OpenStop
from app.cell.session.fleet import Fleet
from app.cell.session.stops import ask_reason, asked_together, reason_given
from app.records import NullLog
from app.ros.zenoh.config import config_to
from app.system.texts import render
from tests.support.builders import panel_of

NOWHERE: Final = "tcp/127.0.0.1:1"
STATE: Final = {
    "topic": "/state",
    "type": "std_msgs/msg/String",
    "states": [{"value": "RUNNING", "text": "Running", "shape": "play"}],
}
OEE: Final = {"reason_after_s": 60.0, "reason": [{"id": "material", "label": "Material"}]}
ENDS: Final = datetime(2026, 6, 1, 14, 0).timestamp()
NAMES: Final[dict[int, dict[str, Any]]] = {
    0: {},
    1: {"left": "Left"},
    2: {"left": "Left", "right": {"en": "Right", "de": "Rechts", "ja": "右"}},
}
# How many robots there are, whose stops they are → the question in each language.
TOGETHER: Final = {
    "the only robot": (
        0, ["", ""],
        {
            "en": "Stops without a reason: 2 | Say why before the shift ends.",
            "de": "Stillstände ohne Grund: 2 | Bitte vor Schichtende angeben.",
            "ja": "理由が未回答の停止：2 | シフト終了前に回答してください。",
        },
    ),
    "one with a name": (
        1, ["left"], {"en": "Stops without a reason: 1 | Say why before the shift ends."}
    ),
    "of both": (
        2, ["right", "left", "right"],
        {
            "en": "Stops without a reason: 3 | Left: 1, Right: 2. Say why before the shift ends.",
            "de": "Stillstände ohne Grund: 3 | Left: 1, Rechts: 2. Bitte vor Schichtende angeben.",
            "ja": "理由が未回答の停止：3 | Left：1、右：2。シフト終了前に回答してください。",
        },
    ),
    "of one of two": (
        2, ["right"], {"en": "Stops without a reason: 1 | Right: 1. Say why before the shift ends."}
    ),
}  # fmt: skip


def fleet_of(robots: int, **oee: Any) -> Fleet:
    """On an event loop only. `oee` are further keys of the panel's `[oee]`."""
    entries = [{"id": id, "name": name, "namespace": f"/{id}"} for id, name in NAMES[robots].items()]
    panel = panel_of(languages=["en", "de", "ja"], state=STATE, oee=OEE | oee, robot=entries)
    return Fleet(panel, lambda _: config_to(NOWHERE), "r1", NullLog())


def question(fleet: Fleet, language: str = "en") -> str:
    asked = fleet.alarms.asked
    if asked is None:
        return ""
    return " | ".join(render(text, language) for text in (asked["text"], asked["times"]))


@pytest.mark.parametrize("case", TOGETHER)
def test_the_question_names_the_robots_if_there_are_several(case: str) -> None:
    robots, of_robots, texts = TOGETHER[case]

    async def scene() -> None:
        fleet = fleet_of(robots)
        stops = [OpenStop(robot=robot, began=100.0 * n) for n, robot in enumerate(of_robots)]
        fleet.alarms.ask(asked_together(fleet.panel.robot_names, stops, ENDS))
        assert {language: question(fleet, language) for language in texts} == texts
        await fleet.stop()

    asyncio.run(scene())


# What happens, after a question about these stops (robot, began) → the stops that are asked then.
LEFT_1, LEFT_2, RIGHT, RIGHT_NEW = (
    ("left", 1_000.0), ("left", 2_000.0), ("right", 3_000.0), ("right", ENDS - 300.0)
)  # fmt: skip
NEXT: Final[dict[str, tuple[Any, Callable[[Fleet], None], Any]]] = {
    "an answer": ([LEFT_1, LEFT_2, RIGHT], lambda fleet: reason_given(fleet, *LEFT_1), [LEFT_2, RIGHT]),
    "an answer about another robot": (
        [LEFT_1, RIGHT], lambda fleet: reason_given(fleet, "right", 1_000.0), [LEFT_1, RIGHT]
    ),
    "the last answer": ([RIGHT], lambda fleet: reason_given(fleet, *RIGHT), None),
    "a robot's next stop joins those of others": (
        [LEFT_1, RIGHT],
        lambda fleet: ask_reason(fleet, *RIGHT_NEW, ENDS - 60),
        [LEFT_1, RIGHT, RIGHT_NEW],
    ),
    "it takes the place of its own": (
        [RIGHT], lambda fleet: ask_reason(fleet, *RIGHT_NEW, ENDS - 60), [RIGHT_NEW]
    ),
    "and of those of the last shift": (
        [LEFT_1], lambda fleet: ask_reason(fleet, *RIGHT_NEW, ENDS + 60), [RIGHT_NEW]
    ),
    "a short stop is not asked": (
        [LEFT_1], lambda fleet: ask_reason(fleet, *RIGHT_NEW, ENDS - 280), [LEFT_1]
    ),
}  # fmt: skip


def test_stops_of_two_robots_are_asked_together_only_before_the_shift_ends() -> None:
    async def scene() -> None:
        fleet = fleet_of(2)
        for before_s, asked_of in ((3_600.0, ["right"]), (600.0, ["left", "right"])):
            fleet.alarms.ask(None)
            for robot in ("left", "right"):
                ask_reason(fleet, robot, ENDS - before_s - 90.0, ENDS - before_s)
            asked = fleet.alarms.asked
            assert asked
            assert [stop["robot"] for stop in asked["stops"]] == asked_of
        await fleet.stop()

    asyncio.run(scene())


@pytest.mark.parametrize("case", NEXT)
def test_the_question_changes(case: str) -> None:
    before, act, after = NEXT[case]

    async def scene() -> None:
        fleet = fleet_of(2)
        stops = [OpenStop(robot=robot, began=began) for robot, began in before]
        fleet.alarms.ask(asked_together(fleet.panel.robot_names, stops, ENDS))
        act(fleet)
        asked = fleet.alarms.asked
        named = asked and [(stop["robot"], stop["began"]) for stop in asked["stops"]]
        assert named == after
        await fleet.stop()

    asyncio.run(scene())


def test_a_break_is_no_stop_that_is_asked() -> None:
    """The rule is `is_short_stop`, in tests/cell/stops/test_oee.py."""

    async def scene() -> None:
        fleet = fleet_of(0, breaks=["09:30-09:45"])
        begin = datetime(2026, 6, 1, 9, 30).timestamp()
        for lasted_s, is_asked in ((930.0, False), (960.0, True)):
            ask_reason(fleet, "", begin, begin + lasted_s)
            assert bool(fleet.alarms.asked) is is_asked
        await fleet.stop()

    asyncio.run(scene())


def test_the_question_after_a_stop_names_its_robot_if_there_are_several() -> None:
    async def scene() -> None:
        for robots, robot, text in (
            (0, "", "Stood still for 5 min"),
            (1, "left", "Stood still for 5 min"),
            (2, "right", "Right stood still for 5 min"),
        ):
            fleet = fleet_of(robots)
            ask_reason(fleet, robot, ENDS, ENDS + 300.0)
            assert question(fleet).startswith(text)
            await fleet.stop()

    asyncio.run(scene())

"""The event streams of clients with and without control: one view for each role, encoded once."""

import asyncio
from collections.abc import Mapping
from contextlib import AsyncExitStack
from typing import Any

import pytest

from app.cell.permission.control import ControlAuthority
from app.cell.view import publisher as module
from app.cell.view.publisher import ViewPublisher
from app.cell.view.view import (
    Audience,
    ViewContext,
    ViewWithDeadlines,
    audience,
    audience_of,
    build_view,
)
from app.panel.rules import ControlRules
from app.records.principal import Clients, Principal
from app.system.texts import ENGLISH
from app.web.metrics import Open
from app.web.routes.events import EventStream
from tests.support.builders import (
    FREE,
    GUARDED,
    HEARD,
    MESSAGE,
    NOW,
    panel_of,
    permits,
    robot_there,
    says,
)
from tests.support.words import english
from tests.web.test_events import SCOPE, Client, run, turns

STREAMS = 500
PANEL = panel_of(MESSAGE, FREE, GUARDED, HEARD, control={"required": True})
RULES = ControlRules(required=True)


class Room:
    """A robot that permits, a control authority, and streams of clients with cookies."""

    def __init__(self) -> None:
        self.robot = robot_there(PANEL)
        permits(self.robot)
        self.control = ControlAuthority(RULES, "", monotonic=lambda: NOW)
        built = self.build()
        self.publisher = ViewPublisher(built.view, "r1", built.without_control)
        self._clients = Clients()

    def build(self) -> ViewWithDeadlines:
        control = self.control
        context = ViewContext(control=control.view(), control_lock=control.lock)
        return build_view(PANEL, self.robot, NOW, context)

    def post(self) -> None:
        built = self.build()
        self.publisher.post(built.view, built.without_control)

    def who(self, number: int) -> Principal:
        return Principal(self._clients.identify(f"{number:032x}", "192.0.2.1"))

    async def stream(self, number: int, until: AsyncExitStack) -> Client:
        client, who = Client(), self.who(number)
        stream = EventStream(
            self.publisher,
            b"",
            Open(),
            audience=lambda: audience_of(who, self.publisher.view["control"], RULES, ENGLISH),
        )
        task = asyncio.create_task(stream(SCOPE, client.receive, client.send))

        async def ended() -> None:
            client.go()
            await asyncio.gather(task, return_exceptions=True)

        until.push_async_callback(ended)
        return client


def test_client_without_control_is_locked_and_unlocked_with_control() -> None:
    async def work() -> None:
        room = Room()
        async with AsyncExitStack() as until:
            ann, bob = await room.stream(1, until), await room.stream(2, until)
            await turns()
            for client in (ann, bob):
                (snapshot,) = client.events("snapshot")
                free = {"enabled": False, "reason": english(room.control.lock.reason)}
                assert snapshot["widgets"]["free"] == free
                assert snapshot["control"]["role"] == "free"
            room.control.take(room.who(1))
            room.post()
            await turns()
            changed = {"free": {"enabled": True, "reason": None}}
            (update,) = ann.events("update")
            assert update["free"] == changed["free"]
            assert ann.events("control")[0]["role"] == "holding"
            (locked,) = bob.events("update")
            assert locked["free"] == {"reason": english(room.control.lock.reason)}
            held = bob.events("control")[0]
            assert (held["role"], held["shown"]) == ("held", english(room.control.lock.reason))

    run(work)


def test_500_streams_share_encoded_events(monkeypatch: pytest.MonkeyPatch) -> None:
    encoded: list[Mapping[str, Any]] = []
    encode = module.encoded

    def counted(data: Mapping[str, Any], language: str) -> bytes:
        encoded.append(data)
        return encode(data, language)

    async def work() -> None:
        room = Room()
        room.control.take(room.who(1))
        room.control.ask(room.who(2))
        room.post()
        async with AsyncExitStack() as until:
            monkeypatch.setattr(module, "encoded", counted)
            clients = [await room.stream(number, until) for number in range(1, STREAMS + 1)]
            await turns()
            assert len(encoded) == 3  # a snapshot for who holds, who asks, and all others
            encoded.clear()
            says(room.robot, "/heard", "hello")
            room.post()
            await turns()
            assert len(encoded) == 3
            assert all(client.events("update") for client in clients)
            encoded.clear()
            room.control.give(room.who(1), room.who(2).client.id)
            room.post()
            await turns()
            # `control` for two roles, and `update` for who got control, who gave it, and all others.
            assert len(encoded) == 5
            assert all(client.events("control") for client in clients)
            assert len({bytes(client.got[-1]["body"]) for client in clients}) == 3

    run(work)


def test_without_control_in_the_panel_file_all_streams_are_one() -> None:
    room = Room()
    publisher = room.publisher
    assert publisher.for_audience() is publisher.view
    held = audience("held", "de")
    assert held == Audience(has_control=False, role="held", language="de")
    assert publisher.for_audience(held) is publisher.for_audience(audience("held", "ja"))
    assert audience("asked").has_control

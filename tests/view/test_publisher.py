"""The newest view for everybody: snapshots, differences, shared bytes, no queue."""

import asyncio
import json
from collections.abc import Coroutine
from typing import Any

import pytest

from app.printable import printable
from app.robot.state import Robot
from app.view.publisher import Board
from app.view.view import View, sight
from tests.support.builders import NOW, permits, robot_there, says, small_panel
from tests.support.parts import events_in

PANEL = small_panel()


@pytest.fixture
def robot() -> Robot:
    return robot_there(PANEL)


@pytest.fixture
def board(robot: Robot) -> Board:
    return Board(view_of(robot), "r1")


def view_of(robot: Robot, **more: Any) -> View:
    return sight(PANEL, robot, NOW, **more).view


def events(chunk: bytes) -> dict[str, Any]:
    """Event name → data; the events of one chunk have different names."""
    found = events_in(chunk.decode())
    assert len({name for name, _, _ in found}) == len(found)
    return {name: json.loads(data) for name, data, _ in found}


def run(work: Coroutine[Any, Any, None]) -> None:
    """A wait that does not end fails."""
    asyncio.run(asyncio.wait_for(work, 10))


def test_a_snapshot_is_everything_that_the_page_shows(board: Board) -> None:
    assert events(board.snapshot()) == {"snapshot": {"id": board.id, "revision": "r1", **board.view}}


def test_every_event_has_the_id_of_the_version_it_leads_to(board: Board, robot: Robot) -> None:
    old = board.view
    permits(robot)
    board.post(view_of(robot, fault="x"))
    ids = {event_id for _, _, event_id in events_in(board.since(1, old).decode())}
    assert ids == {f"{board.boot}-2"}


def test_each_start_has_its_own_boot(board: Board) -> None:
    assert Board(board.view, "r1").boot != board.boot


def test_a_changed_permission_is_sent_by_its_name_and_at_its_widgets(
    board: Board, robot: Robot
) -> None:
    old = board.view
    permits(robot)
    board.post(view_of(robot))
    assert events(board.since(1, old)) == {
        "operation-enabled-updated": {"enabled": True, "reason": None},
        "update": {"guarded": {"enabled": True, "reason": None}},
        "link": board.view["link"],  # the node locks nothing any more
    }


def test_of_a_widget_only_what_changed_is_sent(board: Board, robot: Robot) -> None:
    says(robot, "/heard", "one")
    board.post(view_of(robot))
    old = board.view
    says(robot, "/heard", "two")
    board.post(view_of(robot))
    assert events(board.since(2, old)) == {"update": {"heard": {"text": "two"}}}


def test_a_changed_light_is_sent_with_all_lights(board: Board, robot: Robot) -> None:
    old = board.view
    robot.graph.answered({})
    board.post(view_of(robot))
    sent = events(board.since(1, old))
    assert sent["link"] == board.view["link"]
    assert sent["link"]["bridge"]["text"] == "no answer"


def test_a_changed_notice_is_sent(board: Board, robot: Robot) -> None:
    old = board.view
    board.post(view_of(robot, fault="cell.toml can't be used"))
    assert events(board.since(1, old)) == {"notice": {"banner": "", "fault": "cell.toml can't be used"}}


def test_the_same_view_again_is_no_new_version(board: Board, robot: Robot) -> None:
    board.post(view_of(robot))
    assert board.version == 1


def test_a_slow_reader_skips_to_the_newest(board: Board, robot: Robot) -> None:
    old = board.view
    for word in ("one", "two", "three"):
        says(robot, "/heard", word)
        board.post(view_of(robot))
    assert events(board.since(1, old))["update"]["heard"]["text"] == "three"
    assert b"two" not in board.since(1, old)


def test_what_changed_and_changed_back_is_not_sent(board: Board, robot: Robot) -> None:
    old = board.view
    board.post(view_of(robot, fault="x"))
    board.post(view_of(robot))
    assert (board.version, board.since(1, old)) == (3, b"")


def test_streams_that_are_equally_far_share_the_same_bytes(board: Board, robot: Robot) -> None:
    old = board.view
    permits(robot)
    board.post(view_of(robot))
    assert board.since(1, old) is board.since(1, old)
    assert board.snapshot() is board.snapshot()


def test_prepared_bytes_are_never_of_an_older_view(board: Board, robot: Robot) -> None:
    old = board.view
    for word in ("one", "two"):
        says(robot, "/heard", word)
        board.post(view_of(robot))
        assert events(board.since(1, old))["update"]["heard"]["text"] == word
        assert events(board.snapshot())["snapshot"]["widgets"]["heard"]["text"] == word


@pytest.mark.parametrize("text", ["two\nlines", "event: x\n\n", "\u2028 \x85 \r", '"}', "漢 🤖"])
def test_no_text_of_the_robots_breaks_the_stream(board: Board, robot: Robot, text: str) -> None:
    old = board.view
    says(robot, "/heard", text)
    board.post(view_of(robot))
    assert list(events(board.since(1, old))) == ["update"]
    assert events(board.since(1, old))["update"]["heard"]["text"] == printable(text)
    for sent in (board.since(1, old), board.snapshot()):
        assert len(sent.decode().splitlines()) == sent.count(b"\n")


def test_what_says_all_of_something_is_encoded_once_for_streams_however_far(
    board: Board, robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    views = [board.view]
    for word in ("one", "two"):
        says(robot, "/heard", word)
        board.post(view_of(robot))
        views.append(board.view)
    permits(robot)
    board.post(view_of(robot))
    encoded: list[Any] = []

    def encode(data: Any) -> bytes:
        encoded.append(data)
        return json.dumps(data).encode()

    monkeypatch.setattr("app.view.publisher.encoded", encode)
    sent = [events(board.since(version, view)) for version, view in enumerate(views, 1)]
    assert all(one["operation-enabled-updated"] == {"enabled": True, "reason": None} for one in sent)
    assert all(one["link"] == board.view["link"] for one in sent)
    assert [one["update"] for one in sent] == encoded[1:2] + encoded[3:]
    assert len(encoded) == 5  # the permission and the links once, the widgets for each


def test_who_is_behind_does_not_wait(board: Board, robot: Robot) -> None:
    permits(robot)
    board.post(view_of(robot))
    run(board.news(1, 0))


def test_who_waits_is_woken_by_a_new_view(board: Board, robot: Robot) -> None:
    permits(robot)
    new = view_of(robot)

    async def woken() -> None:
        asyncio.get_running_loop().call_soon(board.post, new)
        await board.news(1, 0)

    run(woken())
    assert board.version == 2


def test_all_who_wait_are_woken(board: Board, robot: Robot) -> None:
    permits(robot)
    new = view_of(robot)

    async def woken() -> None:
        asyncio.get_running_loop().call_soon(board.post, new)
        await asyncio.gather(*(board.news(1, 0) for _ in range(5)))

    run(woken())


def test_who_waits_is_woken_by_the_heartbeat(board: Board) -> None:
    async def woken() -> None:
        with board.heartbeat.heard():
            await board.news(1, 0)

    run(woken())
    assert (board.version, board.heartbeat.count) == (1, 1)


def test_the_end_wakes_who_waits(board: Board) -> None:
    async def woken() -> None:
        asyncio.get_running_loop().call_soon(board.close)
        await board.news(1, 0)

    run(woken())
    assert board.closed


def test_after_the_end_nobody_waits(board: Board) -> None:
    board.close()
    run(board.news(1, 0))


def test_the_board_knows_when_a_lock_has_last_turned(board: Board, robot: Robot) -> None:
    assert (board.turned("guarded"), board.turned("free")) == (0, 0)
    permits(robot)
    board.post(view_of(robot))
    assert (board.turned("guarded"), board.turned("free")) == (2, 0)
    board.post(view_of(robot, fault="x"))
    permits(robot, False)
    board.post(view_of(robot))
    assert (board.turned("guarded"), board.turned("free")) == (4, 0)

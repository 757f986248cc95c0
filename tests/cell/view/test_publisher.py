"""The newest view for everyone: snapshots, differences, shared bytes, no queue."""

import asyncio
import json
from collections.abc import Coroutine
from pathlib import Path
from typing import Any

import pytest

from app.cell.robot.state import RobotState
from app.cell.view.publisher import ViewPublisher, by_change
from app.cell.view.view import View, ViewContext, audience, build_view
from app.system.printable import printable
from app.system.texts import localized
from app.system.texts.catalogue import catalogues_in
from tests.support.builders import GUARDED, NOW, panel_of, permits, robot_there, says, small_panel
from tests.support.parts import events_in
from tests.support.words import english

pytestmark = pytest.mark.promise("reconnect")

PANEL = small_panel()


@pytest.fixture
def robot() -> RobotState:
    return robot_there(PANEL)


@pytest.fixture
def publisher(robot: RobotState) -> ViewPublisher:
    return ViewPublisher(view_of(robot), "r1")


def view_of(robot: RobotState, **context: Any) -> View:
    return build_view(PANEL, robot, NOW, ViewContext(**context)).view


def events(chunk: bytes) -> dict[str, Any]:
    """Event name → data; the events of one chunk have different names."""
    received = events_in(chunk.decode())
    assert len({name for name, _, _ in received}) == len(received)
    return {name: json.loads(data) for name, data, _ in received}


def run(work: Coroutine[Any, Any, None]) -> None:
    """A wait that does not end fails."""
    asyncio.run(asyncio.wait_for(work, 10))


def test_a_snapshot_is_everything_that_the_page_shows(publisher: ViewPublisher) -> None:
    assert events(publisher.snapshot()) == {
        "snapshot": {"id": publisher.id, "revision": "r1", **english(publisher.view)}
    }


def test_every_event_has_the_id_of_the_version_it_leads_to(
    publisher: ViewPublisher, robot: RobotState
) -> None:
    old = publisher.view
    permits(robot)
    publisher.post(view_of(robot, fault="x"))
    ids = {event_id for _, _, event_id in events_in(publisher.events_since(1, old).decode())}
    assert ids == {f"{publisher.instance_id}-2"}


def test_each_start_has_its_own_boot(publisher: ViewPublisher) -> None:
    assert ViewPublisher(publisher.view, "r1").instance_id != publisher.instance_id


def test_a_changed_permission_is_sent_by_its_name_and_at_its_widgets(
    publisher: ViewPublisher, robot: RobotState
) -> None:
    old = publisher.view
    permits(robot)
    publisher.post(view_of(robot))
    assert events(publisher.events_since(1, old)) == {
        "operation-enabled-updated": {"enabled": True, "reason": None},
        "update": {"guarded": {"enabled": True, "reason": None}},
        "link": english(publisher.view["link"]),  # the node locks nothing any more
    }


def test_only_changed_attributes_of_a_widget_are_sent(
    publisher: ViewPublisher, robot: RobotState
) -> None:
    says(robot, "/heard", "one")
    publisher.post(view_of(robot))
    old = publisher.view
    says(robot, "/heard", "two")
    publisher.post(view_of(robot))
    assert events(publisher.events_since(2, old)) == {"update": {"heard": {"text": "two"}}}


def test_a_page_gets_its_own_widgets_only(robot: RobotState) -> None:
    pages = {"one": {"guarded"}, "two": {"heard"}}
    publisher = ViewPublisher(view_of(robot), "r1", pages=pages)
    shown = ("one", "two", "")
    snapshots = {page: events(publisher.snapshot(page=page))["snapshot"] for page in shown}
    assert {page: set(snapshots[page]["widgets"]) for page in pages} == pages
    assert set(snapshots[""]["widgets"]) == set(publisher.view["widgets"])
    assert [publisher.shown_page(page) for page in ("one", "gone")] == ["one", ""]
    old = publisher.view
    says(robot, "/heard", "one")
    publisher.post(view_of(robot))
    sent = {page: events(publisher.events_since(1, old, page=page)) for page in shown}
    assert sent["one"] == {}
    assert set(sent["two"]["update"]) == set(sent[""]["update"]) == {"heard"}
    permits(robot)
    publisher.post(view_of(robot))
    late = events(publisher.events_since(1, old, page="one"))
    assert set(late["update"]) == {"guarded"}
    assert "operation-enabled-updated" not in late  # it shows that in its keys and its frame


def test_keys_change_before_the_frame_around_them_on_a_page_too(robot: RobotState) -> None:
    publisher = ViewPublisher(view_of(robot), "r1", pages={"one": {"guarded"}})
    old = publisher.view
    permits(robot)
    publisher.post(view_of(robot))
    for page in ("one", ""):
        sent = list(events(publisher.events_since(1, old, page=page)))
        permission = [] if page else ["operation-enabled-updated"]
        assert sent == [*permission, "update", "link"], page


def test_a_changed_light_is_sent_with_all_lights(publisher: ViewPublisher, robot: RobotState) -> None:
    old = publisher.view
    robot.graph.update_versions({})
    publisher.post(view_of(robot))
    sent = events(publisher.events_since(1, old))
    assert sent["link"] == english(publisher.view["link"])
    assert sent["link"]["bridge"]["text"] == "no response"


def test_a_changed_notice_is_sent(publisher: ViewPublisher, robot: RobotState) -> None:
    old = publisher.view
    publisher.post(view_of(robot, fault="cell.toml can't be used"))
    assert events(publisher.events_since(1, old)) == {
        "notice": {"banner": "", "fault": "cell.toml can't be used"}
    }


def test_the_same_view_again_is_no_new_version(publisher: ViewPublisher, robot: RobotState) -> None:
    publisher.post(view_of(robot))
    assert publisher.version == 1


def test_a_slow_reader_skips_to_the_newest(publisher: ViewPublisher, robot: RobotState) -> None:
    old = publisher.view
    for word in ("one", "two", "three"):
        says(robot, "/heard", word)
        publisher.post(view_of(robot))
    assert events(publisher.events_since(1, old))["update"]["heard"]["text"] == "three"
    assert b"two" not in publisher.events_since(1, old)


def test_value_that_changed_back_is_not_sent(publisher: ViewPublisher, robot: RobotState) -> None:
    old = publisher.view
    publisher.post(view_of(robot, fault="x"))
    publisher.post(view_of(robot))
    assert (publisher.version, publisher.events_since(1, old)) == (3, b"")


def test_streams_that_are_equally_far_share_the_same_bytes(
    publisher: ViewPublisher, robot: RobotState
) -> None:
    old = publisher.view
    permits(robot)
    publisher.post(view_of(robot))
    assert publisher.events_since(1, old) is publisher.events_since(1, old)
    assert publisher.snapshot() is publisher.snapshot()


def test_prepared_bytes_are_never_of_an_older_view(publisher: ViewPublisher, robot: RobotState) -> None:
    old = publisher.view
    for word in ("one", "two"):
        says(robot, "/heard", word)
        publisher.post(view_of(robot))
        assert events(publisher.events_since(1, old))["update"]["heard"]["text"] == word
        assert events(publisher.snapshot())["snapshot"]["widgets"]["heard"]["text"] == word


@pytest.mark.parametrize("text", ["two\nlines", "event: x\n\n", "\u2028 \x85 \r", '"}', "漢 🤖"])
def test_no_text_of_the_robots_breaks_the_stream(
    publisher: ViewPublisher, robot: RobotState, text: str
) -> None:
    old = publisher.view
    says(robot, "/heard", text)
    publisher.post(view_of(robot))
    assert list(events(publisher.events_since(1, old))) == ["update"]
    assert events(publisher.events_since(1, old))["update"]["heard"]["text"] == printable(text)
    for sent in (publisher.events_since(1, old), publisher.snapshot()):
        assert len(sent.decode().splitlines()) == sent.count(b"\n")


def test_complete_events_are_encoded_once_for_all_streams(
    publisher: ViewPublisher, robot: RobotState, monkeypatch: pytest.MonkeyPatch
) -> None:
    views = [publisher.view]
    for word in ("one", "two"):
        says(robot, "/heard", word)
        publisher.post(view_of(robot))
        views.append(publisher.view)
    permits(robot)
    publisher.post(view_of(robot))
    encoded: list[Any] = []

    def encode(data: Any, language: str) -> bytes:
        encoded.append(localized(data, language))
        return json.dumps(encoded[-1]).encode()

    monkeypatch.setattr("app.cell.view.publisher.encoded", encode)
    sent = [events(publisher.events_since(version, view)) for version, view in enumerate(views, 1)]
    assert all(
        event["operation-enabled-updated"] == {"enabled": True, "reason": None} for event in sent
    )
    assert all(event["link"] == english(publisher.view["link"]) for event in sent)
    assert [event["update"] for event in sent] == encoded[1:2] + encoded[3:]
    assert len(encoded) == 5  # the permission and the links once, the widgets for each


def test_events_of_each_language_are_encoded_once(
    publisher: ViewPublisher, robot: RobotState, tmp_path: Path
) -> None:
    (tmp_path / "de.po").write_text('msgid "locks_nothing"\nmsgstr "Sperrt nichts."\n')
    old = publisher.view
    permits(robot)
    publisher.post(view_of(robot))
    with catalogues_in(tmp_path):
        readers = audience("", "de")
        german, sent = publisher.events_since(1, old, readers), publisher.events_since(1, old)
        assert events(german)["link"]["node"]["locks"] == "Sperrt nichts."
        assert events(publisher.snapshot(readers))["snapshot"]["link"] == events(german)["link"]
        assert events(sent)["link"]["node"]["locks"] == "Locks nothing."
        assert events(sent) == events(publisher.events_since(1, old))
        assert publisher.events_since(1, old, readers) is german


def test_subscriber_that_is_behind_does_not_wait(publisher: ViewPublisher, robot: RobotState) -> None:
    permits(robot)
    publisher.post(view_of(robot))
    run(publisher.wait_for_change(1, 0))


def test_waiting_stream_is_woken_by_a_new_view(publisher: ViewPublisher, robot: RobotState) -> None:
    permits(robot)
    new = view_of(robot)

    async def woken() -> None:
        asyncio.get_running_loop().call_soon(publisher.post, new)
        await publisher.wait_for_change(1, 0)

    run(woken())
    assert publisher.version == 2


def test_all_waiting_tasks_are_woken(publisher: ViewPublisher, robot: RobotState) -> None:
    permits(robot)
    new = view_of(robot)

    async def woken() -> None:
        asyncio.get_running_loop().call_soon(publisher.post, new)
        await asyncio.gather(*(publisher.wait_for_change(1, 0) for _ in range(5)))

    run(woken())


def test_waiting_stream_is_woken_by_the_heartbeat(publisher: ViewPublisher) -> None:
    async def woken() -> None:
        with publisher.heartbeat.heard():
            await publisher.wait_for_change(1, 0)

    run(woken())
    assert (publisher.version, publisher.heartbeat.count) == (1, 1)


def test_shutdown_wakes_waiting_tasks(publisher: ViewPublisher) -> None:
    async def woken() -> None:
        asyncio.get_running_loop().call_soon(publisher.close)
        await publisher.wait_for_change(1, 0)

    run(woken())
    assert publisher.closed


def test_after_the_end_no_one_waits(publisher: ViewPublisher) -> None:
    publisher.close()
    run(publisher.wait_for_change(1, 0))


def test_the_board_knows_when_a_lock_has_last_turned(
    publisher: ViewPublisher, robot: RobotState
) -> None:
    assert (publisher.lock_changed_at("guarded"), publisher.lock_changed_at("free")) == (0, 0)
    permits(robot)
    publisher.post(view_of(robot))
    assert (publisher.lock_changed_at("guarded"), publisher.lock_changed_at("free")) == (2, 0)
    publisher.post(view_of(robot, fault="x"))
    permits(robot, False)
    publisher.post(view_of(robot))
    assert (publisher.lock_changed_at("guarded"), publisher.lock_changed_at("free")) == (4, 0)


def test_a_lock_of_many_buttons_is_sent_once_to_a_page() -> None:
    """By the name of their group, whatever their number; programs that name no page get each of
    them."""
    sizes = {}
    for count in (3, 300):
        buttons = [{**GUARDED, "id": f"b{number}", "label": f"B{number}"} for number in range(count)]
        panel = panel_of(*buttons)
        robot = robot_there(panel)
        ids = [button["id"] for button in buttons]
        view, page = build_view(panel, robot, NOW).view, panel.pages[0].id
        mine = ViewPublisher(view, "r1", {}, panel.widgets_by_page, alike=[ids])
        assert events(mine.snapshot(page=page))["snapshot"]["groups"] == {"0": ids}
        assert "groups" not in events(mine.snapshot())["snapshot"]
        old = mine.view
        permits(robot)
        mine.post(build_view(panel, robot, NOW).view)
        chunk = mine.events_since(1, old, page=page)
        lock = {"enabled": True, "reason": None}
        sent = events(chunk)
        assert sent["updates"] == {"groups": [{"group": "0", "attributes": lock}]}
        assert "update" not in sent
        everything = events(mine.events_since(1, old))
        assert everything["update"] == {button["id"]: lock for button in buttons}
        assert "updates" not in everything
        assert all(mine.lock_changed_at(button["id"]) == 2 for button in buttons)
        sizes[count] = len(chunk)
    assert sizes[300] == sizes[3]


def test_of_a_group_that_changes_in_part_each_widget_is_named() -> None:
    lock, other = {"enabled": False}, {"enabled": True}
    widgets = {"a": lock, "b": lock, "c": other}
    groups = {"0": ["a", "b", "c"], "1": ["b", "c"]}
    assert by_change(widgets, groups) == {
        "updates": {"groups": [{"widgets": ["a", "b"], "attributes": lock}]},
        "update": {"c": other},
    }

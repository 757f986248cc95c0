"""What the page shows of the robot: lights, permissions, readouts, and when time changes them."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from app.cell.robot.state import RobotState, Sample
from app.cell.view import view as view_module
from app.cell.view.displays import LONGEST_TEXT, readout, written
from app.cell.view.kinds import attributes_of
from app.cell.view.view import View, ViewContext, build_view, update_displays
from app.panel.widgets.families import BaseWidget
from app.ros.dialects.bridge_dialect import bridge_token, server_token
from app.ros.dialects.dialect import DEMO_VERSION
from app.system.clock import format_time
from tests.support.builders import (
    BOOL,
    BRIDGE,
    DIALECT,
    ENABLED,
    HEARD,
    INTERFACES,
    NOW,
    TRAITS,
    endpoint,
    panel_of,
    permits,
    robot_there,
    says,
    small_panel,
)
from tests.support.words import english

PANEL = small_panel()


@pytest.fixture
def robot() -> RobotState:
    return robot_there(PANEL)


def view_of(robot: RobotState, now: float = NOW, **context: Any) -> View:
    return build_view(PANEL, robot, now, ViewContext(**context)).view


def heard(robot: RobotState, now: float = NOW, **widget: Any) -> tuple[dict[str, Any], float]:
    """The readout of /heard, and when time changes it."""
    panel = panel_of({**HEARD, **widget})
    built = build_view(panel, robot, now)
    return built.view["widgets"]["heard"], built.until


def test_a_view_has_every_widget_and_interlock(robot: RobotState) -> None:
    view = view_of(robot)
    assert list(view["widgets"]) == ["message", "free", "guarded", "heard"]
    assert list(view["interlocks"]) == ["operation"]


def test_a_widget_shows_that_it_can_be_pressed(robot: RobotState) -> None:
    permits(robot)
    assert view_of(robot)["widgets"]["guarded"] == {"enabled": True, "reason": None}


def test_a_locked_widget_shows_the_reason_of_its_interlock(robot: RobotState) -> None:
    view = view_of(robot)
    assert view["widgets"]["guarded"] == view["interlocks"]["operation"]
    assert english(view["widgets"]["guarded"]) == {
        "enabled": False,
        "reason": "Locked: /operation_enabled is not known yet.",
    }


def test_an_interlock_locks_no_widget_but_its_own(robot: RobotState) -> None:
    assert view_of(robot)["widgets"]["free"] == {"enabled": True, "reason": None}


def test_a_text_input_shows_nothing_of_the_robot(robot: RobotState) -> None:
    assert view_of(robot)["widgets"]["message"] == {}


@pytest.mark.parametrize(("simulated", "banner"), [(True, "SIMULATED ROBOT"), (False, "")])
def test_a_demo_shows_its_banner(robot: RobotState, simulated: bool, banner: str) -> None:
    assert english(view_of(robot, simulated=simulated)["notice"]["banner"]) == banner


def test_a_demo_robot_behind_a_live_panel_shows_the_banner_too(robot: RobotState) -> None:
    robot.graph.update_versions({BRIDGE: DEMO_VERSION})
    assert english(view_of(robot)["notice"]["banner"]) == "SIMULATED ROBOT"


def test_the_banner_of_a_demo_is_there_while_nothing_is_connected() -> None:
    view = view_of(RobotState(PANEL, INTERFACES, DIALECT, TRAITS), simulated=True)
    assert english(view["notice"]["banner"]) == "SIMULATED ROBOT"


def test_a_fault_of_the_panel_file_is_shown(robot: RobotState) -> None:
    assert (
        view_of(robot, fault="cell.toml can't be used")["notice"]["fault"] == "cell.toml can't be used"
    )


def no_link(robot: RobotState) -> None:
    robot.link_up = False


def no_bridge(robot: RobotState) -> None:
    robot.graph.apply_token(bridge_token(BRIDGE), False)


def silent(robot: RobotState) -> None:
    robot.graph.update_versions({})


def joining(robot: RobotState) -> None:
    robot.settled_at = math.inf


def node(robot: RobotState) -> None:
    endpoint(robot, "MS", "/free", "std_msgs/msg/String")


def nothing(robot: RobotState) -> None:
    pass


@pytest.mark.parametrize(
    ("change", "bridge", "on_robot"),
    [
        (no_link, ("bad", "no connection"), ("bad", "no connection")),
        (no_bridge, ("bad", "not found"), ("bad", "no connection")),
        (silent, ("bad", "no response"), ("bad", "no connection")),
        (joining, ("wait", "connecting"), ("wait", "no node found")),
        (nothing, ("ok", "ok"), ("wait", "no node found")),
        (node, ("ok", "ok"), ("ok", "ok")),
    ],
)
def test_the_lights_show_how_far_the_way_goes(
    robot: RobotState,
    change: Callable[[RobotState], None],
    bridge: tuple[str, str],
    on_robot: tuple[str, str],
) -> None:
    change(robot)
    link = view_of(robot)["link"]
    assert english([(lamp["state"], lamp["text"]) for lamp in link.values()]) == [
        ("ok", "ok"),
        bridge,
        on_robot,
    ]
    assert english([lamp["name"] for lamp in link.values()]) == ["Server", "Bridge", "Robot"]


@pytest.mark.parametrize(
    ("role", "topic", "present"),
    [
        ("MP", "/heard", True),
        ("MP", ENABLED, True),
        ("MS", "/guarded", True),
        ("MS", "/heard", False),
        ("MP", "/free", False),
        ("MP", "/other", False),
    ],
)
def test_only_nodes_that_the_panel_uses_count_as_the_node(
    robot: RobotState, role: Any, topic: str, present: bool
) -> None:
    endpoint(robot, role, topic, BOOL)
    assert (view_of(robot)["link"]["node"]["state"] == "ok") is present


@pytest.mark.parametrize(("service", "state"), [("reset", "ok"), ("other", "wait")])
def test_a_node_that_only_serves_is_seen_too(service: str, state: str) -> None:
    trigger = "std_srvs/srv/Trigger"
    reset = {"id": "reset", "kind": "call", "label": "R", "service": "/reset", "type": trigger}
    panel = panel_of(reset)
    robot = robot_there(panel)
    robot.graph.apply_token(server_token(BRIDGE, "SS", service, trigger), True)
    assert build_view(panel, robot, NOW).view["link"]["node"]["state"] == state


def test_a_readout_waits_for_its_topic(robot: RobotState) -> None:
    assert english(heard(robot)) == (
        {"state": "waiting", "text": "—", "note": "waiting for data"},
        math.inf,
    )


@pytest.mark.usefixtures("utc")
def test_a_readout_shows_value_and_time_of_reception(robot: RobotState) -> None:
    says(robot, "/heard", "hello", at=3661.0)
    assert english(heard(robot, 9999.0)) == (
        {"state": "live", "text": "hello", "note": "received 01:01:01"},
        math.inf,
    )


@pytest.mark.usefixtures("utc")
def test_a_readout_from_before_a_cut_says_so(robot: RobotState) -> None:
    says(robot, "/heard", "hello", at=3661.0)
    robot.mark_peer_lost(BRIDGE, 2)
    shown, _ = heard(robot)
    assert english(shown) == {
        "state": "old",
        "text": "hello",
        "note": "from before the connection was lost, received 01:01:01",
    }


def test_a_readout_that_can_not_be_read_says_so(robot: RobotState) -> None:
    robot.update("heard", Sample(b"broken", 1, NOW, NOW, BRIDGE))
    shown, _ = heard(robot)
    assert (shown["state"], shown["text"]) == ("unreadable", "—")
    assert english(shown["note"]) == "cannot be read: the data received is not std_msgs/msg/String"


def test_a_readout_of_a_topic_of_another_type_says_so(robot: RobotState) -> None:
    says(robot, "/heard", "hello")
    endpoint(robot, "MP", "/heard", BOOL)
    shown, _ = heard(robot)
    assert shown["state"] == "unreadable"
    assert str(shown["note"]).startswith("/heard is std_msgs/msg/Bool on the robot")


def test_value_unreadable_before_a_cut_is_waited_for(robot: RobotState) -> None:
    robot.update("heard", Sample(b"broken", 1, NOW, NOW, BRIDGE))
    robot.mark_peer_lost(BRIDGE, 2)
    assert heard(robot)[0]["state"] == "waiting"


@pytest.mark.parametrize(
    ("age", "state", "note", "changes_at"),
    [
        (0.0, "live", None, 5.0),
        (4.9, "live", None, 5.0),
        (5.0, "old", "5 s old", 6.0),
        (59.5, "old", "59 s old", 60.0),
        (60.0, "old", "1 min old", 120.0),
        (7200.0, "old", "2 h old", 7260.0),
    ],
)
def test_a_readout_with_a_greatest_age_says_its_age(
    robot: RobotState, age: float, state: str, note: str | None, changes_at: float
) -> None:
    says(robot, "/heard", "hello", at=NOW)
    shown, until = heard(robot, NOW + age, max_age_s=5)
    assert (shown["state"], shown["text"]) == (state, "hello")
    assert english(shown["note"]) == (note or f"received {format_time(NOW)}")
    assert until == NOW + changes_at


def test_a_readout_shows_a_field_inside() -> None:
    header = "std_msgs/msg/Header"
    panel = panel_of({**HEARD, "type": header, "field": "stamp.sec"})
    robot = robot_there(panel)
    payload = INTERFACES.encode(header, {"stamp": {"sec": 5, "nanosec": 0}, "frame_id": ""})
    robot.update("heard", Sample(payload, 1, NOW, NOW, BRIDGE))
    assert build_view(panel, robot, NOW).view["widgets"]["heard"]["text"] == "5"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (True, "true"),
        (False, "false"),
        (-7, "-7"),
        (0.5, "0.5"),
        (math.nan, "NaN"),
        (math.inf, "Infinity"),
        (-math.inf, "-Infinity"),
        (2**64 - 1, "18446744073709551615"),
        (-(2**63), "-9223372036854775808"),
        (None, "—"),
        ("", ""),
        ("<b>\n", "<b>\n"),
        ("x" * LONGEST_TEXT, "x" * LONGEST_TEXT),
        ("x" * (LONGEST_TEXT + 1), "x" * (LONGEST_TEXT - 1) + "…"),
    ],
)
def test_a_value_is_written_as_text(value: Any, text: str) -> None:
    assert written(value) == text


def test_the_view_changes_when_the_first_of_its_times_comes(robot: RobotState) -> None:
    panel = panel_of({**HEARD, "max_age_s": 9}, interlock={"max_age_s": 2})
    endpoint(robot, "MP", ENABLED, BOOL)
    permits(robot, at=NOW)
    says(robot, "/heard", "hello", at=NOW)
    assert build_view(panel, robot, NOW + 1).until == NOW + 2
    assert build_view(panel, robot, NOW + 3).until == NOW + 9


def test_a_view_that_time_does_not_change_needs_no_timer(robot: RobotState) -> None:
    permits(robot)
    assert build_view(PANEL, robot, NOW).until == math.inf


def test_view_is_due_when_joining_ends(robot: RobotState) -> None:
    robot.settled_at = NOW + 1
    assert build_view(PANEL, robot, NOW).until == NOW + 1


def test_a_readout_alone_gives_attributes_and_time(robot: RobotState) -> None:
    widget: Any = next(w for w in PANEL.widgets() if w.id == "heard")
    assert readout(widget, robot, NOW)[0]["state"] == "waiting"


def test_a_widget_that_cannot_be_shown_leaves_the_others(
    robot: RobotState, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Displays and commands, in the whole view and in a frame of values; it is tried again."""
    fine = build_view(PANEL, robot, NOW)
    names = [widget.id for widget in (*PANEL.commands[:1], *PANEL.displays[:1])]

    def fail(widget: BaseWidget, *parameters: Any) -> Any:
        if widget.id in names:
            raise ValueError(widget.id)
        return attributes_of(widget, *parameters)

    monkeypatch.setattr(view_module, "attributes_of", fail)
    built = build_view(PANEL, robot, NOW)
    frame = update_displays(fine, PANEL.displays, robot, NOW)
    command, display = (built.view["widgets"][name] for name in names)
    assert (command["enabled"], command["reason"].code) == (False, "widget_failed")
    assert frame.view["widgets"][names[1]] == display
    assert (display["state"], display["note"].code) == ("unreadable", "widget_failed")
    assert set(built.failures) == set(names)
    assert set(frame.failures) == {names[1]}
    assert frame.displays[names[1]] == NOW + 1.0
    for name in fine.view["widgets"].keys() - set(names):
        assert built.view["widgets"][name] == fine.view["widgets"][name]
    monkeypatch.undo()
    again = update_displays(frame, PANEL.displays, robot, NOW)
    assert (again.view, again.failures) == (fine.view, {})

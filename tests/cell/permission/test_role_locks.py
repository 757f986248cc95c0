"""What a role may press: the needs of commands, the check of a press, and the view of an audience."""

import json
from collections.abc import Mapping
from typing import Any, Final

import pytest

from app.cell.permission.press_permission import ServerConditions, cause_of, judged
from app.cell.permission.roles import strictest
from app.cell.view.publisher import ViewPublisher
from app.cell.view.view import EVERYONE, View, audience, audience_of, build_view
from app.panel.model import Panel
from app.panel.roles import ROLES
from app.records.principal import Principal, anonymous
from tests.support.builders import (
    ENABLED,
    FREE,
    MESSAGE,
    NOW,
    permits,
    robot_there,
)
from tests.support.words import english

STOP: Final = {**FREE, "id": "halt", "label": "Halt", "role": "stop"}
GRIPPER: Final = {**FREE, "id": "gripper", "needs": "tooling"}
OPEN: Final = {**FREE, "id": "open"}
SETTLED: Final = {**FREE, "id": "settled"}
HEARD: Final = {
    "id": "seen", "kind": "readout", "label": "Seen", "topic": "/seen", "type": "std_msgs/msg/String",
}  # fmt: skip


def panel() -> Panel:
    return Panel.model_validate(
        {
            "title": "Cell",
            "frame": {"widget": [STOP]},
            "page": [
                {"id": "work", "title": "Work", "widget": [MESSAGE, OPEN, GRIPPER]},
                {
                    "id": "setup",
                    "title": "Setup",
                    "needs": "maintenance",
                    "widget": [HEARD],
                    "group": [{"title": "Deep", "needs": "engineer", "widget": [SETTLED]}],
                },
            ],
        }
    )


PANEL: Final = panel()


def who(role: str, *groups: str) -> Principal:
    return Principal(anonymous("127.0.0.1"), "anna", role, frozenset(groups))


def verdicts(principal: Principal) -> dict[str, str]:
    """The code of each command's verdict."""
    robot = robot_there(PANEL)
    conditions = ServerConditions(who=principal, needs=PANEL.needs.commands)
    return {
        command.id: judged(command, PANEL.interlocks_of(command), robot, NOW, conditions).code
        for command in PANEL.commands
    }


def test_a_command_needs_what_is_said_at_itself_its_group_and_its_page() -> None:
    assert PANEL.needs.commands == {
        "halt": frozenset(),
        "open": {"operator"},
        "gripper": {"operator", "tooling"},
        "settled": {"operator", "maintenance", "engineer"},
    }
    assert PANEL.needs.pages == {"setup": "maintenance"}
    assert PANEL.needs.named == {"operator", "tooling", "maintenance", "engineer"}


@pytest.mark.parametrize(
    ("principal", "permitted"),
    [
        (who("viewer"), {"halt"}),
        (who("operator"), {"halt", "open"}),
        (who("operator", "tooling"), {"halt", "open", "gripper"}),
        (who("maintenance"), {"halt", "open"}),
        (who("engineer"), {"halt", "open", "gripper", "settled"}),
    ],
)
def test_a_press_is_refused_without_the_role(principal: Principal, permitted: set[str]) -> None:
    codes = verdicts(principal)
    assert {name for name, code in codes.items() if code == "permitted"} == permitted
    assert {code for name, code in codes.items() if name not in permitted} <= {"role_needed"}
    assert cause_of("role_needed") == "role"


def test_the_highest_role_is_named_and_a_group_before_it() -> None:
    assert strictest({"operator", "engineer", "maintenance"}) == "engineer"
    assert strictest({"operator", "tooling"}) == "tooling"


def publisher_at_work() -> ViewPublisher:
    robot = robot_there(PANEL)
    pages = PANEL.widgets_by_page
    return ViewPublisher(build_view(PANEL, robot, NOW).view, "r1", pages=pages, needs=PANEL.needs)


def shown_to(principal: Principal, publisher: ViewPublisher) -> View:
    control, named = publisher.view["control"], PANEL.needs.named
    return publisher.for_audience(audience_of(principal, control, PANEL.control, "en", needs=named))


def locks(widgets: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: english(shown["reason"])
        for name, shown in widgets.items()
        if shown.get("enabled") is False
    }


def test_a_viewer_sees_locks_that_say_what_to_do_and_no_hidden_page() -> None:
    shown = shown_to(who("viewer"), publisher_at_work())
    assert locks(shown["widgets"]) == {
        "open": "Sign in as Operator.",
        "gripper": "Sign in as tooling.",
    }
    assert not {"seen", "settled"} & shown["widgets"].keys()


def test_maintenance_sees_its_page_with_the_part_of_the_engineer_locked() -> None:
    shown = shown_to(who("maintenance", "tooling"), publisher_at_work())
    assert locks(shown["widgets"]) == {"settled": "Sign in as Engineer."}
    assert "seen" in shown["widgets"]


def test_a_client_that_meets_every_need_has_the_view_as_it_is() -> None:
    publisher = publisher_at_work()
    assert shown_to(who("engineer"), publisher) is publisher.view
    control = publisher.view["control"]
    named = PANEL.needs.named
    assert audience_of(who("engineer"), control, PANEL.control, "en", needs=named) == audience("")
    assert audience("") == EVERYONE


def test_a_group_of_buttons_names_none_that_the_client_does_not_see() -> None:
    pages = PANEL.widgets_by_page
    (page,) = (name for name, widgets in pages.items() if {"seen", "settled"} <= {*widgets})
    view = build_view(PANEL, robot_there(PANEL), NOW).view
    alike = [["seen", "settled"]]
    publisher = ViewPublisher(view, "r1", pages=pages, needs=PANEL.needs, alike=alike)
    viewer = audience("", lacks=frozenset(PANEL.needs.named))
    groups = {who: snapshot_of(publisher.snapshot(who, page))["groups"] for who in (viewer, EVERYONE)}
    assert groups == {viewer: {"0": []}, EVERYONE: {"0": ["seen", "settled"]}}


def snapshot_of(event: bytes) -> dict[str, Any]:
    data: dict[str, Any] = json.loads(event.split(b"data: ", 1)[1].split(b"\n", 1)[0])
    return data


def test_the_events_after_a_sign_in_unlock_and_bring_what_was_hidden() -> None:
    publisher = publisher_at_work()
    lacks = frozenset(PANEL.needs.named)
    viewer, engineer = audience("", lacks=lacks), audience("")
    before, version = publisher.for_audience(viewer), publisher.version
    publisher.renew_audiences()
    chunk = publisher.events_since(version, before, engineer, before=viewer).decode()
    assert '"open":{"enabled":true' in chunk
    assert '"seen":{' in chunk
    assert "Sign in" not in chunk
    assert publisher.events_since(version, publisher.view, engineer) == b""


@pytest.mark.parametrize("role", ROLES)
def test_the_view_and_the_check_of_a_press_agree(role: str) -> None:
    """Each command that the view shows as locked by the role is refused, and no other."""
    shown = shown_to(who(role), publisher_at_work())["widgets"]
    refused = {name for name, code in verdicts(who(role)).items() if code == "role_needed"}
    locked = {name for name, reason in locks(shown).items() if "Sign in" in reason}
    hidden = {command.id for command in PANEL.commands} - shown.keys()
    assert locked | hidden == refused


def test_an_interlock_does_not_open_what_the_role_locks() -> None:
    interlock = {"id": "operation", "topic": ENABLED}
    guarded = {**FREE, "id": "guarded", "interlock": "operation"}
    page = {"id": "one", "title": "One", "widget": [MESSAGE, guarded]}
    mine = Panel.model_validate({"title": "Cell", "interlock": [interlock], "page": [page]})
    robot = robot_there(mine)
    permits(robot)
    command = mine.commands[0]
    for role, code in (("viewer", "role_needed"), ("operator", "permitted")):
        conditions = ServerConditions(who=who(role), needs=mine.needs.commands)
        assert judged(command, mine.interlocks_of(command), robot, NOW, conditions).code == code

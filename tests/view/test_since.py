"""Since when each link is as it is, by a clock that the test sets."""

import pytest

from app.dialect.bridge_dialect import bridge_token
from app.i18n import render
from app.view.link_status import Since
from app.view.view import build_view
from tests.support.builders import BRIDGE, NOW, TEXT, endpoint, robot_there, small_panel

DAY_S = 86_400.0


pytestmark = pytest.mark.usefixtures("utc")


class Seen:
    """A robot's links as they are dated, at a wall clock that is set by hand."""

    def __init__(self) -> None:
        self.panel = small_panel()
        self.robot = robot_there(self.panel)
        self.wall = 0.0
        self._since = Since(lambda: self.wall)

    def at(self, wall: float) -> tuple[str, str, str]:
        """`since` of server, bridge and node at a time of the wall clock."""
        self.wall = wall
        link = self._since.dated(build_view(self.panel, self.robot, NOW).view["link"])
        server, bridge, node = (render(lamp["since"]) for lamp in link.values())
        return server, bridge, node


def test_a_state_began_when_it_was_seen_first() -> None:
    seen = Seen()
    assert seen.at(61.0) == ("", "1970-01-01 00:01:01", "1970-01-01 00:01:01")
    assert seen.at(3 * DAY_S) == ("", "1970-01-01 00:01:01", "1970-01-01 00:01:01")


def test_each_link_has_its_own_time() -> None:
    seen = Seen()
    seen.at(1.0)
    endpoint(seen.robot, "MP", "/heard", TEXT)
    assert seen.at(DAY_S + 2) == ("", "1970-01-01 00:00:01", "1970-01-02 00:00:02")
    seen.robot.graph.apply_token(bridge_token(BRIDGE), False)
    assert seen.at(DAY_S + 3) == ("", "1970-01-02 00:00:03", "1970-01-02 00:00:03")


def test_a_new_reason_is_not_a_new_state() -> None:
    seen = Seen()
    endpoint(seen.robot, "MP", "/heard", TEXT)
    before = seen.at(1.0)
    endpoint(seen.robot, "MP", "/operation_enabled", TEXT)
    assert seen.at(2.0) == before


def test_a_clock_that_is_set_back_changes_no_time_that_was_noted() -> None:
    seen = Seen()
    before = seen.at(DAY_S)
    assert seen.at(1.0) == before


def test_what_is_dated_is_else_as_it_was() -> None:
    seen = Seen()
    plain = build_view(seen.panel, seen.robot, NOW).view["link"]
    dated = Since(lambda: 0.0).dated(plain)
    assert {name: {**lamp, "since": ""} for name, lamp in dated.items()} == plain
    assert plain["bridge"]["since"] == ""

"""The three links: which of them locks a control, what is said of each, when a node is silent."""

import ast
import math

import pytest

from app.cell.permission.verdict import PERMITTED, Verdict
from app.cell.robot.parameter_state import ParameterState
from app.cell.robot.state import RobotState
from app.cell.view.link_status import (
    LONGEST_LIST,
    NODE,
    PEER,
    LinkStatus,
    LinkTimes,
    labels,
    link_statuses,
    locks,
)
from app.cell.view.view import ViewContext, build_view
from app.panel.model import Panel
from app.panel.numbers import Range
from app.panel.widgets.parameter import DESCRIBE, GET, SET
from app.ros.dialects.bridge_dialect import bridge_token, server_token
from app.ros.messages.names import Qos
from app.system.settings import PACKAGE
from app.system.texts import Text, render, say
from tests.support.builders import (
    BOOL,
    ENABLED,
    FREE,
    HEARD,
    MESSAGE,
    NOTHING,
    NOW,
    TEXT,
    Table,
    endpoint,
    panel_of,
    permits,
    robot_there,
    says,
    small_panel,
)
from tests.support.builders import BRIDGE as BRIDGE_ZID
from tests.support.words import coded, english

GUARDED = {**FREE, "id": "guarded", "label": "Guarded", "topic": "/guarded", "interlock": "operation"}
AGED = {**HEARD, "max_age_s": 5.0}
DAY_S = 86_400.0


SPEED = {
    "id": "speed",
    "kind": "parameter",
    "label": "Speed",
    "node": "/arm",
    "parameter": "speed",
    "type": "double",
    "max": 2.0,
}


def cell(interlock: Table = NOTHING) -> Panel:
    return panel_of(MESSAGE, FREE, GUARDED, HEARD, interlock=interlock)


def links_of(
    panel: Panel, robot: RobotState, now: float = NOW, log_lock: str = ""
) -> dict[str, LinkStatus]:
    robot.update_publishers()
    return build_view(panel, robot, now, ViewContext(log_lock=log_lock)).view["link"]


LOCKS_NOTHING = say("locks_nothing")
WAITS = say("interlock_waiting", topic=ENABLED, wanted=BOOL)


def locking(*names: str) -> Text:
    return say("locks", names=names)


def codes_of(module: str) -> set[str]:
    """The codes of all verdicts that a module makes: the text that `locked` or `Verdict` is given."""
    tree = ast.parse((PACKAGE / f"{module}.py").read_text())
    calls = (node for node in ast.walk(tree) if isinstance(node, ast.Call))
    made = [c for c in calls if isinstance(c.func, ast.Name) and c.func.id in ("locked", "Verdict")]
    constants = {
        n.value for c in made for a in c.args for n in ast.walk(a) if isinstance(n, ast.Constant)
    }
    return {code for code in constants if isinstance(code, str)}


# By the operator's own side or the robot's word: no link is to blame.
NO_LINK = frozenset(
    {
        "permitted",
        "interlock_not_permitted",
        "step_value_outside_limits",
        "interlock_condition_unmet",
        "press_in_progress",
        "goal_may_be_running",
        "log",
        "control",
        "parameter_undeclared",
        "parameter_mistyped",
        "parameter_read_only",
        "parameter_no_common_value",
    }
)


def test_every_verdict_has_its_link_or_none() -> None:
    assert len(PEER | NODE | NO_LINK) == len(PEER) + len(NODE) + len(NO_LINK)
    made = codes_of("cell/permission/interlocks") | codes_of("cell/permission/conditions")
    assert {"interlock_stale", "interlock_not_permitted", "link_connecting"} <= made
    assert made - {""} <= PEER | NODE | NO_LINK


@pytest.mark.parametrize("code", sorted(PEER | NODE | NO_LINK))
def test_a_verdict_locks_by_its_link_only(code: str) -> None:
    panel = panel_of(FREE)
    verdicts = {"free": Verdict(code == "permitted", code)}
    by = [labels(panel, verdicts, codes) for codes in (PEER, NODE)]
    assert by == [["Free"] if code in codes else [] for codes in (PEER, NODE)]


def test_missing_bridge_locks_all_and_the_node_nothing() -> None:
    panel = cell()
    robot = robot_there(panel)
    robot.graph.apply_token(bridge_token(BRIDGE_ZID), False)
    link = links_of(panel, robot)
    assert link["bridge"]["locks"] == locking("Free", "Guarded")
    assert coded(link["bridge"]["reason"]) == ("link_no_bridge",)
    assert (link["node"]["locks"], link["server"]["locks"]) == (LOCKS_NOTHING, LOCKS_NOTHING)
    assert link["node"]["reason"] == say("link_node_unknown")


def test_a_value_that_is_waited_for_locks_by_the_node() -> None:
    panel = cell()
    robot = robot_there(panel)
    endpoint(robot, "MP", ENABLED, BOOL)
    link = links_of(panel, robot)
    assert link["bridge"]["locks"] == LOCKS_NOTHING
    assert link["node"]["locks"] == locking("Guarded")
    assert link["node"]["reason"] == WAITS
    assert link["node"]["state"] == "ok"


def test_lock_by_the_robot_is_no_fault_of_a_link() -> None:
    panel = cell()
    robot = robot_there(panel)
    endpoint(robot, "MP", ENABLED, BOOL)
    permits(robot, False)
    link = links_of(panel, robot)
    assert {lamp["locks"] for lamp in link.values()} == {LOCKS_NOTHING}
    assert {lamp["reason"] for lamp in link.values()} == {""}


@pytest.mark.parametrize(
    ("known", "code", "about"),
    [
        (ParameterState("live", 1.0, read_only=True), "parameter_read_only", {"name": "speed"}),
        (ParameterState("undeclared"), "parameter_undeclared", {"name": "speed"}),
        (ParameterState("mistyped", robot_type="string"), "parameter_mistyped", {"found": "string"}),
        (
            ParameterState("live", 1.0, range=Range(5.0, 6.0)),
            "parameter_no_common_value",
            {"theirs": "5 to 6"},
        ),
    ],
)
def test_a_parameter_that_can_not_be_set_is_no_fault_of_a_link(
    known: ParameterState, code: str, about: Table
) -> None:
    panel = panel_of(SPEED)
    robot = robot_there(panel)
    for name, type_name in (GET, DESCRIBE, SET):
        robot.graph.apply_token(server_token(BRIDGE_ZID, "SS", f"arm/{name}", type_name), True)
    robot.parameters["speed"] = known
    view = build_view(panel, robot, NOW).view
    assert coded(view["widgets"]["speed"]["reason"], *about) == (code, *about.values())
    assert {lamp["locks"] for lamp in view["link"].values()} == {LOCKS_NOTHING}
    assert {lamp["reason"] for lamp in view["link"].values()} == {""}


def test_lock_by_the_log_is_no_fault_of_a_link() -> None:
    panel = cell()
    link = links_of(panel, robot_there(panel), log_lock="The disk is full.")
    assert {lamp["locks"] for lamp in link.values()} == {LOCKS_NOTHING}


@pytest.mark.parametrize("silent_for", [4.9, 5.0])
def test_a_node_that_stops_talking_is_silent_though_its_token_is_there(silent_for: float) -> None:
    panel = cell(interlock={"max_age_s": 5.0})
    robot = robot_there(panel)
    endpoint(robot, "MP", ENABLED, BOOL)
    permits(robot)
    node = links_of(panel, robot, NOW + silent_for)["node"]
    if silent_for >= 5:
        assert (node["state"], node["text"]) == ("bad", say("link_node_silent"))
        assert node["reason"] == say("link_node_stale", topic=ENABLED, limit="5")
    else:
        assert (node["state"], node["text"], node["reason"]) == ("ok", say("ok"), "")


def test_an_old_value_that_is_only_shown_is_no_silence() -> None:
    panel = panel_of(AGED, GUARDED, MESSAGE, interlock={"max_age_s": 5.0})
    robot = robot_there(panel)
    endpoint(robot, "MP", "/heard", TEXT)
    endpoint(robot, "MP", ENABLED, BOOL)
    says(robot, "/heard", "hello", at=NOW)
    permits(robot, at=NOW + 60)
    built = build_view(panel, robot, NOW + 60)
    assert built.view["widgets"]["heard"]["state"] == "old"
    assert (built.view["link"]["node"]["state"], built.view["link"]["node"]["reason"]) == ("ok", "")


def test_a_forbidding_interlock_gets_old_too_and_time_shows_it() -> None:
    panel = panel_of(GUARDED, MESSAGE, interlock={"max_age_s": 2.0})
    robot = robot_there(panel)
    endpoint(robot, "MP", ENABLED, BOOL)
    permits(robot, False)
    assert build_view(panel, robot, NOW + 1).until == NOW + 2
    assert links_of(panel, robot, NOW + 2)["node"]["text"] == say("link_node_silent")


def test_node_is_not_faulted_for_its_bridge_or_a_type() -> None:
    panel = panel_of(HEARD, interlock={"max_age_s": 5.0})
    robot = robot_there(panel)
    permits(robot)
    endpoint(robot, "MP", ENABLED, TEXT)
    assert links_of(panel, robot, NOW + 60)["node"]["text"] == say("ok")


def test_an_old_value_without_a_publisher_is_no_silence() -> None:
    panel = panel_of(HEARD, interlock={"max_age_s": 5.0})
    robot = robot_there(panel)
    permits(robot)
    assert links_of(panel, robot, NOW + 60)["node"]["text"] == say("link_no_node")


def test_a_node_that_was_never_seen_is_to_be_started() -> None:
    panel = cell()
    node = links_of(panel, robot_there(panel))["node"]
    assert (node["state"], node["text"]) == ("wait", say("link_no_node"))
    assert node["reason"] == say("link_node_absent")


def test_a_node_that_was_there_and_went_without_its_bridge_has_its_remedy() -> None:
    panel = cell()
    robot = robot_there(panel)
    endpoint(robot, "MP", "/heard", TEXT)
    links_of(panel, robot)
    endpoint(robot, "MP", "/heard", TEXT, alive=False)
    node = links_of(panel, robot)["node"]
    assert (node["state"], node["text"]) == ("wait", say("link_no_node"))
    assert node["reason"] == say("link_node_gone", name="/heard")
    endpoint(robot, "MP", "/heard", TEXT)
    assert links_of(panel, robot)["node"]["reason"] == WAITS


def test_a_publisher_that_went_has_its_remedy_while_others_are_there() -> None:
    panel = cell(interlock={"require_publisher": True})
    robot = robot_there(panel)
    endpoint(robot, "MP", "/heard", TEXT)
    endpoint(robot, "MP", ENABLED, BOOL)
    links_of(panel, robot)
    endpoint(robot, "MP", ENABLED, BOOL, alive=False)
    node = links_of(panel, robot)["node"]
    assert (node["text"], node["locks"]) == (say("ok"), locking("Guarded"))
    assert node["reason"] == say("link_node_gone", name=ENABLED)


def test_node_lost_with_its_bridge_is_absent_behind_the_next() -> None:
    panel = cell()
    robot = robot_there(panel)
    endpoint(robot, "MP", "/heard", TEXT)
    links_of(panel, robot)
    endpoint(robot, "MP", "/heard", TEXT, alive=False)
    robot.graph.apply_token(bridge_token(BRIDGE_ZID), False)
    robot.graph.apply_token(bridge_token("b2"), True)
    assert links_of(panel, robot)["node"]["reason"] == say("link_node_absent")


def test_a_lost_link_forgets_which_nodes_were_there() -> None:
    panel = cell()
    robot = robot_there(panel)
    endpoint(robot, "MP", "/heard", TEXT)
    links_of(panel, robot)
    robot.mark_link_lost()
    robot.link_up, robot.settled_at = True, 0.0
    robot.graph.apply_token(bridge_token(BRIDGE_ZID), True)
    assert links_of(panel, robot)["node"]["reason"] == say("link_node_absent")


def test_a_qos_that_does_not_match_is_the_nodes() -> None:
    panel = cell(interlock={"qos": {"reliability": "reliable"}})
    robot = robot_there(panel)
    endpoint(robot, "MP", ENABLED, BOOL, qos=Qos(reliable=False))
    link = links_of(panel, robot)
    assert link["node"]["locks"] == locking("Guarded")
    assert link["node"]["reason"] == say("qos_robot_best_effort", topic=ENABLED)


def test_unforwarded_topic_is_a_fault_of_the_bridge() -> None:
    panel = cell()
    verdicts = {"free": PERMITTED, "guarded": Verdict(False, "topic_not_forwarded", "Not passed on.")}
    link, until = link_statuses(panel, robot_there(panel), PERMITTED, verdicts, NOW)
    assert link["bridge"]["locks"] == locking("Guarded")
    assert link["bridge"]["reason"] == "Not passed on."
    assert (link["bridge"]["state"], until) == ("ok", math.inf)


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ([], "Locks nothing."),
        (["One"], "Locks One."),
        (["One", "Two"], "Locks One, Two."),
        (["x" * 120, "Two"], f"Locks {'x' * 120} and 1 more."),
        (["x" * 30] * 40, f"Locks {', '.join(['x' * 30] * 3)} and 37 more."),
    ],
)
def test_a_long_list_is_cut_with_the_number_of_the_rest(names: list[str], said: str) -> None:
    assert english(locks(names)) == said
    assert len(said) < LONGEST_LIST + 30


class DatedLinks:
    """A robot's links as they are dated, at a wall clock that is set by hand."""

    def __init__(self) -> None:
        self.panel = small_panel()
        self.robot = robot_there(self.panel)
        self.wall = 0.0
        self._times = LinkTimes(lambda: self.wall)

    def at(self, wall: float) -> tuple[str, str, str]:
        """`since` of server, bridge and node at a time of the wall clock."""
        self.wall = wall
        dated = self._times.dated(build_view(self.panel, self.robot, NOW).view["link"])
        server, bridge, node = (render(lamp["since"]) for lamp in dated.values())
        return server, bridge, node


@pytest.mark.usefixtures("utc")
def test_lamp_state_begins_when_first_seen() -> None:
    links = DatedLinks()
    assert links.at(61.0) == ("", "1970-01-01 00:01:01", "1970-01-01 00:01:01")
    assert links.at(3 * DAY_S) == ("", "1970-01-01 00:01:01", "1970-01-01 00:01:01")


@pytest.mark.usefixtures("utc")
def test_each_link_has_its_own_time() -> None:
    links = DatedLinks()
    links.at(1.0)
    endpoint(links.robot, "MP", "/heard", TEXT)
    assert links.at(DAY_S + 2) == ("", "1970-01-01 00:00:01", "1970-01-02 00:00:02")
    links.robot.graph.apply_token(bridge_token(BRIDGE_ZID), False)
    assert links.at(DAY_S + 3) == ("", "1970-01-02 00:00:03", "1970-01-02 00:00:03")


@pytest.mark.usefixtures("utc")
def test_a_new_reason_is_not_a_new_state() -> None:
    links = DatedLinks()
    endpoint(links.robot, "MP", "/heard", TEXT)
    before = links.at(1.0)
    endpoint(links.robot, "MP", "/operation_enabled", TEXT)
    assert links.at(2.0) == before


@pytest.mark.usefixtures("utc")
def test_a_clock_that_is_set_back_changes_no_time_that_was_noted() -> None:
    links = DatedLinks()
    before = links.at(DAY_S)
    assert links.at(1.0) == before


@pytest.mark.usefixtures("utc")
def test_dating_changes_nothing_but_since() -> None:
    links = DatedLinks()
    plain = build_view(links.panel, links.robot, NOW).view["link"]
    dated = LinkTimes(lambda: 0.0).dated(plain)
    assert {name: {**lamp, "since": ""} for name, lamp in dated.items()} == plain
    assert plain["bridge"]["since"] == ""

"""What the tokens say: who is there, whether it answers, and of which type each topic is."""

import time
from collections.abc import Sized

import pytest

from app.cell.robot.graph import LiveGraph, Route
from app.ros.dialects.bridge_dialect import bridge_token, server_token, token
from app.ros.dialects.dialect import DEMO_VERSION, TopicRole
from app.ros.messages.names import Qos
from tests.support.builders import BOOL, BRIDGE, DIALECT, KIOSK, TEXT

OTHER_KIOSK = "c2"
TRIGGER = "std_srvs/srv/Trigger"


def topic_token(zid: str, role: TopicRole, key: str, type_name: str, qos: Qos | None = None) -> str:
    return token(zid, role, key, type_name, qos or Qos(), "RIHS01_0")


@pytest.fixture
def graph() -> LiveGraph:
    """A graph with one bridge."""
    made = LiveGraph(DIALECT, KIOSK)
    made.apply_token(bridge_token(BRIDGE), True)
    return made


def test_a_bridge_comes_and_goes() -> None:
    graph = LiveGraph(DIALECT, KIOSK)
    assert graph.apply_token(bridge_token(BRIDGE), True) == BRIDGE
    assert graph.peers == {BRIDGE}
    assert graph.apply_token(bridge_token(BRIDGE), False) == BRIDGE
    assert graph.peers == frozenset()


def test_a_topics_token_is_no_bridge(graph: LiveGraph) -> None:
    assert graph.apply_token(topic_token("x", "MP", "a", BOOL), True) is None
    assert graph.peers == {BRIDGE}


def test_the_kiosks_own_tokens_do_not_count() -> None:
    graph = LiveGraph(DIALECT, KIOSK)
    assert graph.apply_token(bridge_token(KIOSK), True) is None
    graph.apply_token(topic_token(KIOSK, "MP", "a", BOOL), True)
    assert graph.peers == frozenset()
    assert graph.mismatched_type("MP", "a", TEXT) is None


def test_invalid_token_changes_nothing(graph: LiveGraph) -> None:
    assert graph.apply_token("@/b1/@ros2_lv/SS/add/x", True) is None
    assert graph.peers == {BRIDGE}


@pytest.mark.parametrize("role", ["MP", "MS"])
def test_a_node_behind_a_bridge_is_on_the_robot(graph: LiveGraph, role: TopicRole) -> None:
    graph.apply_token(topic_token(BRIDGE, role, "a", BOOL), True)
    assert graph.has_endpoint(role, "a")
    assert not graph.has_endpoint(role, "b")
    assert not graph.has_endpoint("MS" if role == "MP" else "MP", "a")


def test_a_node_that_ended_is_not_on_the_robot(graph: LiveGraph) -> None:
    graph.apply_token(topic_token(BRIDGE, "MP", "a", BOOL), True)
    graph.apply_token(topic_token(BRIDGE, "MP", "a", BOOL), False)
    assert not graph.has_endpoint("MP", "a")


def test_another_kiosk_is_not_the_robot(graph: LiveGraph) -> None:
    graph.apply_token(topic_token(OTHER_KIOSK, "MP", "a", BOOL), True)
    assert not graph.has_endpoint("MP", "a")


def test_nodes_go_with_their_bridge(graph: LiveGraph) -> None:
    graph.apply_token(topic_token(BRIDGE, "MP", "a", BOOL), True)
    graph.apply_token(bridge_token(BRIDGE), False)
    assert not graph.has_endpoint("MP", "a")


@pytest.mark.parametrize(
    ("panel_role", "zid", "role"),
    [
        ("MS", BRIDGE, "MP"),  # the panel listens to a publisher of the robot's
        ("MS", OTHER_KIOSK, "MS"),  # another panel listens too, and fixed the route
        ("MP", BRIDGE, "MS"),  # the panel publishes to a subscriber of the robot's
        ("MP", OTHER_KIOSK, "MP"),
    ],
)
def test_a_counterpart_of_another_type_is_reported(
    graph: LiveGraph, panel_role: TopicRole, zid: str, role: TopicRole
) -> None:
    graph.apply_token(topic_token(zid, role, "a", TEXT), True)
    assert graph.mismatched_type(panel_role, "a", BOOL) == TEXT
    assert graph.mismatched_type(panel_role, "a", TEXT) is None
    assert graph.mismatched_type(panel_role, "b", BOOL) is None


@pytest.mark.parametrize(
    ("panel_role", "zid", "role"),
    [
        ("MS", BRIDGE, "MS"),
        ("MP", BRIDGE, "MP"),
        ("MS", OTHER_KIOSK, "MP"),
        ("MP", OTHER_KIOSK, "MS"),
    ],
)
def test_publisher_without_a_common_route_may_have_another_type(
    graph: LiveGraph, panel_role: TopicRole, zid: str, role: TopicRole
) -> None:
    graph.apply_token(topic_token(zid, role, "a", TEXT), True)
    assert graph.mismatched_type(panel_role, "a", BOOL) is None


def test_one_publisher_with_another_type_is_a_mismatch(graph: LiveGraph) -> None:
    graph.apply_token(topic_token(BRIDGE, "MP", "a", BOOL), True)
    graph.apply_token(topic_token(BRIDGE, "MP", "a", TEXT), True)
    assert graph.mismatched_type("MS", "a", BOOL) == TEXT


def test_a_type_is_right_again_when_the_wrong_one_ends(graph: LiveGraph) -> None:
    graph.apply_token(topic_token(BRIDGE, "MP", "a", TEXT), True)
    graph.apply_token(topic_token(BRIDGE, "MP", "a", TEXT), False)
    assert graph.mismatched_type("MS", "a", BOOL) is None


@pytest.mark.parametrize(("role", "direction"), [("MS", "pub"), ("MP", "sub")])
def test_a_bridges_route_of_another_type_is_reported(
    graph: LiveGraph, role: TopicRole, direction: str
) -> None:
    graph.update_routes([Route(BRIDGE, "pub" if direction == "pub" else "sub", "a", TEXT)])
    assert graph.mismatched_type(role, "a", BOOL) == TEXT
    assert graph.mismatched_type(role, "a", TEXT) is None
    assert graph.mismatched_type("MP" if role == "MS" else "MS", "a", BOOL) is None


def test_routes_of_a_bridge_that_went_do_not_count(graph: LiveGraph) -> None:
    graph.update_routes([Route(BRIDGE, "pub", "a", TEXT)])
    graph.apply_token(bridge_token(BRIDGE), False)
    assert graph.mismatched_type("MS", "a", BOOL) is None


def test_a_bridge_that_was_not_asked_is_not_silent(graph: LiveGraph) -> None:
    assert not graph.has_silent_peer


def test_a_bridge_that_does_not_answer_is_silent(graph: LiveGraph) -> None:
    graph.update_versions({})
    assert graph.has_silent_peer


def test_a_bridge_that_answers_is_not_silent(graph: LiveGraph) -> None:
    graph.update_versions({BRIDGE: '"1.10.0"', "router": '"1.10.0"'})
    assert not graph.has_silent_peer


def test_one_unresponsive_bridge_of_two_locks(graph: LiveGraph) -> None:
    graph.apply_token(bridge_token("b2"), True)
    graph.update_versions({"b2": '"v1"'})
    assert graph.has_silent_peer


def test_a_route_without_its_reader_is_unheard_while_the_robot_publishes(graph: LiveGraph) -> None:
    graph.update_routes([Route(BRIDGE, "pub", "a", TEXT, has_reader=False)])
    assert not graph.is_unrouted("a")
    graph.apply_token(token(BRIDGE, "MP", "a", TEXT, Qos(), "RIHS01_0"), True)
    assert graph.is_unrouted("a")
    graph.update_routes([Route(BRIDGE, "pub", "a", TEXT)])
    assert not graph.is_unrouted("a")


def test_response_of_a_peer_that_is_not_a_bridge_does_not_count(graph: LiveGraph) -> None:
    graph.update_versions({"router": '"1.10.0"'})
    assert graph.has_silent_peer


def test_without_a_bridge_nothing_is_silent() -> None:
    graph = LiveGraph(DIALECT)
    graph.update_versions({})
    assert not graph.has_silent_peer


def test_returning_bridge_is_queried_again(graph: LiveGraph) -> None:
    graph.update_versions({})
    graph.apply_token(bridge_token(BRIDGE), False)
    graph.apply_token(bridge_token(BRIDGE), True)
    assert not graph.has_silent_peer


@pytest.mark.parametrize(("version", "simulated"), [(DEMO_VERSION, True), ('"1.10.0"', False)])
def test_a_demo_robot_is_known_by_its_version(graph: LiveGraph, version: str, simulated: bool) -> None:
    graph.update_versions({BRIDGE: version})
    assert graph.is_simulated is simulated


def test_a_bridge_that_did_not_answer_is_not_taken_for_a_demo(graph: LiveGraph) -> None:
    assert not graph.is_simulated


def test_a_demo_robot_that_went_leaves_no_banner(graph: LiveGraph) -> None:
    graph.update_versions({BRIDGE: DEMO_VERSION})
    graph.apply_token(bridge_token(BRIDGE), False)
    assert not graph.is_simulated


@pytest.mark.parametrize("latched", [True, False])
def test_a_publishers_durability_is_known(graph: LiveGraph, latched: bool) -> None:
    graph.apply_token(topic_token(BRIDGE, "MP", "a", BOOL, Qos(transient_local=latched)), True)
    assert graph.is_transient_local("a") is latched


@pytest.mark.parametrize(("zid", "role"), [(BRIDGE, "MS"), (OTHER_KIOSK, "MP")])
def test_token_of_another_source_has_no_durability(graph: LiveGraph, zid: str, role: TopicRole) -> None:
    graph.apply_token(topic_token(zid, role, "a", BOOL, Qos(transient_local=True)), True)
    assert graph.is_transient_local("a") is None


BEST_EFFORT = Qos(reliable=False)
LATCHED = Qos(transient_local=True)


@pytest.mark.long("every screen")
@pytest.mark.parametrize(
    ("role", "robots", "panels", "code"),
    [
        ("MS", Qos(), Qos(), None),
        ("MS", BEST_EFFORT, Qos(), "qos_robot_best_effort"),
        ("MS", Qos(), BEST_EFFORT, None),
        ("MS", BEST_EFFORT, BEST_EFFORT, None),
        ("MS", Qos(), LATCHED, "qos_robot_volatile"),
        ("MS", LATCHED, Qos(), None),
        ("MS", LATCHED, LATCHED, None),
        ("MP", Qos(), Qos(), None),
        ("MP", Qos(), BEST_EFFORT, "qos_robot_requires_reliable"),
        ("MP", BEST_EFFORT, Qos(), None),
        ("MP", LATCHED, Qos(), "qos_robot_requires_transient_local"),
        ("MP", LATCHED, LATCHED, None),
        ("MP", Qos(), LATCHED, None),
        ("MP", Qos(depth=1), Qos(depth=5), None),
    ],
)
def test_a_qos_that_dds_would_not_match_is_reported(
    graph: LiveGraph, role: TopicRole, robots: Qos, panels: Qos, code: str | None
) -> None:
    theirs: TopicRole = "MP" if role == "MS" else "MS"
    graph.apply_token(topic_token(BRIDGE, theirs, "a", BOOL, robots), True)
    assert graph.mismatched_qos(role, "a", panels) == code
    assert graph.mismatched_qos(role, "b", panels) is None
    graph.apply_token(topic_token(BRIDGE, theirs, "a", BOOL, robots), False)
    assert graph.mismatched_qos(role, "a", panels) is None


def test_each_publisher_must_be_heard_but_one_hearing_subscriber_is_enough(graph: LiveGraph) -> None:
    for role in ("MP", "MS"):
        graph.apply_token(topic_token(BRIDGE, role, "a", BOOL), True)
    graph.apply_token(topic_token(BRIDGE, "MP", "a", BOOL, BEST_EFFORT), True)
    graph.apply_token(topic_token(BRIDGE, "MS", "a", BOOL, LATCHED), True)
    assert graph.mismatched_qos("MS", "a", Qos()) == "qos_robot_best_effort"
    assert graph.mismatched_qos("MP", "a", Qos()) is None


def test_another_kiosks_qos_does_not_count(graph: LiveGraph) -> None:
    graph.apply_token(topic_token(OTHER_KIOSK, "MP", "a", BOOL, BEST_EFFORT), True)
    assert graph.mismatched_qos("MS", "a", Qos()) is None


def test_a_token_that_does_not_say_is_no_mismatch(graph: LiveGraph) -> None:
    graph.apply_token(f"@/{BRIDGE}/@ros2_lv/MP/a/std_msgs§msg§Bool/:::,:", True)
    assert graph.mismatched_qos("MS", "a", Qos()) is None


def test_a_robots_bridges_are_those_of_its_namespace() -> None:
    graph = LiveGraph(DIALECT, KIOSK, "/robot1")
    for zid in ("b1", "b2", "b3"):
        graph.apply_token(bridge_token(zid), True)
    assert graph.peers == {"b1", "b2", "b3"}  # none has reported its namespace yet
    graph.update_namespaces({"b1": "/robot1", "b2": "/robot10"})
    assert graph.peers == {"b1"}
    graph.apply_token(bridge_token("b1"), False)
    assert graph.peers == {"b3"}  # it may be the robot's: it has not reported its namespace
    graph.update_namespaces({"b3": ""})
    assert graph.peers == {"b3"}  # robots with namespaces of their own are behind it
    graph.update_namespaces({"b3": "/robot2"})
    assert graph.peers == frozenset()


def test_another_robots_silent_bridge_is_not_this_ones_doubt() -> None:
    graph = LiveGraph(DIALECT, KIOSK, "/robot1")
    graph.apply_token(bridge_token("b1"), True)
    graph.update_namespaces({"b1": "/robot1"})
    graph.apply_token(bridge_token("b2"), True)
    graph.update_versions({"b1": "v1"})
    assert not graph.has_silent_peer
    graph.update_versions({})
    assert graph.has_silent_peer


def test_without_a_namespace_to_tell_robots_apart_every_bridge_counts(graph: LiveGraph) -> None:
    graph.update_namespaces({BRIDGE: "/robot7"})
    assert graph.peers == {BRIDGE}


def test_removed_nodes_leave_no_state(graph: LiveGraph) -> None:
    def sizes() -> dict[str, int]:
        return {name: len(part) for name, part in vars(graph).items() if isinstance(part, Sized)}

    before = sizes()
    for number in range(100):
        for alive in (True, False, False):
            graph.apply_token(topic_token(BRIDGE, "MP", f"node{number}/rosout", TEXT), alive)
            graph.apply_token(server_token(BRIDGE, "SS", f"node{number}/reset", TRIGGER), alive)
    assert sizes() == before


def test_ten_thousand_nodes_that_the_panel_does_not_name_cost_next_to_nothing() -> None:
    """They come at once, when a bridge is joined that has them behind it."""
    graph = LiveGraph(DIALECT, KIOSK, keys=["a"])
    others = [topic_token(BRIDGE, "MP", f"some/topic{number}", TEXT) for number in range(10_000)]
    began = time.thread_time()
    for other in others:
        graph.apply_token(other, True)
    assert time.thread_time() - began < 0.05
    graph.apply_token(bridge_token(BRIDGE), True)
    graph.apply_token(topic_token(BRIDGE, "MP", "a", BOOL), True)
    assert graph.has_endpoint("MP", "a")
    assert not graph.has_endpoint("MP", "some/topic7")

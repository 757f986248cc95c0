"""The bridge's dialect: names, tokens and the admin space, there and back."""

import pytest

from app.ros.dialects import bridge_dialect
from app.ros.dialects.bridge_dialect import parsed, token
from app.ros.dialects.bridge_entities import node_endpoints
from app.ros.dialects.dialect import Endpoint, ServerRole, TopicRole
from app.ros.messages.names import (
    MESSAGE_TYPE,
    NAMESPACE,
    NO_TYPE,
    ROSOUT,
    TOPIC,
    Qos,
    key_of,
    possible_keys,
    valid_type,
)
from tests.support.builders import BOOL, TEXT

pytestmark = pytest.mark.promise("dialects")

HASH = "RIHS01_0"

HOSTILE_KEYS = [
    "",
    "/absolute",
    "a/",
    "a//b",
    "a b",
    "1a",
    "a/1b",
    "a/*",
    "**",
    "a$*",
    "a#b",
    "a?b",
    "a§b",
    "ä",
    "a\n",
    "a\0",
    "a-b",
    "~/a",
    "{a}",
    "a/MP/b:c",
]
HOSTILE_TYPES = [
    "",
    "std_msgs/String",
    "std_msgs/srv/String",
    "std_msgs/msg/",
    "std_msgs/msg/string",
    "std_msgs/msg/String/x",
    "std_msgs/msg/Str ing",
    "std_msgs/msg/String\n",
    "Std_msgs/msg/String",
    "std_msgs§msg§String",
    "**",
]


@pytest.mark.parametrize("role", ["MP", "MS"])
@pytest.mark.parametrize("key", ["chatter", "robot1/arm/_state", "A/b_C3"])
@pytest.mark.parametrize("latched", [True, False])
def test_token_parses_to_its_parts(role: TopicRole, key: str, latched: bool) -> None:
    made = token("b1", role, key, BOOL, Qos(transient_local=latched), HASH)
    endpoint = parsed(made)
    assert endpoint is not None
    assert endpoint == Endpoint("b1", role, key, BOOL, latched, True)


def test_a_token_is_one_key_expression_of_the_bridges_form() -> None:
    made = token("b1", "MS", "arm/state", TEXT, Qos(), HASH)
    assert made == ("@/b1/@ros2_lv/MS/arm§state/std_msgs§msg§String/:1:0:0,10:typehash=RIHS01_0;")


@pytest.mark.parametrize(
    ("qos", "flags"),
    [
        (Qos(), ":1:0:0,10:"),
        (Qos(reliable=False), ":0:0:0,10:"),
        (Qos(transient_local=True, depth=1), ":1:1:0,1:"),
        (ROSOUT, ":1:1:0,1000:"),
    ],
)
def test_a_token_carries_its_qos(qos: Qos, flags: str) -> None:
    assert f"/{flags}" in token("b1", "MP", "a", TEXT, qos, HASH)


@pytest.mark.parametrize("key", HOSTILE_KEYS)
def test_a_hostile_key_never_becomes_a_token(key: str) -> None:
    with pytest.raises(ValueError, match="can not be a token"):
        token("b1", "MP", key, TEXT, Qos(), HASH)


@pytest.mark.parametrize("type_name", HOSTILE_TYPES)
def test_a_hostile_type_never_becomes_a_token(type_name: str) -> None:
    with pytest.raises(ValueError, match="can not be a token"):
        token("b1", "MP", "a", type_name, Qos(), HASH)


@pytest.mark.parametrize(
    ("qos", "latched", "reliable"),
    [
        ("::1:0,1:", True, None),
        (":1:0:0,10:", False, True),
        (":0:0:0,10:", False, False),
        ("K:::,:", False, None),
        (":1:1:0,1:x;", True, True),
    ],
)
def test_a_bridges_token_of_a_topic_is_read_in_its_short_forms(
    qos: str, latched: bool, reliable: bool | None
) -> None:
    endpoint = parsed(f"@/b1/@ros2_lv/MP/arm§state/std_msgs§msg§Bool/{qos}")
    assert endpoint == Endpoint("b1", "MP", "arm/state", BOOL, latched, reliable)


def test_a_bridges_own_token_shows_the_bridge() -> None:
    assert parsed(bridge_dialect.bridge_token("b1")) == Endpoint("b1")


@pytest.mark.parametrize(
    "key",
    [
        "",
        "chatter",
        "@/b1",
        "@/b1/@ros2_lv/",
        "@/b1/@ros2_lv/SC/add/example§srv§Add",  # a service client
        "@/b1/@ros2_lv/AC/move/example§action§Move",  # an action client
        "@/b1/@ros2_lv/MP/a",
        "@/b1/@ros2_lv/MP/a/b/c/d/e",
        "@//@ros2_lv",
        "@/b1/@ros2_lv\n",
        "x/@/b1/@ros2_lv",
    ],
)
def test_key_that_is_not_a_topics_token_parses_to_nothing(key: str) -> None:
    assert parsed(key) is None


@pytest.mark.parametrize(
    ("topic", "namespace", "key"),
    [
        ("/a", "", "a"),
        ("/a/b", "", "a/b"),
        ("/a", "/robot1", "robot1/a"),
        ("/a", "/x/y", "x/y/a"),
        ("//a", "/robot1", "a"),
        ("//robot1/a", "/robot1", "robot1/a"),
        ("//a/b", "", "a/b"),
    ],
)
def test_a_topic_has_the_key_that_the_bridge_gives_it(topic: str, namespace: str, key: str) -> None:
    assert key_of(topic, namespace) == key


@pytest.mark.parametrize(
    "topic", ["", "a", "/", "/a/", "///a", "//", "//a/", "/a//b", "/1", "/a b", "/*", "/a\n"]
)
def test_name_that_is_not_a_topic_has_no_key(topic: str) -> None:
    with pytest.raises(ValueError, match="not an absolute ROS 2 topic name"):
        key_of(topic)


@pytest.mark.parametrize(
    ("topic", "namespace", "keys"),
    [
        ("/rosout", "", ("rosout",)),
        ("/rosout", "/site/amr", ("site/amr/rosout", "site/rosout", "rosout")),
        ("/parameter_events", "/amr", ("amr/parameter_events", "parameter_events")),
        ("//rosout", "/amr", ("rosout",)),
        ("/speed", "/amr", ("amr/speed",)),
    ],
)
def test_a_shared_topic_is_behind_the_namespace_of_any_bridge(
    topic: str, namespace: str, keys: tuple[str, ...]
) -> None:
    assert possible_keys(topic, namespace) == keys


def test_a_namespace_can_not_smuggle_in_a_wildcard() -> None:
    with pytest.raises(ValueError, match="not an absolute ROS 2 topic name"):
        key_of("/a", "/**")


def test_no_namespace_is_a_namespace() -> None:
    assert NAMESPACE.fullmatch("")
    assert not TOPIC.fullmatch("")


def test_a_type_is_a_message_not_a_service() -> None:
    assert MESSAGE_TYPE.fullmatch("example_interfaces/msg/Int64")
    assert not MESSAGE_TYPE.fullmatch("example_interfaces/srv/AddTwoInts")


@pytest.mark.parametrize("direction", ["pub", "sub"])
def test_a_route_of_the_admin_space_is_read(direction: str) -> None:
    route = bridge_dialect.route_of(f"@/b1/ros2/route/topic/{direction}/robot1/state")
    assert route == ("b1", direction, "robot1/state")


@pytest.mark.parametrize(
    "key",
    ["@/b1/ros2/route/service/srv/add", "@/b1/ros2/route/topic/pub/", "@/b1/ros2/version", ""],
)
def test_key_that_is_not_a_topics_route_is_no_route(key: str) -> None:
    assert bridge_dialect.route_of(key) is None


def test_response_names_its_sender() -> None:
    assert bridge_dialect.zid_of(bridge_dialect.version("b1")) == "b1"


@pytest.mark.parametrize("qos", [":1:2:0,1:", ":1:1:0,1:a=b/c;", "K:::"])
def test_a_token_of_a_native_dds_program_is_read(qos: str) -> None:
    endpoint = parsed(f"@/b1/@ros2_lv/MP/enabled/std_msgs§msg§Bool/{qos}")
    assert endpoint is not None
    assert (endpoint.key, endpoint.type) == ("enabled", "std_msgs/msg/Bool")


@pytest.mark.parametrize("role", ["SS", "AS"])
def test_a_server_is_read_from_its_token(role: ServerRole) -> None:
    kind = "srv" if role == "SS" else "action"
    made = bridge_dialect.server_token("b1", role, "arm/move", f"pkg/{kind}/Move")
    assert parsed(made) == Endpoint("b1", role, "arm/move", f"pkg/{kind}/Move")


@pytest.mark.parametrize(
    "type_name", ["x" * 50_000, "a\u202eb", "std msgs", "", "a//b", "std_msgs/msg/Bool\n"]
)
def test_malformed_type_is_no_type(type_name: str) -> None:
    assert valid_type(type_name) == NO_TYPE
    if type_name:
        endpoint = parsed(f"@/b1/@ros2_lv/MP/enabled/{type_name.replace('/', '§')}/:1:0:0,1:")
        assert endpoint is None or endpoint.type == NO_TYPE
    node = {"publishers": [{"name": "/enabled", "type": type_name}], "subscribers": []}
    assert [endpoint.type for endpoint in node_endpoints("@/b1/ros2/node/g/n", node, "")] == [NO_TYPE]


@pytest.mark.parametrize("key", ["a" * 600, "1st", "a\u202eb", "a b"])
def test_malformed_name_parses_to_nothing(key: str) -> None:
    assert parsed(f"@/b1/@ros2_lv/MP/{key}/std_msgs§msg§Bool/:1:0:0,1:") is None
    assert parsed(f"@/b1/@ros2_lv/SS/{key}/std_srvs§srv§Trigger") is None
    assert parsed(f"@/{'b' * 65}/@ros2_lv") is None


def test_a_hostile_action_never_becomes_a_token() -> None:
    for key, kind in (("a§b", "pkg/action/Move"), ("a", "pkg/srv/Move"), ("", "pkg/action/Move")):
        with pytest.raises(ValueError, match="can not be a token"):
            bridge_dialect.action_client_token("b1", key, kind)

"""rmw_zenoh's dialect: names, tokens and attachments, there and back, against what its design and its
nodes have. The attachments are read by a decoder of the test's own."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.cell.robot.definitions import difference
from app.cell.robot.graph import LiveGraph
from app.ros.dialects.dialect import NO_HASH, Endpoint, PanelEndpoint, distribution_hashes
from app.ros.dialects.rmw_zenoh import (
    RmwZenohDialect,
    TokenQos,
    attachment,
    dds_type,
    demangled,
    endpoint_of,
    free_name,
    gid_of,
    is_whole,
    mangled,
    node_token,
    parse_attachment,
    parse_qos,
    parse_token,
    qos_part,
    ros_type,
)
from app.ros.messages import load_interfaces
from app.ros.messages.names import NO_TYPE, Qos, key_of
from tests.ros.dialects.test_bridge_dialect import HOSTILE_KEYS, HOSTILE_TYPES
from tests.support.builders import BOOL, INTERFACES, TEXT

pytestmark = pytest.mark.promise("dialects")

STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
ADD_HASH = "RIHS01_e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a"
JAZZY = RmwZenohDialect(0, distribution_hashes("jazzy", INTERFACES))
FIBONACCI = "example_interfaces/action/Fibonacci"
ZID = "8b20917502ee955ac4476e0266340d5c"
# Of rmw_zenoh's design (docs/design.md).
LISTENER = "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener"
OF_LISTENER = (
    f"@ros2_lv/2/{ZID}/0/10/MS/%/%/listener/%chatter/std_msgs::msg::dds_::String_"
    f"/{STRING_HASH}/::,7:,:,:,,"
)
OF_SERVER = (
    "@ros2_lv/2/f9980ee0495eaafb3e38f0d19e2eae12/0/10/SS/%/%/add_two_ints_server/%add_two_ints"
    f"/example_interfaces::srv::dds_::AddTwoInts_/{ADD_HASH}/::,10:,:,:,,"
)

ZIDS = st.text("0123456789abcdef", min_size=1, max_size=32)
PART = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,12}", fullmatch=True)
KEYS = st.lists(PART, min_size=1, max_size=4).map("/".join)
QOS = st.builds(Qos, st.booleans(), st.booleans(), st.integers(1, 10_000))
NUMBERS = st.integers(1, 2**63 - 1)


def test_key_expressions_are_those_of_the_design() -> None:
    assert JAZZY.topic("chatter", TEXT) == f"0/chatter/std_msgs::msg::dds_::String_/{STRING_HASH}"
    assert (
        RmwZenohDialect(2, JAZZY.type_hash).service("add_two_ints", "example_interfaces/srv/AddTwoInts")
        == f"2/add_two_ints/example_interfaces::srv::dds_::AddTwoInts_/{ADD_HASH}"
    )
    assert JAZZY.topic("robot1/arm/chatter", TEXT).startswith("0/robot1/arm/chatter/std_msgs::msg::")
    assert RmwZenohDialect().topic("chatter", TEXT) == "0/chatter/std_msgs::msg::dds_::String_/*"
    assert RmwZenohDialect().service("reset", "") == "0/reset/*/*"


def test_hashes_are_those_of_the_distribution() -> None:
    humble = RmwZenohDialect(0, distribution_hashes("humble", load_interfaces("humble")))
    assert humble.topic("chatter", TEXT) == f"0/chatter/std_msgs::msg::dds_::String_/{NO_HASH}"
    assert humble.service("reset", "std_srvs/srv/Trigger").endswith(f"::Trigger_/{NO_HASH}")
    goal_status = "action_msgs/msg/GoalStatusArray"
    lyrical = RmwZenohDialect(0, distribution_hashes("lyrical", load_interfaces("lyrical")))
    assert lyrical.topic("chatter", TEXT) == JAZZY.topic("chatter", TEXT)
    assert JAZZY.key_hash(goal_status) == INTERFACES.type_hash(goal_status)
    assert JAZZY.key_hash("my_msgs/msg/Unknown") == ""


def test_tokens_of_the_design_are_read() -> None:
    node, of_listener, of_server = map(RmwZenohDialect(2).endpoint, (LISTENER, OF_LISTENER, OF_SERVER))
    assert node == Endpoint("aac3178e146ba6f1fc6e6a4085e77f21", node="/listener")
    assert of_listener == Endpoint(
        ZID, "MS", "chatter", TEXT, False, True, ((TEXT, STRING_HASH),), "/listener"
    )
    assert of_server is not None
    assert (of_server.role, of_server.key, of_server.type) == (
        "SS",
        "add_two_ints",
        "example_interfaces/srv/AddTwoInts",
    )
    parsed = parse_token(OF_LISTENER)
    assert parsed is not None
    assert parsed.qos == TokenQos(depth=7)


@pytest.mark.parametrize(
    ("qos", "text"),
    [
        (Qos(), "::,10:,:,:,,"),
        (Qos(reliable=False, depth=5), "2::,5:,:,:,,"),
        (Qos(transient_local=True, depth=1), ":1:,1:,:,:,,"),
    ],
)
def test_qos_is_written_as_nodes_write_it(qos: Qos, text: str) -> None:
    assert qos_part(qos) == text


@pytest.mark.parametrize(
    ("text", "qos"),
    [
        ("1:2:1,10:0,0:0,0:1,0,0", TokenQos(depth=10)),
        ("0:0:0,0:,:,:,,", TokenQos()),
        (":1:2,3:1,500000000:,:,,", TokenQos(transient_local=True, keep_all=True, depth=3)),
        ("2::,:,:,:,,", TokenQos(reliable=False)),
        ("", None),
        ("::,10", None),
        ("::,-1:,:,:,,", None),
        ("x::,10:,:,:,,", None),
        ("::,10:,:,:,,/", None),
    ],
)
def test_qos_is_read_with_and_without_its_defaults(text: str, qos: TokenQos | None) -> None:
    assert parse_qos(text) == qos


@given(ZIDS, KEYS, QOS, st.sampled_from(["MP", "MS"]), PART)
def test_what_the_panel_is_in_the_graph_is_read_back(
    zid: str, key: str, qos: Qos, role: str, node: str
) -> None:
    own = PanelEndpoint("MP" if role == "MP" else "MS", key, BOOL, qos)
    of_node, of_endpoint = JAZZY.node_tokens(zid, f"/ns/{node}", [own])
    assert of_node == f"@ros2_lv/0/{zid}/0/0/NN/%/%ns/{node}"
    parsed = parse_token(of_endpoint)
    assert parsed is not None
    assert parsed[:6] == (zid, role, f"/ns/{node}", key, BOOL, INTERFACES.type_hash(BOOL))
    assert parsed.qos == TokenQos(qos.reliable, qos.transient_local, False, qos.depth)
    assert JAZZY.name_in(of_endpoint) == JAZZY.in_token(key)
    assert JAZZY.name_in(of_node) == ""


@given(st.text("@ros2_lv/%MNPSC0a:,*\n§", max_size=80) | st.text(max_size=40))
def test_no_text_of_others_stops_the_reading(text: str) -> None:
    for token in (text, f"{LISTENER}{text}", f"{OF_LISTENER}{text}", f"{OF_SERVER[:-15]}{text}"):
        JAZZY.name_in(token)
        endpoint = JAZZY.endpoint(token)
        assert endpoint is None or endpoint.role is None or key_of(f"/{endpoint.key}") == endpoint.key


@pytest.mark.parametrize(
    "token",
    [
        LISTENER.replace("NN", "MP"),
        OF_LISTENER.replace("/MS/", "/NN/"),
        OF_LISTENER.replace("/MS/", "/XX/"),
        OF_LISTENER.replace("%chatter", "chatter"),
        OF_LISTENER.replace("%chatter", "%cha%%tter"),
        OF_LISTENER.replace(ZID, "zid"),
        OF_LISTENER.replace("@ros2_lv/2", "@ros2_lv/x"),
        OF_LISTENER.replace("::,7", "::,x"),
        f"{OF_LISTENER}/more",
        "@ros2_lv",
    ],
)
def test_malformed_tokens_are_ignored(token: str) -> None:
    assert JAZZY.endpoint(token) is None


def test_a_type_that_is_none_is_one_that_no_panel_has() -> None:
    endpoint = JAZZY.endpoint(OF_LISTENER.replace("std_msgs::msg::dds_::String_", "String"))
    assert endpoint is not None
    assert endpoint.type == NO_TYPE


@pytest.mark.parametrize("key", HOSTILE_KEYS)
def test_a_name_that_would_break_a_token_never_becomes_one(key: str) -> None:
    with pytest.raises(ValueError, match="can not be a token"):
        JAZZY.own_tokens(ZID, [PanelEndpoint("MP", key, TEXT)])


@pytest.mark.parametrize("type_name", [name for name in HOSTILE_TYPES if name.count("/") == 2])
def test_a_type_that_would_break_a_token_never_becomes_one(type_name: str) -> None:
    dialect = RmwZenohDialect()
    if ros_type(dds_type(type_name)) == type_name:
        return  # unusual, but one key expression
    with pytest.raises(ValueError, match="can not be a token"):
        dialect.own_tokens(ZID, [PanelEndpoint("MP", "chatter", type_name)])


@pytest.mark.parametrize("node", ["", "a/b", "/a b", "/a/*", "/%", "a", "/1/b"])
def test_a_node_that_would_break_a_token_never_becomes_one(node: str) -> None:
    if node == "a":
        assert node_token(0, ZID, node).endswith("/%/a")
        return
    with pytest.raises(ValueError, match="can not be a node"):
        node_token(0, ZID, node)


@given(KEYS)
def test_mangled_names_are_read_back(key: str) -> None:
    assert demangled(mangled(f"/{key}")) == f"/{key}"
    assert demangled(mangled("")) == ""


def test_an_action_is_its_services_and_topics() -> None:
    client = JAZZY.own_tokens(ZID, [PanelEndpoint("AC", "arm/fibonacci", FIBONACCI)])
    kinds = [token.split("/")[5] for token in client]
    assert kinds == ["NN", "SC", "SC", "SC", "MS", "MS"]
    assert (
        "/%arm%fibonacci%_action%send_goal/example_interfaces::action::dds_::Fibonacci_SendGoal_/"
        in client[1]
    )
    assert "/%arm%fibonacci%_action%cancel_goal/action_msgs::srv::dds_::CancelGoal_/" in client[2]
    assert "/%arm%fibonacci%_action%status/action_msgs::msg::dds_::GoalStatusArray_/" in client[5]
    assert client[5].endswith("/:1:,1:,:,:,,")
    server = JAZZY.node_tokens(ZID, "/arm", [PanelEndpoint("AS", "arm/fibonacci", FIBONACCI)])
    seen = [endpoint for token in server if (endpoint := JAZZY.endpoint(token))]
    assert [(e.role, e.key) for e in seen] == [
        (None, ""),
        ("AS", "arm/fibonacci"),
        ("MP", "arm/fibonacci/_action/feedback"),
        ("MP", "arm/fibonacci/_action/status"),
    ]
    assert seen[1].type == FIBONACCI
    assert seen[1].hashes == ((f"{FIBONACCI}_SendGoal", INTERFACES.type_hash(f"{FIBONACCI}_SendGoal")),)
    assert JAZZY.name_in(server[1]) == JAZZY.in_token("arm/fibonacci")


def test_each_endpoint_of_a_node_has_a_number_of_its_own() -> None:
    own = [PanelEndpoint("MP", f"t{n}", BOOL) for n in range(300)]
    numbers = sorted(int(token.split("/")[4]) for token in JAZZY.own_tokens(ZID, own))
    assert all(before < after for before, after in pairwise(numbers))


def test_other_panels_are_no_robot_and_have_names_of_their_own() -> None:
    tokens = [
        parsed
        for node in ("web_ui", "web_ui_2", "arm/web_ui")
        if (parsed := parse_token(node_token(0, ZID, f"/{node}")))
    ]
    assert [endpoint_of(token) is None for token in tokens] == [True, True, False]
    assert free_name(()) == "web_ui"
    assert free_name({"/web_ui"}) == "web_ui_2"
    assert free_name({"/web_ui", "/web_ui_2"}) == "web_ui_3"


def decoded(data: bytes) -> tuple[int, int, bytes]:
    """What rmw_zenoh's own reader takes from an attachment: two int64 and a sequence of bytes with its
    length before it, nothing left over."""
    number = int.from_bytes(data[0:8], "little", signed=True)
    at_ns = int.from_bytes(data[8:16], "little", signed=True)
    length = data[16]
    assert length < 0x80
    gid = data[17 : 17 + length]
    assert len(gid) == length == 16
    assert len(data) == 17 + length
    return number, at_ns, gid


def test_an_attachment_has_the_bytes_that_nodes_send() -> None:
    made = attachment(1, 0x0102030405060708, bytes(range(16)))
    assert made.hex(" ", 8) == (
        "01 0000000000000008 0706050403020110 0001020304050607 08090a0b0c0d0e0f"
    )
    assert len(made) == 33


@given(NUMBERS, st.integers(0, 2**63 - 1), ZIDS, KEYS)
def test_every_attachment_is_whole(number: int, at_ns: int, zid: str, key: str) -> None:
    expression = JAZZY.topic(key, BOOL)
    made = JAZZY.attachment(zid, expression, number, at_ns)
    assert made is not None
    assert decoded(made) == (number, at_ns, gid_of(zid, expression))
    assert parse_attachment(made) == decoded(made)


@given(st.binary(max_size=40))
def test_malformed_attachments_are_none(data: bytes) -> None:
    parsed = parse_attachment(data)
    assert parsed is None or len(data) == 33
    assert parse_attachment(data[:32]) is None


@pytest.mark.parametrize(
    ("number", "at_ns", "gid"), [(0, 0, b"g" * 16), (1, -1, b"g" * 16), (1, 0, b"")]
)
def test_no_attachment_is_made_that_ends_a_node(number: int, at_ns: int, gid: bytes) -> None:
    with pytest.raises(ValueError, match="no attachment has"):
        attachment(number, at_ns, gid)


def test_each_publisher_of_each_session_has_its_own_gid() -> None:
    places = [(zid, JAZZY.topic(key, BOOL)) for zid in ("a", "b") for key in ("a", "b", "a/b")]
    assert len({gid_of(*place) for place in places}) == len(places)


def test_only_whole_payloads_may_be_sent() -> None:
    whole = INTERFACES.encode("std_msgs/msg/Empty", {})
    assert is_whole(whole)
    for cut in (b"", whole[:1], whole[:4], b"data" + whole, b"\x00\x09\x00\x00\x01"):
        assert not is_whole(cut)


def test_a_hash_that_differs_is_known_with_both() -> None:
    """The robot's definition, or its distribution, is another one: nothing would arrive."""
    for theirs in (STRING_HASH.replace("df6", "000"), NO_HASH):
        graph = LiveGraph(JAZZY)
        graph.apply_token(node_token(0, ZID, "/arm"), True)
        graph.apply_token(OF_LISTENER.replace(STRING_HASH, theirs), True)
        differing = difference(graph, "MS", "chatter", INTERFACES)
        assert differing is not None
        assert (differing.theirs, differing.ours, differing.node) == (theirs, STRING_HASH, "/listener")
    humble = LiveGraph(RmwZenohDialect(0, distribution_hashes("humble", INTERFACES)))
    humble.apply_token(node_token(0, ZID, "/arm"), True)
    humble.apply_token(OF_LISTENER, True)
    differing = difference(humble, "MS", "chatter", INTERFACES)
    assert differing is not None
    assert (differing.theirs, differing.ours) == (STRING_HASH, NO_HASH)
    humble.apply_token(OF_LISTENER, False)
    humble.apply_token(OF_LISTENER.replace(STRING_HASH, NO_HASH), True)
    assert difference(humble, "MS", "chatter", INTERFACES) is None

"""A robot on Cyclone DDS, a Zenoh client that calls it through the bridge, and their message types.

A test file assigns the fixtures by name, with those that they depend on: `robot = cyclone.robot`.
"""

import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import Any, Final

import pytest
import zenoh
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from app.ros.messages import load_interfaces
from tests.support import domains
from tests.support.parts import ROOT, ROS_PYTHON, TESTS, Bridge, until
from tests.support.processes.commanded import Commanded

NODE = "cyclone_robot"

# On loopback and without multicast, like the bridge. After `lease_s` of silence (default 10 s) others
# consider a killed robot lost.
CYCLONE = (
    "<CycloneDDS><Domain>"
    "<General><AllowMulticast>false</AllowMulticast>"
    '<Interfaces><NetworkInterface name="lo"/></Interfaces></General>'
    "<Discovery><ParticipantIndex>auto</ParticipantIndex><LeaseDuration>{lease_s}s</LeaseDuration>"
    '<Peers><Peer address="localhost"/></Peers></Discovery>'
    "</Domain></CycloneDDS>"
)

# The robot's tokens: its services and its action, with their types.
GRAPH = {
    "SS/set_enabled/std_srvs/srv/SetBool",
    "SS/reset/std_srvs/srv/Trigger",
    "SS/slow/std_srvs/srv/Trigger",
    "SS/slow_2/std_srvs/srv/Trigger",
    "SS/slow_3/std_srvs/srv/Trigger",
    "SS/add_two_ints/example_interfaces/srv/AddTwoInts",
    f"SS/{NODE}/get_parameters/rcl_interfaces/srv/GetParameters",
    f"SS/{NODE}/get_parameter_types/rcl_interfaces/srv/GetParameterTypes",
    f"SS/{NODE}/set_parameters/rcl_interfaces/srv/SetParameters",
    f"SS/{NODE}/set_parameters_atomically/rcl_interfaces/srv/SetParametersAtomically",
    f"SS/{NODE}/list_parameters/rcl_interfaces/srv/ListParameters",
    f"SS/{NODE}/describe_parameters/rcl_interfaces/srv/DescribeParameters",
    "AS/fibonacci/example_interfaces/action/Fibonacci",
}

DEFINITIONS = {
    "std_srvs/srv/SetBool": "bool data\n---\nbool success\nstring message",
    "std_srvs/srv/Trigger": "---\nbool success\nstring message",
    "example_interfaces/srv/AddTwoInts": "int64 a\nint64 b\n---\nint64 sum",
    "action_msgs/srv/CancelGoal": (
        "action_msgs/GoalInfo goal_info\n---\nint8 return_code\naction_msgs/GoalInfo[] goals_canceling"
    ),
    "example_interfaces/action/Fibonacci_SendGoal": (
        "unique_identifier_msgs/UUID goal_id\nexample_interfaces/action/Fibonacci_Goal goal\n---\n"
        "bool accepted\nbuiltin_interfaces/Time stamp"
    ),
    "example_interfaces/action/Fibonacci_GetResult": (
        "unique_identifier_msgs/UUID goal_id\n---\n"
        "int8 status\nexample_interfaces/action/Fibonacci_Result result"
    ),
    "rcl_interfaces/srv/GetParameters": "string[] names\n---\nrcl_interfaces/ParameterValue[] values",
    "rcl_interfaces/srv/GetParameterTypes": "string[] names\n---\nuint8[] types",
    "rcl_interfaces/srv/SetParameters": (
        "rcl_interfaces/Parameter[] parameters\n---\nrcl_interfaces/SetParametersResult[] results"
    ),
    "rcl_interfaces/srv/SetParametersAtomically": (
        "rcl_interfaces/Parameter[] parameters\n---\nrcl_interfaces/SetParametersResult result"
    ),
    "rcl_interfaces/srv/ListParameters": (
        "string[] prefixes\nuint64 depth\n---\nrcl_interfaces/ListParametersResult result"
    ),
    "rcl_interfaces/srv/DescribeParameters": (
        "string[] names\n---\nrcl_interfaces/ParameterDescriptor[] descriptors"
    ),
}
MESSAGES = {
    "example_interfaces/action/Fibonacci_Goal": "int32 order",
    "example_interfaces/action/Fibonacci_Result": "int32[] sequence",
    "example_interfaces/action/Fibonacci_FeedbackMessage": (
        "unique_identifier_msgs/UUID goal_id\nexample_interfaces/action/Fibonacci_Result feedback"
    ),
}


def type_store() -> Any:
    store = get_typestore(Stores.ROS2_JAZZY)
    texts = dict(MESSAGES)
    for name, text in DEFINITIONS.items():
        texts[f"{name}_Request"], texts[f"{name}_Response"] = text.split("---\n")
    for name, text in texts.items():
        # Register it by its own name: rosbags names every definition `…/msg/…`.
        (definition,) = get_types_from_msg(text, name).values()
        store.register({name: definition})
    return store


TYPES = type_store()


NAV2: Final = ROOT / "docs/examples/mobile-robot/interfaces"
NAV2_ACTIONS: Final = tuple(
    f"nav2_msgs/action/{name}" for name in ("NavigateToPose", "DockRobot", "FollowWaypoints")
)
PARTS_OF_ACTIONS: Final = (
    *("SendGoal_Request", "SendGoal_Response", "GetResult_Request", "GetResult_Response"),
    "FeedbackMessage",
)


def type_hashes() -> dict[str, str]:
    """The type hash of each request and response, and of the parts of Nav2's actions."""
    interfaces = load_interfaces("jazzy", (NAV2,))
    parts = [f"{name}_{part}" for name in DEFINITIONS for part in ("Request", "Response")]
    parts += [f"{name}_{part}" for name in NAV2_ACTIONS for part in PARTS_OF_ACTIONS]
    return {name: interfaces.type_hash(name) for name in parts}


def encoded(type_name: str, *fields: Any) -> bytes:
    """A message in CDR, from its fields in their order."""
    return bytes(TYPES.serialize_cdr(TYPES.types[type_name](*fields), type_name))


def decoded(type_name: str, payload: bytes) -> Any:
    return TYPES.deserialize_cdr(payload, type_name)


class CycloneRobot(Commanded):
    """A node on Cyclone DDS in its own environment; see `tests/ros_nodes/cyclone_robot.py`.

    If it ends regularly, it announces that, and the bridge removes it at once.
    """

    def __init__(
        self, domain: int, lease_s: float = 10, *, hashed: bool = True, namespace: str = ""
    ) -> None:
        """With `hashed` its services have type hashes, as since iron. `namespace` is its node's, like
        "/amr"."""
        super().__init__(
            [ROS_PYTHON, TESTS / "ros_nodes/cyclone_robot.py", f"{namespace}/{NODE}"[1:]],
            {
                "ROS_DOMAIN_ID": str(domain),
                "CYCLONEDDS_URI": CYCLONE.format(lease_s=lease_s),
                "TYPE_HASHES": json.dumps(type_hashes() if hashed else {}),
            },
        )

    def __getattr__(self, name: str) -> Callable[..., Any]:
        return partial(self, name)

    def requests(self, service: str) -> list[Any]:
        """The requests that the robot executed on a service."""
        return [call["request"] for call in self.calls(service=service)]


class Client:
    """A Zenoh session at the bridge that exchanges ROS 2 messages as CDR, like the panel."""

    def __init__(self, endpoint: str) -> None:
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", json.dumps([endpoint]))
        config.insert_json5("scouting/multicast/enabled", "false")
        self.session = zenoh.open(config)
        self._own = f"@/{self.session.info.zid()}/@ros2_lv/"
        self._held: list[zenoh.LivelinessToken] = []

    def ask(self, key: str, payload: bytes, timeout_s: float = 5) -> Iterable[zenoh.Reply]:
        """Sends a request; the replies come as they are iterated over."""
        return self.session.get(key, payload=payload, timeout=timeout_s)

    def get(self, key: str, payload: bytes, timeout_s: float = 5) -> list[zenoh.Reply]:
        return list(self.ask(key, payload, timeout_s))

    def call(self, service: str, type_name: str, *fields: Any, timeout_s: float = 5) -> Any:
        """A service's response; a call without exactly one reply fails."""
        replies = self.get(service, encoded(f"{type_name}_Request", *fields), timeout_s)
        return response(type_name, replies)

    @contextmanager
    def hearing(self, key: str, type_name: str) -> Iterator[list[Any]]:
        """Within the block, collects the messages on a topic."""
        heard: list[Any] = []

        def hear(sample: zenoh.Sample) -> None:
            heard.append(decoded(type_name, sample.payload.to_bytes()))

        subscriber = self.session.declare_subscriber(key, hear)
        try:
            yield heard
        finally:
            subscriber.undeclare()

    def join(self, kind: str, key: str, type_name: str, qos: str = "") -> None:
        """Declares a token in the ROS graph until the session ends, so that the bridge keeps its route.

        `MS` for a topic (with a `qos`), `AC` for an action. A route that ends with its robot leaves its
        DDS reader behind, and each such reader delivers another copy of each message.
        """
        parts = [kind, key.replace("/", "§"), type_name.replace("/", "§"), *([qos] if qos else [])]
        self._held.append(self.session.liveliness().declare_token(self._own + "/".join(parts)))

    def tokens(self) -> list[str]:
        """The bridge's liveliness tokens as `<kind>/<key>/<type>[/<qos>]`, with `/` for `§`."""
        replies = self.session.liveliness().get("@/*/@ros2_lv/**", timeout=5)
        keys = [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]
        others = [key for key in keys if key.count("/") > 2 and not key.startswith(self._own)]
        return sorted(key.split("/@ros2_lv/")[1].replace("§", "/") for key in others)

    def close(self) -> None:
        self.session.close()


def response(type_name: str, replies: Iterable[zenoh.Reply]) -> Any:
    got = list(replies)
    answers = payloads(got)
    assert len(answers) == 1, errors(got) or answers
    return decoded(f"{type_name}_Response", answers[0])


def payloads(replies: Iterable[zenoh.Reply]) -> list[bytes]:
    return [reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None]


def errors(replies: Iterable[zenoh.Reply]) -> set[str]:
    """The error replies: `Timeout`, of this session, of the bridge or of both."""
    return {reply.err.payload.to_string() for reply in replies if reply.err is not None}


def served(robot: CycloneRobot, client: Client) -> None:
    """Waits until the bridge has discovered the robot, and the client the bridge's routes.

    Earlier calls would be lost. The bridge creates a service's readers and writers, then its queryable,
    then its token.
    """
    until(lambda: not robot.unmatched(), "the bridge found the robot")
    until(lambda: set(client.tokens()) >= GRAPH, "the robot's services are announced")


@pytest.fixture(scope="module")
def cyclone_bridge() -> Iterator[Bridge]:
    """The bridge that the tests of a file share. A test that ends its bridge uses `own_cyclone_bridge`.

    It ends with the file, because the next file's bridge is on the same domain: a bridge mistakes
    another bridge's readers and writers for a robot's.
    """
    shared = Bridge(domains.cyclone()[0])
    shared.start()
    yield shared
    shared.end()


@pytest.fixture
def own_cyclone_bridge() -> Iterator[Bridge]:
    mine = Bridge(domains.cyclone()[1])
    mine.start()
    yield mine
    mine.end()


@pytest.fixture(scope="module")
def client(cyclone_bridge: Bridge) -> Iterator[Client]:
    """A session for all tests of a file. It receives each message once, also when robots restart."""
    shared = Client(cyclone_bridge.endpoint)
    shared.join("MS", "parameter_events", "rcl_interfaces/msg/ParameterEvent", ":::")
    shared.join("AC", "fibonacci", "example_interfaces/action/Fibonacci")
    yield shared
    shared.close()


@pytest.fixture
def cyclone_robots() -> Iterator[Callable[..., CycloneRobot]]:
    """Starts robots, and ends them after the test."""
    with ExitStack() as stack:

        def made(domain: int, **more: Any) -> CycloneRobot:
            robot = CycloneRobot(domain, **more)
            stack.callback(robot.end)
            return robot

        yield made


@pytest.fixture
def robot(
    cyclone_robots: Callable[..., CycloneRobot], cyclone_bridge: Bridge, client: Client
) -> CycloneRobot:
    """A robot whose services can be called."""
    mine = cyclone_robots(cyclone_bridge.domain)
    served(mine, client)
    return mine


@pytest.fixture
def own_client(own_cyclone_bridge: Bridge) -> Iterator[Client]:
    mine = Client(own_cyclone_bridge.endpoint)
    yield mine
    mine.close()

"""A robot on Cyclone DDS for the tests, driven by JSON lines: see `commands.py`.

It is a true DDS peer of the bridge, without ROS 2: services, an action, parameters and topics, on
the wire as rmw_cyclonedds writes them. It runs in an environment of its own, with `cyclonedds` and
nothing of the kiosk. Unlike a node of rmw_cyclonedds, it drops a request that is too short for its
type.
"""

import os
import sys
import threading
import time
from typing import Any

from commands import obey
from cyclone_action import ABORTED, CANCELED, ActionServer
from cyclone_node import Answer, Node, publishers, qos_of, subscribers
from cyclone_parameters import Parameters
from cyclone_types import (
    DOCK_ROBOT,
    FIBONACCI,
    FOLLOW_WAYPOINTS,
    NAVIGATE_TO_POSE,
    AddTwoInts_Request,
    AddTwoInts_Response,
    Bool,
    CostmapFilterInfo,
    GetTypeDescription_Request,
    GetTypeDescription_Response,
    Gripper,
    Header,
    Jaw,
    OccupancyGridUpdate,
    Quaternion,
    SetBool_Request,
    SetBool_Response,
    String,
    TFMessage,
    Time,
    Transform,
    TransformStamped,
    Trigger_Request,
    Trigger_Response,
    Vector3,
    described,
    plain,
)

# Types of plain topics, each with the hash that ROS 2 computes of its definition.
TOPIC_TYPES: dict[str, tuple[type, str]] = {
    "std_msgs/msg/String": (
        String,
        "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    ),
    "tf2_msgs/msg/TFMessage": (
        TFMessage,
        "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    ),
    "map_msgs/msg/OccupancyGridUpdate": (
        OccupancyGridUpdate,
        "RIHS01_c4095b0be2e4363f8978a1570e0293ee093436f1e1c61d99b48502ac317025e8",
    ),
    "nav2_msgs/msg/CostmapFilterInfo": (
        CostmapFilterInfo,
        "RIHS01_61ce391bf7690f76a331c01c9d5ce8ca71e6c99273b9fb75e48380f05c6dfdc8",
    ),
    "std_msgs/msg/Bool": (
        Bool,
        "RIHS01_feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9",
    ),
}
NAV2 = {
    "/navigate_to_pose": NAVIGATE_TO_POSE,
    "/dock_robot": DOCK_ROBOT,
    "/follow_waypoints": FOLLOW_WAYPOINTS,
}
HEADER = ("guid", "sequence_number", "structure_needs_at_least_one_member")


class Commands:
    def __init__(self, name: str, domain: int) -> None:
        self._node = Node(name, domain, self._called)
        self._calls: list[dict[str, Any]] = []
        self._readers: dict[str, Any] = {}
        self._heard_on: dict[str, list[Any]] = {}
        # Topic → set to end it, and its thread.
        self._repeated: dict[str, tuple[threading.Event, threading.Thread]] = {}
        self._answer_of_set_enabled = (True, "")
        self._slow_s: float | None = 1.0
        self._node.serve("/set_enabled", SetBool_Request, SetBool_Response, self._on_set_enabled)
        self._node.serve("/reset", Trigger_Request, Trigger_Response, self._on_reset)
        self._node.serve("/add_two_ints", AddTwoInts_Request, AddTwoInts_Response, self._on_add)
        for slow in ("/slow", "/slow_2", "/slow_3"):
            self._node.serve(slow, Trigger_Request, Trigger_Response, self._on_slow)
        self._fibonacci = ActionServer(self._node, "/fibonacci", FIBONACCI)
        self._nav2: dict[str, ActionServer] = {}
        self._parameters = Parameters(self._node)
        self._node.start()

    def unmatched(self) -> list[str]:
        """The services that no client's reader and writer have found yet."""
        return [name for name, service in self._node.services.items() if not service.matched]

    def calls(self, service: str = "") -> list[dict[str, Any]]:
        """Every request that was executed, in order."""
        return [call for call in self._calls if service in ("", call["service"])]

    def answer_set_enabled(self, success: bool, message: str = "") -> None:
        self._answer_of_set_enabled = (success, message)

    def answer_slow(self, seconds: float | None) -> None:
        """After how many seconds /slow, /slow_2 and /slow_3 answer; None: never."""
        self._slow_s = seconds

    def fibonacci(self, **settings: Any) -> None:
        self._fibonacci.configure(**settings)

    def goals(self) -> list[dict[str, Any]]:
        return self._fibonacci.goals()

    def abort(self, goal: str = "") -> int:
        return self._fibonacci.end(ABORTED, goal)

    def cancel(self, goal: str = "") -> int:
        return self._fibonacci.end(CANCELED, goal)

    def serve_nav2(self, step_s: float) -> None:
        """Offers /navigate_to_pose, /dock_robot and /follow_waypoints, with the types of Nav2."""
        for name, types in NAV2.items():
            self._nav2[name] = ActionServer(self._node, name, types)
            self._nav2[name].configure(step_s=step_s)
        self._node.tell()

    def step_nav2(self, name: str, step_s: float) -> None:
        self._nav2[name].configure(step_s=step_s)

    def goals_of_nav2(self, name: str) -> list[dict[str, Any]]:
        return self._nav2[name].goals()

    def abort_nav2(self, name: str, error: int) -> int:
        return self._nav2[name].end(ABORTED, error=error)

    def parameters(self) -> dict[str, Any]:
        return self._parameters.values()

    def set_parameter(self, name: str, value: Any) -> None:
        self._parameters.take(name, value)

    def set_parameters(self, values: dict[str, Any]) -> None:
        self._parameters.take_all(values)

    def declare_parameter(self, name: str, value: Any, **descriptor: Any) -> None:
        self._parameters.declare(name, value, **descriptor)

    def undeclare_parameter(self, name: str) -> None:
        self._parameters.undeclare(name)

    def answer_parameters(self, service: str, seconds: float | None) -> None:
        self._parameters.answer(service, seconds)

    def refuse_parameters(self, reason: str) -> None:
        self._parameters.refusal = reason

    def refuse_value(self, name: str, value: Any) -> None:
        """The node does not take this value of a parameter, which its descriptor permits."""
        self._parameters.odd[name] = value

    def parameter_requests(self, service: str) -> int:
        return self._parameters.requests(service)

    def advertise(self, topic: str, type: str, hash: str = "", **qos: Any) -> None:
        """`hash` is that of another definition of the type."""
        idl, own_hash = TOPIC_TYPES[type]
        hash_ = hash or own_hash
        profile = qos_of(**qos, user_data=f"typehash={hash_};")
        self._node.advertise(topic, idl, profile)
        self._node.tell()

    def publish(self, topic: str, fields: dict[str, Any]) -> None:
        publisher = self._node.published[topic]
        publisher.write(publisher.data_type(**fields))

    def update_map(self, topic: str, x: int, y: int, width: int, data: list[int]) -> None:
        """Publishes new cells of a part of the map."""
        header = Header(Time.at(time.time_ns()), "map")
        update = OccupancyGridUpdate(header, x, y, width, len(data) // width, data)
        self._node.published[topic].write(update)

    def filter_info(self, topic: str, mask: str, kind: int = 0) -> None:
        """Publishes of which filter a mask is: of a keepout filter (0), or of speeds in percent (1)."""
        header = Header(Time.at(time.time_ns()), "map")
        self._node.published[topic].write(CostmapFilterInfo(header, kind, mask, 0.0, 1.0))

    def transform(self, topic: str, parent: str, child: str, x: float, hz: float = 0.0) -> None:
        """Publishes where a frame is in another one: once, or so many times a second with the time of
        now, until the next call for the topic."""
        if (before := self._repeated.pop(topic, None)) is not None:
            ended, thread = before
            ended.set()
            thread.join()  # it publishes no more after this

        def publish() -> None:
            header = Header(Time.at(time.time_ns()), parent)
            way = Transform(Vector3(x), Quaternion())
            message = TFMessage([TransformStamped(header, child, way)])
            self._node.published[topic].write(message)

        publish()
        if not hz:
            return
        stop = threading.Event()

        def repeat() -> None:
            while not stop.wait(1 / hz):
                publish()

        repeating = threading.Thread(target=repeat, daemon=True)
        self._repeated[topic] = stop, repeating
        repeating.start()

    def subscribers(self, topic: str) -> int:
        """How many listen to a topic, be it the action's or `/parameter_events`."""
        return subscribers(self._node.published[topic])

    def subscribe(self, topic: str, type: str, **qos: Any) -> None:
        idl, hash_ = TOPIC_TYPES[type]
        heard = self._heard_on.setdefault(topic, [])
        profile = qos_of(**qos, user_data=f"typehash={hash_};")
        self._readers[topic] = self._node.subscribe(
            topic, idl, profile, lambda message: heard.append(plain(message))
        )
        self._node.tell()

    def publishers(self, topic: str) -> int:
        return publishers(self._readers[topic])

    def heard(self, topic: str) -> list[Any]:
        return self._heard_on[topic]

    def describe_gripper(self, types: list[dict[str, Any]], hash: str) -> None:
        """Publishes gripper_msgs/msg/Gripper on /gripper, and describes it by `get_type_description`
        to who gives its hash."""

        def describe(request: GetTypeDescription_Request, answer: Answer) -> None:
            good = (request.type_name, request.type_hash) == (types[0]["type_name"], hash)
            reason = "" if good else "no such type"
            answer(GetTypeDescription_Response(good, reason, described(types), [], []))

        service = f"/{self._node.name}/get_type_description"
        self._node.serve(service, GetTypeDescription_Request, GetTypeDescription_Response, describe)
        self._node.advertise(
            "/gripper",
            Gripper,
            qos_of(depth=1, durability="transient_local", user_data=f"typehash={hash};"),
        )
        self._node.tell()
        self._node.published["/gripper"].write(Gripper(0.05, [Jaw("left", 2.5), Jaw("right", 3.0)]))

    def close(self) -> None:
        self._node.close()

    def _called(self, service: str, request: Any) -> None:
        """Keeps what came, without what is not of its definition."""
        sent = {name: value for name, value in plain(request).items() if name not in HEADER}
        self._calls.append({"service": service, "request": sent})

    def _on_set_enabled(self, request: SetBool_Request, answer: Answer) -> None:
        success, message = self._answer_of_set_enabled
        answer(SetBool_Response(success, message))

    def _on_reset(self, request: Trigger_Request, answer: Answer) -> None:
        answer(Trigger_Response(True, "reset"))

    def _on_add(self, request: AddTwoInts_Request, answer: Answer) -> None:
        answer(AddTwoInts_Response(request.a + request.b))

    def _on_slow(self, request: Trigger_Request, answer: Answer) -> None:
        if self._slow_s is None:
            return
        later = threading.Timer(self._slow_s, answer, [Trigger_Response(True, "done")])
        later.daemon = True
        later.start()


def main() -> None:
    commands = Commands(sys.argv[1], int(os.environ["ROS_DOMAIN_ID"]))
    obey(commands)
    commands.close()


if __name__ == "__main__":
    main()

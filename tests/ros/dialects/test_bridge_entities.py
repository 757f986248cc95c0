"""The bridge's answers about DDS readers and writers, nodes and routes."""

from typing import Any

import pytest

from app.ros.dialects.bridge_entities import DdsEntity, entity_of, node_place, qos_of, route_place

HASH = "RIHS01_feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9"
FAST, CYCLONE = "010f78fdb176d54800000000000001c1", "01103b80c068b0dad3529cde000001c1"
BOOL = "std_msgs::msg::dds_::Bool_"


def parsed(participant: str = FAST, role: str = "writer", **qos: Any) -> DdsEntity:
    answer = {"topic_name": "rt/on", "type_name": BOOL, "qos": qos}
    entity = entity_of(f"@/a/ros2/dds/{participant}/{role}/{participant[:30]}03/rt/on", answer)
    assert entity is not None
    return entity


def test_qos_and_type_of_a_dds_writer() -> None:
    entity = parsed(
        reliability={"kind": "RELIABLE"},
        durability={"kind": "TRANSIENT_LOCAL"},
        history={"kind": "KEEP_LAST", "depth": 5},
        user_data=list(f"typehash={HASH};".encode()),
    )
    assert (entity.name, entity.type, entity.type_hash) == ("/on", "std_msgs/msg/Bool", HASH)
    assert (entity.reliable, entity.transient_local, entity.keep_all, entity.depth) == (
        True,
        True,
        False,
        5,
    )
    assert entity.vendor == "Fast DDS"


@pytest.mark.parametrize(("role", "reliable"), [("writer", True), ("reader", False)])
def test_omitted_qos_is_the_default_of_dds(role: str, reliable: bool) -> None:
    entity = parsed(role=role)
    assert (entity.reliable, entity.transient_local, entity.depth) == (reliable, False, None)
    assert parsed(participant=CYCLONE).depth == 1


def test_the_qos_in_a_token() -> None:
    answer = qos_of(f"@/a/@ros2_lv/MP/on/t/:1:1:0,7:typehash={HASH};")
    assert (answer.reliable, answer.transient_local, answer.depth, answer.type_hash) == (
        True,
        True,
        7,
        HASH,
    )
    assert qos_of("@/a/@ros2_lv/MS/on/t/:0:::").reliable is False
    assert qos_of("@/a/@ros2_lv/MS/on/t/::::").reliable is None
    assert qos_of("@/a/@ros2_lv/MS/on/t/K:1::1,:").keep_all
    assert qos_of("nonsense").depth is None


def test_malformed_places_are_none() -> None:
    assert route_place("@/a/ros2/route/topic/in/x") is None
    assert node_place(f"@/a/ros2/node/{FAST}/a node") is None
    assert node_place(f"@/a/ros2/node/{FAST}/arm/driver") == ("a", FAST, "/arm/driver")

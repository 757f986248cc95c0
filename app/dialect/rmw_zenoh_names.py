"""How rmw_zenoh writes ROS 2 names, types and QoS in key expressions and tokens. Pure.

Source: the design of rmw_zenoh (github.com/ros2/rmw_zenoh, docs/design.md), tried with rmw_zenoh_cpp.
"""

import re
from typing import Final, NamedTuple

from app.interfaces.names import NO_TYPE, Qos, valid_type

ANY_TYPE: Final = "*"  # in place of a type of which any is meant
ROOT: Final = "%"  # an empty namespace or enclave
# By the names of rmw/types.h. 0 is the system's default, which is `RELIABLE`, `VOLATILE` and
# `KEEP_LAST` in rmw_zenoh; what equals the default may be left out.
BEST_EFFORT: Final = "2"
TRANSIENT_LOCAL: Final = "1"
KEEP_ALL: Final = "2"
_DDS_TYPE = re.compile(r"(?P<package>\w{1,255})::(?P<kind>msg|srv|action)::dds_::(?P<name>\w{1,255})_")
_QOS = re.compile(
    r"(?P<reliability>[0-4]?):(?P<durability>[0-4]?):(?P<history>[0-3]?),(?P<depth>\d{0,9})"
    r":\d*,\d*:\d*,\d*:\d*,\d*,\d*"
)


class TokenQos(NamedTuple):
    """The QoS in a token."""

    reliable: bool = True
    transient_local: bool = False
    keep_all: bool = False
    depth: int = 0


def dds_type(type_name: str) -> str:
    """The type as key expressions have it: "std_msgs/msg/String" → "std_msgs::msg::dds_::String_"."""
    package, kind, name = type_name.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def ros_type(dds_name: str) -> str:
    """The same back; `NO_TYPE` for what is not a type."""
    match = _DDS_TYPE.fullmatch(dds_name)
    return valid_type("/".join(match.group("package", "kind", "name"))) if match else NO_TYPE


def mangled(name: str) -> str:
    """A name as a part of a token: "/arm/state" → "%arm%state", "" → "%"."""
    return name.replace("/", "%") or ROOT


def demangled(part: str) -> str:
    """The same back; "" for a root."""
    return "" if part == ROOT else part.replace("%", "/")


def qos_part(qos: Qos) -> str:
    """The QoS of a token: what is not the default, and the depth."""
    reliability = "" if qos.reliable else BEST_EFFORT
    durability = TRANSIENT_LOCAL if qos.transient_local else ""
    return f"{reliability}:{durability}:,{qos.depth}:,:,:,,"


def parse_qos(part: str) -> TokenQos | None:
    """The QoS of a token; None for what is none."""
    match = _QOS.fullmatch(part)
    if match is None:
        return None
    return TokenQos(
        match["reliability"] != BEST_EFFORT,
        match["durability"] == TRANSIENT_LOCAL,
        match["history"] == KEEP_ALL,
        int(match["depth"] or 0),
    )

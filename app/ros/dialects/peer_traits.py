"""What depends on the kind of peer that a robot is reached by: times, limits and sentences. A row for
each dialect. No I/O."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

from app.ros.dialects.dialect import DialectName


@dataclass(frozen=True, slots=True, kw_only=True)
class PeerSentences:
    """The sentences that are about a kind of peer: codes of the catalogue (`app.system.texts`).

    Those of locks are the codes of their verdicts too. `absent`, `silent` and `unqueryable` are the
    codes of the doctor's findings too.
    """

    lamp: str  # the name of the lamp for the link to the peer
    # Why the link locks all commands.
    unreachable: str
    unreachable_at: str  # the same with `where`: the endpoints that the configuration names
    absent: str
    absent_named: str  # the same with the robot's `name`
    silent: str
    unqueryable: str  # it refuses the panel's queries: its admin space is off; "" where that can't be
    # Why it locks some of them.
    unrouted: str  # `topic` is not forwarded
    uncallable: str  # the server `name` is on the DDS `vendor`, which can't be called
    # The state of the robot's nodes.
    nodes_unknown: str
    nodes_absent: str
    node_lost: str  # `name` was there before
    # The results of commands.
    no_reply: str  # a call of `service` ended without a reply
    timeout_hint: str  # why there may be no response in time; "" for no hint
    press_unconfirmed: str  # a message on `topic`, at `time`, may not have arrived
    stop_unconfirmed: str  # the same for the stop message of a hold
    renewal: str  # why a hold ended: the session with the peer is replaced

    @property
    def link_codes(self) -> frozenset[str]:
        """The codes of the verdicts that lock all commands because of this peer."""
        codes = {self.unreachable, self.absent, self.absent_named, self.silent, self.unqueryable}
        return frozenset(codes - {""})


@dataclass(frozen=True, slots=True, kw_only=True)
class PeerTraits:
    """What the panel has to expect from a kind of peer. Times in seconds."""

    server_settle_s: float  # from a server's token to routes that carry the first call
    loss_delay_s: float  # from the end of a query to the end of the lost peer's token, at most
    events_settle_s: float  # from a node's token until its parameter events surely arrive
    max_unanswered: int  # requests of one service that may be open at a time
    # From a message to the token of its publisher, at most; see `robot.silent_publishers`.
    token_delay_s: float
    token_delay_single_s: float  # where no other publisher can have sent the message
    token_delay_latched_s: float  # of a TRANSIENT_LOCAL publisher
    has_dds_qos: bool  # publishers and subscribers of an incompatible QoS exchange nothing
    # Whether the stamp of each message names the peer that it came by. Else a router may have stamped
    # it: then it may be of any of them.
    stamped_by_peer: bool
    # For commands on a terminal, in English.
    title: str
    answering: str  # what answers for the nodes
    start_hint: str  # what to do if there is none
    elsewhere_hint: str  # more to do if it is on another machine; "" for none
    sentences: PeerSentences


# Measured with zenoh-bridge-ros2dds 1.10. A call sent in the same millisecond as the server's token
# appeared was lost 2 times in 30, none after 5 ms, with all on one machine. The bridge keeps ten
# requests of a service. Token delays: docs/permissions.md.
BRIDGE_TRAITS: Final = PeerTraits(
    server_settle_s=0.2,
    loss_delay_s=0.3,
    events_settle_s=3.0,
    max_unanswered=8,
    token_delay_s=0.5,
    token_delay_single_s=4.0,
    token_delay_latched_s=5.0,
    has_dds_qos=True,
    stamped_by_peer=True,
    title="bridge to ROS 2",
    answering="bridge",
    start_hint="start zenoh-bridge-ros2dds on the robot, or name its place with --connect"
    " tcp/HOST:7447",
    elsewhere_hint=". As shipped, the bridge accepts connections from its own machine only: put this"
    " address into `listen` of its file",
    sentences=PeerSentences(
        lamp="bridge",
        unreachable="link_unreachable",
        unreachable_at="link_unreachable_at",
        absent="link_no_bridge",
        absent_named="link_no_bridge_in_namespace",
        silent="link_bridge_silent",
        unqueryable="",
        unrouted="topic_not_forwarded",
        uncallable="service_wrong_rmw",
        nodes_unknown="link_node_unknown",
        nodes_absent="link_node_absent",
        node_lost="link_node_gone",
        no_reply="call_no_reply_from_bridge",
        timeout_hint="service_cyclone_hint",
        press_unconfirmed="press_bridge_no_response",
        stop_unconfirmed="hold_stop_unconfirmed",
        renewal="hold_by_reconnect",
    ),
)
# A node declares its publisher's token before it can publish, and Zenoh keeps the order of a session.
RMW_ZENOH_TRAITS: Final = PeerTraits(
    server_settle_s=0.1,
    loss_delay_s=0.3,
    events_settle_s=0.5,
    max_unanswered=8,
    token_delay_s=0.1,
    token_delay_single_s=0.1,
    token_delay_latched_s=0.5,
    has_dds_qos=False,
    stamped_by_peer=False,
    title="ROS 2 node on rmw_zenoh",
    answering="Zenoh router",
    start_hint="start the Zenoh router and the robot's nodes (RMW_IMPLEMENTATION=rmw_zenoh_cpp), or"
    " name their place with --connect tcp/HOST:7447; the panel's `domain` must be their ROS_DOMAIN_ID",
    elsewhere_hint="",
    sentences=PeerSentences(
        lamp="router",
        unreachable="link_router_unreachable",
        unreachable_at="link_router_unreachable_at",
        absent="link_no_ros_node",
        absent_named="link_no_ros_node_named",
        silent="link_router_silent",
        unqueryable="link_router_no_admin",
        unrouted="topic_not_forwarded",
        uncallable="service_wrong_rmw",
        nodes_unknown="link_node_unknown_router",
        nodes_absent="link_node_absent_domain",
        node_lost="link_node_endpoint_gone",
        no_reply="call_no_reply_from_node",
        timeout_hint="",
        press_unconfirmed="press_router_no_response",
        stop_unconfirmed="hold_stop_unconfirmed_router",
        renewal="hold_by_reconnect",
    ),
)
# Until the tokens that are there have shown the kind of peer.
AUTO_TRAITS: Final = replace(
    BRIDGE_TRAITS,
    start_hint=f"{BRIDGE_TRAITS.start_hint}; if the robot's nodes run on rmw_zenoh, start its Zenoh"
    " router and its nodes",
    sentences=replace(
        BRIDGE_TRAITS.sentences, absent="link_no_peer", absent_named="link_no_peer_named"
    ),
)
# Both kinds are there, and the panel file does not say which of them is the robot.
AMBIGUOUS_TRAITS: Final = replace(
    AUTO_TRAITS,
    sentences=replace(
        AUTO_TRAITS.sentences,
        absent="link_two_kinds",
        absent_named="link_two_kinds",
        silent="link_two_kinds",
    ),
)
PEER_TRAITS: Final[Mapping[DialectName, PeerTraits]] = {
    "auto": AUTO_TRAITS,
    "bridge": BRIDGE_TRAITS,
    "rmw_zenoh": RMW_ZENOH_TRAITS,
}
EVERY_SENTENCES: Final = tuple(traits.sentences for traits in (*PEER_TRAITS.values(), AMBIGUOUS_TRAITS))

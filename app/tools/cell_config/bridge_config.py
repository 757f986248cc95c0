"""A configuration of zenoh-bridge-ros2dds that allows what a panel needs of one robot, and nothing
else. Source of the keys: `config.rs` of zenoh-plugin-ros2dds 1.10, tested. No I/O.
"""

import json
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from app.cell.link.declarations import declarations
from app.cell.link.rosout import LOG_TYPE
from app.cell.robot.state import RobotState
from app.panel.model import Panel, RobotEntry
from app.panel.widgets.parameter import SERVICES, SET, SET_ATOMICALLY
from app.panel.widgets.service_action import Action, Call
from app.ros.dialects.bridge_dialect import TOKENS, BridgeDialect
from app.ros.dialects.dialect import PanelEndpoint
from app.ros.dialects.peer_traits import BRIDGE_TRAITS
from app.ros.messages import Interfaces
from app.ros.messages.names import GLOBAL, ROSOUT, ROSOUT_TOPIC, SHARED_TOPICS, key_of
from app.system.printable import printable
from app.tools.cell_config.access_rules import (
    PanelUse,
    Rule,
    TlsFiles,
    access_control,
    panel_rules,
    tls_link,
)

# What a panel may do at a bridge, for the bridge's access control. No I/O.

ADMIN: Final = "@/*/ros2/**"  # version, configuration, routes, nodes and DDS entities of a bridge
ANY: Final = "*"


def bridge_rules(panel: Panel, interfaces: Interfaces, entry: RobotEntry | None) -> list[Rule]:
    """All that the panel's session does at a bridge. What QoS and type hash its tokens say is left
    open: they follow the robot's."""
    dialect = BridgeDialect()
    robot = RobotState(panel, interfaces, dialect, BRIDGE_TRAITS, entry=entry)
    own = dialect.own_tokens(ANY, _endpoints(panel, robot))
    use = PanelUse(
        declared=declarations(panel, interfaces, robot),
        on_demand=(dialect.topic(robot.key(topic), name) for topic, name in panel.on_demand().items()),
        admin=(ADMIN,),
        graph=(TOKENS,),
        tokens=map(_pattern, own),
    )
    return panel_rules(use)


def _endpoints(panel: Panel, robot: RobotState) -> Iterator[PanelEndpoint]:
    for topic, name in panel.publications().items():
        yield PanelEndpoint("MP", robot.key(topic), name)
    yield PanelEndpoint("MP", robot.key(ROSOUT_TOPIC), LOG_TYPE, ROSOUT)
    for topic, name in panel.listened().items():
        yield PanelEndpoint("MS", robot.key(topic), name)
    for action, name in panel.actions().items():
        yield PanelEndpoint("AC", robot.key(action), name)


def _pattern(token: str) -> str:
    """The token with any QoS, of those that have one."""
    parts = token.split("/")
    return "/".join([*parts[:6], ANY]) if len(parts) > 6 else token


LISTEN: Final = ("tcp/127.0.0.1:7447",)
TIMEOUT_S: Final = 5.0  # the bridge's own, for each query that is not listed
LISTED: Final = "publishers subscribers service_servers service_clients action_servers action_clients"


@dataclass(frozen=True, slots=True, kw_only=True)
class BridgeOptions:
    """The settings of a bridge that are not in a panel file. `prefixed`: the robot's nodes have the
    panel's namespace in their own names; else the bridge adds it."""

    domain: int = 0
    listen: Sequence[str] = LISTEN
    nodename: str = "web_ui"
    prefixed: bool = False
    tls: TlsFiles | None = None


def allowed(panel: Panel) -> dict[str, list[str]]:
    """The names that the bridge must allow, by kind of endpoint, as the robot's nodes have them."""
    names: Mapping[str, Collection[str]] = {
        "publishers": panel.listened(),
        "subscribers": {*panel.publications(), ROSOUT_TOPIC},
        "service_servers": panel.services(),
        "service_clients": (),
        "action_servers": panel.actions(),
        "action_clients": (),
    }
    return {kind: sorted(names[kind]) for kind in LISTED.split()}


def timeouts(panel: Panel) -> tuple[dict[str, float], dict[str, float]]:
    """Services and actions with a longer timeout than the bridge's default, by name in seconds."""
    services: dict[str, float] = {}
    actions: dict[str, float] = {}
    for widget in panel.senders():
        if isinstance(widget, Call) and widget.timeout_s > TIMEOUT_S:
            services[widget.service] = max(widget.timeout_s, services.get(widget.service, 0))
        elif isinstance(widget, Action) and widget.timeout_s > TIMEOUT_S:
            actions[widget.action] = max(widget.timeout_s, actions.get(widget.action, 0))
    for widget in panel.parameters():
        if widget.timeout_s > TIMEOUT_S:
            for service, _ in SERVICES:
                name = f"{widget.node}/{service}"
                services[name] = max(widget.timeout_s, services.get(name, 0))
    for load in panel.recipe_loads:
        if load.parameters and load.set.timeout_s > TIMEOUT_S:
            for service, _ in (SET, SET_ATOMICALLY):
                name = f"{load.set.node}/{service}"
                services[name] = max(load.set.timeout_s, services.get(name, 0))
    return services, actions


def bridge_config(
    panel: Panel, interfaces: Interfaces, entry: RobotEntry | None, options: BridgeOptions
) -> str:
    """The file's text, JSON5 with comments. `entry` is one of several robots."""
    namespace = entry.namespace if entry else panel.namespace
    names = _Names(namespace, options.prefixed)
    return "\n".join(
        [
            f"// The bridge beside the robot, for the panel {_comment(str(panel.title))}.",
            "// zenoh-bridge-ros2dds -c bridge.json5",
            "{",
            '  mode: "router",',
            f"  // Where the panel's server connects: `connect` in its Zenoh configuration.\n"
            f"  listen: {{ endpoints: {json.dumps(list(options.listen))} }},",
            *_link(options.tls),
            "  // What is not named here is denied: no one else says what the robot says.",
            *access_control(bridge_rules(panel, interfaces, entry), options.tls),
            "  plugins: {",
            "    ros2dds: {",
            "      // What `ros2 node list` shows.",
            f"      nodename: {json.dumps(options.nodename)},",
            "      // ROS_DOMAIN_ID of the robot: the same number here as in its nodes.",
            f"      domain: {options.domain},",
            *_namespace(namespace, options.prefixed),
            _BLOCKING,
            *_timeouts(panel, names),
            *_allow(panel, names),
            "    },",
            "  },",
            "}",
            "",
        ]
    )


def _comment(text: str) -> str:
    return printable(text).replace("\n", " ")


def _namespace(namespace: str, prefixed: bool) -> Iterator[str]:
    if namespace and not prefixed:
        yield "      // The bridge puts it before each name: the panel file's `namespace`."
        yield f"      namespace: {json.dumps(namespace)},"
    elif namespace:
        yield f"      // No namespace here: the robot's nodes have {namespace} in their own names."


@dataclass(frozen=True, slots=True)
class _Names:
    """The panel's names as this bridge's robot has them."""

    namespace: str
    prefixed: bool

    def on_robot(self, name: str) -> str | None:
        """The name on the robot; None if this bridge can't have it: it puts its namespace before each
        name, and this one is not below it."""
        if self.prefixed and name not in SHARED_TOPICS:
            return f"/{key_of(name, self.namespace)}"
        if not name.startswith(GLOBAL):
            return name
        inner = name[1:].removeprefix(self.namespace)
        return inner if inner.startswith("/") and (inner != name[1:] or not self.namespace) else None


def _timeouts(panel: Panel, names: _Names) -> Iterator[str]:
    services, actions = timeouts(panel)
    if services or actions:
        yield "      // Seconds for an answer, where the panel waits longer than the bridge by itself."
        yield "      queries_timeout: {"
        yield f"        default: {TIMEOUT_S},"
        yield f"        services: {_timed(services, names)},"
        yield f"        actions: {{ send_goal: {_timed(actions, names)} }},"
        yield "      },"


def _timed(limits: Mapping[str, float], names: _Names) -> str:
    known = ((names.on_robot(name), seconds) for name, seconds in sorted(limits.items()))
    return json.dumps([f"^{name}$={seconds:g}" for name, seconds in known if name is not None])


def _allow(panel: Panel, names: _Names) -> Iterator[str]:
    every = allowed(panel)
    yield "      // Nothing else of the robot goes through: not to the panel, and not to its nodes."
    for name in sorted({name for some in every.values() for name in some}):
        if names.on_robot(name) is None:
            yield f"      // {name} is not below {names.namespace}: it needs another bridge."
    yield "      allow: {"
    for kind, some in every.items():
        known = [own for name in some if (own := names.on_robot(name)) is not None]
        yield from _named(kind, sorted(known))
    yield "      },"


def _named(kind: str, names: Iterable[str]) -> Iterator[str]:
    """Each is a regular expression; a ROS 2 name has no character that means anything in one."""
    lines = [f"          {json.dumps(name)}," for name in names]
    if not lines:
        yield f"        {kind}: [],"
        return
    yield f"        {kind}: ["
    yield from lines
    yield "        ],"


def _link(tls: TlsFiles | None) -> Iterator[str]:
    yield _LINK
    if tls is not None:
        yield from tls_link(tls, "      ")
    yield "    },"
    yield "  },"


_LINK: Final = """\
  scouting: {
    multicast: { enabled: false },
  },
  transport: {
    link: {
      // The panel counts a frozen bridge as lost after this many ms of silence (default: 10000).
      tx: {
        lease: 2000,
        keep_alive: 4,
        // A panel that takes nothing for so long (µs; default: 5 s) is cut off, and locks.
        queue: { congestion_control: { block: { wait_before_close: 200000 } } },
      },"""

_BLOCKING: Final = """\
      // What a reliable publisher says reaches the panel, or the panel is cut off: with false the
      // bridge drops in silence what finds no room, and a lost `false` would leave a control open.
      reliable_routes_blocking: true,"""

"""A configuration of a Zenoh router (zenohd) for a robot whose nodes run on rmw_zenoh, with access
control: the nodes may do everything, everyone else only what a panel needs. Source of the keys:
`DEFAULT_CONFIG.json5` of Zenoh 1.10, tested. No I/O.

Zenoh tells sessions apart by the way on which they come. What an access control list does not name is
denied, in both directions.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from app.cell.link.declarations import declarations
from app.cell.link.rmw_zenoh import panel_endpoints
from app.cell.robot.state import RobotState
from app.panel.model import Panel, RobotEntry
from app.ros.dialects.bridge_dialect import TOKENS as BRIDGE_TOKENS
from app.ros.dialects.dialect import any_hash
from app.ros.dialects.peer_traits import RMW_ZENOH_TRAITS
from app.ros.dialects.rmw_zenoh import NODE_PARTS, PANEL_NODE, RmwZenohDialect, every_token
from app.ros.messages import Interfaces
from app.system.printable import printable
from app.tools.cell_config import access_rules
from app.tools.cell_config.access_rules import (
    EVERYTHING,
    PanelUse,
    Rule,
    TlsFiles,
    access_control,
    tls_link,
)

PORT: Final = "7447"
FOR_NODES: Final = f"tcp/127.0.0.1:{PORT}"  # where nodes look for their router
LISTEN: Final = ("unixsock-stream//run/zenohd/panel.sock",)
NODES: Final = ("lo",)
NODE_PROTOCOL: Final = "tcp"
ANY_ADDRESS: Final = (f"tcp/0.0.0.0:{PORT}", f"tcp/[::]:{PORT}")
# `**` stands for no part that begins with "@": the admin space, tokens, and the caches of publishers.
EVERYWHERE: Final = ("**", "@/**", "@ros2_lv/**", "**/@adv/**")
MESSAGES: Final = (
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "declare_queryable",
    "reply",
    "liveliness_token",
    "declare_liveliness_subscriber",
    "liveliness_query",
)
ROUTER: Final = "@/*/router"  # what the panel asks to see whether the router responds
ANY: Final = "*"


@dataclass(frozen=True, slots=True, kw_only=True)
class RouterOptions:
    """The settings of a router that are not in a panel file. `listen` is where the panel connects,
    `nodes` are the network interfaces by which the robot's nodes come."""

    domain: int = 0
    listen: Sequence[str] = LISTEN
    nodes: Sequence[str] = NODES
    tls: TlsFiles | None = None


def panel_rules(
    panel: Panel, interfaces: Interfaces, entry: RobotEntry | None, domain: int
) -> list[Rule]:
    """All that the panel's session does at a router, from the table that the session itself reads. Type
    hashes are left open: a node does not receive what has another one than its own."""
    dialect = RmwZenohDialect(domain, any_hash)
    robot = RobotState(panel, interfaces, dialect, RMW_ZENOH_TRAITS, entry=entry)
    on_demand = (dialect.topic(robot.key(topic), name) for topic, name in panel.on_demand().items())
    own = dialect.node_tokens(ANY, PANEL_NODE, panel_endpoints(panel, robot.key))
    use = PanelUse(
        declared=declarations(panel, interfaces, robot),
        on_demand=on_demand,
        admin=(ROUTER,),
        graph=(every_token(domain), BRIDGE_TOKENS),  # a panel may look whether a bridge is there
        tokens=map(_pattern, own),
    )
    return access_rules.panel_rules(use)


def _pattern(token: str) -> str:
    """The tokens of this kind of any session and of any panel's node: a second one is `web_ui_2`, those
    of commands begin with the name too."""
    parts = token.split("/")
    parts[4] = ANY
    parts[NODE_PARTS - 1] = f"{PANEL_NODE}$*"
    if len(parts) > NODE_PARTS:
        parts[-1] = ANY
    return "/".join(parts)


def router_config(
    panel: Panel, interfaces: Interfaces, entry: RobotEntry | None, options: RouterOptions
) -> str:
    """The file's text, JSON5 with comments. `entry` is one of several robots."""
    rules = panel_rules(panel, interfaces, entry, options.domain)
    nodes = {"interfaces": options.nodes, "link_protocols": [NODE_PROTOCOL]}
    return "\n".join(
        [
            f"// The Zenoh router of a robot on rmw_zenoh, for the panel {_comment(str(panel.title))}.",
            "// zenohd -c router.json5",
            "{",
            '  mode: "router",',
            "  // The robot's nodes come to the first. The panel comes to the others: `connect` in its",
            "  // zenoh.json5.",
            f"  listen: {{ endpoints: {json.dumps(_listen(options))} }},",
            *_link(options.tls),
            _SETTINGS,
            *access_control([EVERYTHING_RULE, *rules], options.tls, nodes),
            "}",
            "",
        ]
    )


def _listen(options: RouterOptions) -> list[str]:
    for_nodes = () if any(end in ANY_ADDRESS for end in options.listen) else (FOR_NODES,)
    return list(dict.fromkeys((*for_nodes, *options.listen)))


def _comment(text: str) -> str:
    return printable(text).replace("\n", " ")


def _link(tls: TlsFiles | None) -> Iterator[str]:
    if tls is not None:
        yield "  transport: {"
        yield "    link: {"
        yield from tls_link(tls, "      ")
        yield "    },"
        yield "  },"


EVERYTHING_RULE: Final = Rule(EVERYTHING, MESSAGES, True, EVERYWHERE)
_SETTINGS: Final = """\
  scouting: {
    multicast: { enabled: false },
  },
  // The panel asks it to see whether the router responds.
  adminspace: { enabled: true, permissions: { read: true, write: false } },"""

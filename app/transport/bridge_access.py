"""What a panel may do at a bridge, for the bridge's access control. No I/O."""

from collections.abc import Iterator
from typing import Final

from app.dialect.bridge_dialect import TOKENS, BridgeDialect
from app.dialect.endpoint import OwnEndpoint
from app.dialect.peer_traits import BRIDGE_TRAITS
from app.interfaces import Interfaces
from app.interfaces.names import ROSOUT, ROSOUT_TOPIC
from app.panel.model import Panel, RobotEntry
from app.robot.state import RobotState
from app.transport.access_rules import PanelUse, Rule, panel_rules
from app.transport.declarations import declarations
from app.transport.rosout import LOG_TYPE

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


def _endpoints(panel: Panel, robot: RobotState) -> Iterator[OwnEndpoint]:
    for topic, name in panel.publications().items():
        yield OwnEndpoint("MP", robot.key(topic), name)
    yield OwnEndpoint("MP", robot.key(ROSOUT_TOPIC), LOG_TYPE, ROSOUT)
    for topic, name in panel.listened().items():
        yield OwnEndpoint("MS", robot.key(topic), name)
    for action, name in panel.actions().items():
        yield OwnEndpoint("AC", robot.key(action), name)


def _pattern(token: str) -> str:
    """The token with any QoS, of those that have one."""
    parts = token.split("/")
    return "/".join([*parts[:6], ANY]) if len(parts) > 6 else token

"""How the robots of each dialect are reached: a row for each choice of a panel."""

from typing import Final

from app.dialect.dialect import DialectName
from app.transport.auto_peer import AUTO
from app.transport.bridge_peer import BRIDGE
from app.transport.peer import RobotAccess
from app.transport.rmw_zenoh_peer import RMW_ZENOH

ROBOT_ACCESS: Final[dict[DialectName, RobotAccess]] = {
    "auto": AUTO,
    "bridge": BRIDGE,
    "rmw_zenoh": RMW_ZENOH,
}

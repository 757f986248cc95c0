"""How the robots of each dialect are reached: a row for each choice of a panel."""

from typing import Final

from app.cell.link.auto_peer import AUTO
from app.cell.link.bridge import BRIDGE
from app.cell.link.peer import RobotAccess
from app.cell.link.rmw_zenoh import RMW_ZENOH
from app.ros.dialects.dialect import DialectName
from app.ros.zenoh.config import Config

ROBOT_ACCESS: Final[dict[DialectName, RobotAccess]] = {
    "auto": AUTO,
    "bridge": BRIDGE,
    "rmw_zenoh": RMW_ZENOH,
}


async def detect_access(name: DialectName, config: Config, domain: int) -> list[RobotAccess]:
    """How a command reaches the robot: the row of this dialect; if what is there decides, that of each
    kind that is there now. Never empty."""
    access = ROBOT_ACCESS[name]
    kinds = await access.kinds(config, domain) if access.kinds else ()
    return [ROBOT_ACCESS[kind] for kind in sorted(kinds)] or [access]

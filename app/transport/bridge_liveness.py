"""Whether a robot's bridges answer: they are asked for their versions."""

from app.dialect import bridge_dialect
from app.ros_logging import RobotLog
from app.transport.liveness import PeerLiveness


class BridgeLiveness(PeerLiveness):
    """Detects whether one robot's bridges respond."""

    def queries(self) -> frozenset[str]:
        return frozenset(map(bridge_dialect.version, self.robot.graph.peers))

    def log_answer(self, log: RobotLog) -> None:
        log.info("the bridge answers")

    def log_silence(self, log: RobotLog) -> None:
        log.warning("the bridge does not answer")

"""Passes the lines of logs on to where they are kept."""

from app.robot.log_lines import LogLines
from app.robot.sample import Sample
from app.robot.state import RobotState


class LogListener:
    """The `SampleListener` of a robot's logs."""

    def __init__(self, robot: RobotState) -> None:
        self._lines: dict[str, LogLines] = robot.log_lines

    @property
    def keys(self) -> frozenset[str]:
        return frozenset(self._lines)

    def record_sample(self, key: str, sample: Sample) -> None:
        """A line came."""
        self._lines[key].add(sample.payload)

"""Adds the samples of log topics to the robot's log lines."""

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
        """A line was received."""
        self._lines[key].add(sample.payload)

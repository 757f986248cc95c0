"""The robot's clocks against this machine's: that of the bridge's machine, by Zenoh's time stamps, and
that of the nodes, by the stamps in their headers. Pure.
"""

from collections.abc import Iterable, Iterator
from statistics import median
from typing import Final

from app.diagnose.findings import Report
from app.diagnose.names import PanelRobot
from app.diagnose.received import ReceivedSamples
from app.errors import DecodeError, InterfaceError
from app.i18n import say
from app.interfaces import Interfaces
from app.robot.sample import Sample

APART_S: Final = 1.0
FIRST_REAL_S: Final = 1e9  # 2001: a stamp before that is of simulated time
STAMP: Final = ("header.stamp.sec", "header.stamp.nanosec")


def check_clocks(
    report: Report, robot: PanelRobot, observed: ReceivedSamples, interfaces: Interfaces
) -> None:
    types = robot.panel.subscriptions()
    live = {
        topic: [sample for key in robot.possible_keys(topic) for sample in observed.live(key)]
        for topic in types
    }
    sent = [sample.sent - sample.wall for several in live.values() for sample in several if sample.sent]
    if not sent:
        report.find("clock_unknown", robot=robot.id, window=f"{observed.window_s:.1f}")
        return
    if _compare(report, robot.id, "the bridge's machine", sent):
        return  # the nodes' stamps would only say it again
    for topic, samples in live.items():
        stamps = list(_stamps(types[topic], samples, interfaces))
        if stamps and max(stamp for stamp, _ in stamps) < FIRST_REAL_S:
            report.find("simulated_time", topic, robot=robot.id)
        elif stamps:
            _compare(report, robot.id, f"the stamps on {topic}", [s - wall for s, wall in stamps])


def _compare(report: Report, robot: str, about: str, offsets: Iterable[float]) -> bool:
    """Whether a clock differs."""
    seconds = median(offsets)
    if abs(seconds) < APART_S:
        report.fact(f"the clock of {about} is within {APART_S:g} s of this machine's")
        return False
    direction = say("finding_ahead" if seconds > 0 else "finding_behind")
    report.find("clock_differs", about, robot=robot, seconds=f"{abs(seconds):.1f}", direction=direction)
    return True


def _stamps(
    type_name: str, samples: Iterable[Sample], interfaces: Interfaces
) -> Iterator[tuple[float, float]]:
    """(stamp, when it came) of messages with a header that is stamped; seconds since the epoch."""
    try:
        reader = interfaces.field_reader(type_name, STAMP)
    except InterfaceError:
        return
    for sample in samples:
        try:
            fields = reader.read(bytes(sample.payload))
        except DecodeError:  # another type, which is said of the topic
            continue
        seconds, nanoseconds = (fields.get(path) for path in STAMP)
        if seconds or nanoseconds:
            yield seconds + nanoseconds / 1e9, sample.wall

"""What Prometheus reads at `/metrics`, gathered when it asks."""

from collections.abc import Callable, Iterator

from prometheus_client import CollectorRegistry, Counter, Gauge, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from app.fleet import Fleet


class Metrics:
    """Counts of one application, however often its panel is loaded anew."""

    def __init__(self, left_out: Callable[[], int] = lambda: 0) -> None:
        """`left_out` is how many refusals the operator's log only counts."""
        self._registry = CollectorRegistry()
        self._registry.register(_OfLog(left_out))
        self.presses = Counter(
            "kiosk_presses", "Presses by outcome", ["outcome"], registry=self._registry
        )
        self._of_fleet: _OfFleet | None = None
        self.streams = Gauge("kiosk_streams", "Open event streams", registry=self._registry)

    def follow(self, fleet: Fleet) -> None:
        """Reports these robots' links and topics from now on."""
        if self._of_fleet is not None:
            self._registry.unregister(self._of_fleet)
        self._of_fleet = _OfFleet(fleet)
        self._registry.register(self._of_fleet)

    def text(self) -> bytes:
        return generate_latest(self._registry)


class _OfLog(Collector):
    def __init__(self, left_out: Callable[[], int]) -> None:
        self._left_out = left_out

    def collect(self) -> Iterator[Metric]:
        told = "Refused presses that the operator's log only counts"
        yield CounterMetricFamily("kiosk_refusals_left_out", told, value=self._left_out())


class _OfFleet(Collector):
    """`robot` is the id of a `[[robot]]`, "" where there is one without."""

    def __init__(self, fleet: Fleet) -> None:
        self._fleet = fleet

    def collect(self) -> Iterator[Metric]:
        up = GaugeMetricFamily("kiosk_link_up", "1 while Zenoh has a link", labels=["robot"])
        bridges = GaugeMetricFamily("kiosk_bridges", "ROS 2 bridges seen", labels=["robot"])
        ready = GaugeMetricFamily(
            "kiosk_ready", "1 while commands can reach the robot", labels=["robot"]
        )
        unreadable = CounterMetricFamily(
            "kiosk_undecodable",
            "Samples looked at that were not their type",
            labels=["robot", "key"],
        )
        for kiosk in self._fleet.kiosks:
            robot, name = kiosk.robot, kiosk.entry.id if kiosk.entry else ""
            up.add_metric([name], int(robot.link_up))
            bridges.add_metric([name], len(robot.graph.bridges))
            ready.add_metric([name], int(kiosk.way.permitted))
            for key, count in robot.undecodable.items():
                unreadable.add_metric([name, key], count)
        yield from (up, bridges, ready, unreadable)

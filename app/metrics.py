"""What Prometheus reads at `/metrics`, gathered when it asks."""

from collections.abc import Iterator

from prometheus_client import CollectorRegistry, Counter, Gauge, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from app.kiosk import Kiosk


class Metrics:
    """Counts of one application, however often its panel is loaded anew."""

    def __init__(self) -> None:
        self._registry = CollectorRegistry()
        self.presses = Counter(
            "kiosk_presses", "Presses by outcome", ["outcome"], registry=self._registry
        )
        self._of_kiosk: _OfKiosk | None = None
        self.streams = Gauge("kiosk_streams", "Open event streams", registry=self._registry)

    def follow(self, kiosk: Kiosk) -> None:
        """Reports this kiosk's link and topics from now on."""
        if self._of_kiosk is not None:
            self._registry.unregister(self._of_kiosk)
        self._of_kiosk = _OfKiosk(kiosk)
        self._registry.register(self._of_kiosk)

    def text(self) -> bytes:
        return generate_latest(self._registry)


class _OfKiosk(Collector):
    def __init__(self, kiosk: Kiosk) -> None:
        self._kiosk = kiosk

    def collect(self) -> Iterator[Metric]:
        robot = self._kiosk.robot
        yield GaugeMetricFamily("kiosk_link_up", "1 while Zenoh has a link", int(robot.link_up))
        yield GaugeMetricFamily("kiosk_bridges", "ROS 2 bridges seen", len(robot.graph.bridges))
        yield GaugeMetricFamily(
            "kiosk_ready", "1 while commands can reach the robot", int(self._kiosk.way.permitted)
        )
        unreadable = CounterMetricFamily(
            "kiosk_undecodable", "Samples looked at that were not their type", labels=["key"]
        )
        for key, count in robot.undecodable.items():
            unreadable.add_metric([key], count)
        yield unreadable

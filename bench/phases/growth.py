"""The growth of this panel's cost along one axis at a time."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Final

from bench.kiosk import Kiosk, Robot
from bench.parts import Meter, crowd, family, rss_mib
from bench.peer import Running
from bench.phases.cost import join
from bench.rig import Rig
from tests.support.processes.commanded import Commanded

HZ: Final = 20.0
SIZE: Final = 32
TOPIC: Final = "/t0"
TOPICS: Final = (1, 25, 50, 100)
RATES: Final = (0, 250, 500, 1000)
SIZES: Final = (100, 16_000, 32_000, 64_000)
WIDGETS: Final = (1, 50, 100, 200)
CLIENTS: Final = (1, 100, 250, 500)
ROBOTS: Final = (1, 4, 8, 12)
CLIENTS_HZ: Final = 10.0
SETTLE_S: Final = 0.8
JOINED_S: Final = 1.5

# The value on the axis, the server's CPU %, its MiB, and the difference of two CPU measurements in %.
Point = tuple[float, float, float, float]
Points = list[Point]


class Growth:
    """Measures each axis with one client on a bare stream, except the axis of clients."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig

    def axes(self) -> Mapping[str, Callable[[], Points]]:
        return {
            "topics": self.topics,
            "rate": self.rate,
            "size": self.size,
            "widgets": self.widgets,
            "clients": self.clients,
            "robots": self.robots,
        }

    def topics(self) -> Points:
        def point(count: int) -> Point:
            topics = tuple(f"/t{number}" for number in range(count))
            with self._served(Kiosk(), topics) as (server, _):
                return self._measure(count, server, topics, HZ)

        return [point(count) for count in self._some(TOPICS)]

    def rate(self) -> Points:
        with self._served(Kiosk(), (TOPIC,)) as (server, _):
            return [self._measure(hz, server, (TOPIC,), hz) for hz in self._some(RATES)]

    def size(self) -> Points:
        with self._served(Kiosk(), (TOPIC,)) as (server, _):
            return [self._measure(size, server, (TOPIC,), HZ, size=size) for size in self._some(SIZES)]

    def widgets(self) -> Points:
        def point(count: int) -> Point:
            with self._served(Kiosk(widgets=count), (TOPIC,)) as (server, _):
                return self._measure(count, server, (TOPIC,), HZ)

        return [point(count) for count in self._some(WIDGETS)]

    def clients(self) -> Points:
        points: Points = []
        with self._served(Kiosk(), (TOPIC,)) as (server, clients):
            for count in self._some(CLIENTS):
                join(clients, server, count)
                points.append(self._measure(count, server, (TOPIC,), CLIENTS_HZ))
        return points

    def robots(self) -> Points:
        def point(count: int) -> Point:
            ids = [f"robot{number}" for number in range(1, count + 1)]
            ways = [f"/{name}" for name in ids]
            locators = self._rig.robot("robots", namespaces=ways)
            for way in ways:
                self._rig.robot("offer", way=way, topics=[TOPIC])
            all_of_them = tuple(map(Robot, ids, locators))
            with self._served(Kiosk(robots=all_of_them), (TOPIC,)) as (server, _):
                return self._measure(count, server, (TOPIC,), HZ, ways=ways)

        try:
            return [point(count) for count in self._some(ROBOTS)]
        finally:
            self._rig.robot("robots", namespaces=[])

    def _some(self, points: Sequence[int]) -> list[int]:
        return [points[number] for number in self._rig.sizes.growth_points]

    @contextmanager
    def _served(self, kiosk: Kiosk, topics: Sequence[str]) -> Iterator[tuple[Running, Commanded]]:
        with self._rig.running(kiosk, topics) as server, crowd() as clients:
            join(clients, server, 1)
            time.sleep(JOINED_S)
            yield server, clients

    def _measure(
        self,
        x: float,
        server: Running,
        topics: Sequence[str],
        hz: float,
        size: int = SIZE,
        ways: Sequence[str] = ("zenoh",),
    ) -> Point:
        if hz:
            self._rig.robot("load", ways=list(ways), topics=list(topics), hz=hz, size=size)
        time.sleep(SETTLE_S)
        meter = Meter(lambda: family(server.pids))
        readings = []
        for _ in range(2):
            meter.restart()
            time.sleep(self._rig.sizes.growth_s)
            readings.append(meter.percent())
        self._rig.robot("quiet")
        mib = rss_mib(family(server.pids))
        return x, sum(readings) / 2, mib, abs(readings[0] - readings[1])

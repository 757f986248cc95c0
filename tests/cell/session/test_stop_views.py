"""At a stop what the pages of its robot show is kept once: also what no one looks at, with the alarms
of the stop, the curves and the lines of logs."""

import asyncio
import time
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any, Final

import pytest

from app.cell.alarms.shown import NO_ALARMS
from app.cell.history.trends import TrendRecorder
from app.cell.robot.state import RobotState
from app.cell.session import stop_views
from app.cell.session.fleet import Fleet
from app.cell.session.session import RobotSession
from app.cell.session.stop_views import STOPS, StopViews, keep_stops
from app.cell.stops.shown import FOLDER, ShownView, from_bytes
from app.cell.view import refresh
from app.cell.view.view import ViewWithDeadlines, build_view
from app.panel.model import Panel
from app.records import NullLog
from app.ros.zenoh.config import config_to
from app.ros.zenoh.sample import Sample
from app.ros.zenoh.session import Unconnected
from app.system.errors import LogError
from tests.support.builders import FREE, HEARD, INTERFACES, TEXT, panel_of
from tests.support.waiting import when

FLOAT: Final = "std_msgs/msg/Float64"
OTHERS: Final = {**HEARD, "id": "others", "robot": "right"}
TREND: Final = {
    "id": "curve", "kind": "trend", "label": "Level", "window": "10s",
    "pen": [{"topic": "/level", "type": FLOAT, "field": "data", "label": "Level"}],
}  # fmt: skip
LOG: Final = {"id": "log", "kind": "log", "label": "Log"}
ROBOTS: Final = [
    {"id": name, "name": name.title(), "namespace": f"/{name}"} for name in ("left", "right")
]


class Cell:
    """A fleet that reaches no robot, of which nothing is shown to anyone."""

    def __init__(self, folder: Path, panel: Panel) -> None:
        self.folder = folder / FOLDER
        config = config_to("tcp/127.0.0.1:0")
        self.fleet = Fleet(panel, lambda _: config, "r", NullLog(), link=Unconnected)
        self.views: StopViews = keep_stops(self.fleet, folder)
        for session in self.fleet.sessions:
            session.watch()

    def robot(self, name: str = "") -> RobotState:
        return self.fleet.of_robot(name).robot

    def says(self, text: str, robot: str = "") -> None:
        state = self.robot(robot)
        (key,) = state.possible_keys("/heard")
        payload = INTERFACES.encode(TEXT, {"data": text})
        state.update(key, sample(payload))

    def stops(self, robot: str = "") -> None:
        self.fleet.of_robot(robot).context.signals.stopped.emit()

    @property
    def kept(self) -> list[ShownView]:
        return [from_bytes(file.read_bytes()) for file in sorted(self.folder.glob("*.gz"))]

    async def end(self) -> None:
        await self.views.stop()
        self.fleet.close()
        for session in self.fleet.sessions:
            session.turn.stop()
            session.refresher.stop()


def sample(payload: bytes, later: float = 0.0) -> Sample:
    return Sample(payload, 1, time.monotonic() + later, time.time() + later, "b1")


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Runs a test with a fleet of a panel."""

    def in_loop(test: Callable[[Cell], Coroutine[Any, Any, None]], *widgets: Any, **more: Any) -> None:
        async def whole() -> None:
            cell = Cell(tmp_path, panel_of(*(widgets or (FREE, HEARD)), **more))
            try:
                await test(cell)
            finally:
                await cell.end()

        asyncio.run(whole())

    return in_loop


def heard(shown: ShownView, widget: str = "heard") -> Any:
    return shown.view["widgets"][widget]["text"]


def test_what_no_one_looks_at_is_kept_as_it_was_at_the_stop(run: Callable[..., None]) -> None:
    async def test(cell: Cell) -> None:
        cell.says("before")
        cell.stops()
        await asyncio.sleep(0)
        cell.says("after")
        await when(lambda: cell.kept)
        (shown,) = cell.kept
        assert heard(shown) == "before"
        assert abs(shown.at - time.time()) < 10
        assert (shown.robot, shown.revision) == ("", cell.fleet.panel.revision)
        assert (
            cell.fleet.first.publisher.view["widgets"]["heard"]["text"] == "—"
        )  # nothing is published

    run(test)


def test_nothing_is_built_while_nothing_stops(
    run: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    built: list[str] = []

    def noted(*arguments: Any) -> ViewWithDeadlines:
        built.append("view")
        return build_view(*arguments)

    monkeypatch.setattr(refresh, "build_view", noted)

    async def test(cell: Cell) -> None:
        built.clear()
        for number in range(100):
            cell.says(str(number))
        assert built == []
        cell.stops()
        cell.stops()
        assert built == []  # not in the turn that notices the stop
        await asyncio.sleep(0)
        assert built == ["view"]

    run(test)


def test_what_stops_a_robot_together_is_kept_once_and_a_flood_is_bounded(
    run: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def test(cell: Cell) -> None:
        for _ in range(5):
            cell.stops()
        await cell.views.stop()
        await when(lambda: cell.kept)
        assert len(cell.kept) == 1
        monkeypatch.setattr(stop_views, "TOGETHER_S", 0.0)
        for _ in range(3 * round(STOPS.burst)):
            cell.stops()
            await asyncio.sleep(0.002)  # the names of files have milliseconds
        await cell.views.stop()
        assert len(cell.kept) == STOPS.burst

    run(test)


def test_the_alarms_are_those_that_are_shown_a_moment_later(
    run: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """An alarm is shown when it is on the disk."""
    monkeypatch.setattr(stop_views, "ALARMS_WITHIN_S", 0.05)

    async def test(cell: Cell) -> None:
        cell.stops()
        await asyncio.sleep(0)
        later = {**NO_ALARMS, "rows": {"a": {"text": "Guard door"}}}
        monkeypatch.setattr(cell.fleet.alarms, "view", lambda: later)
        await when(lambda: cell.kept)
        assert cell.kept[0].view["alarms"]["rows"] == later["rows"]

    run(test)


def test_curves_and_lines_are_those_of_the_moment(run: Callable[..., None]) -> None:
    async def test(cell: Cell) -> None:
        robot = cell.robot()
        recorder = TrendRecorder(cell.fleet.panel, INTERFACES, robot)
        recorder.record_sample("level", sample(INTERFACES.encode(FLOAT, {"data": 1.0})))
        line = {"level": 40, "name": "arm", "msg": "stopped"}
        robot.log_lines["rosout"].add(INTERFACES.encode("rcl_interfaces/msg/Log", line))
        cell.stops()
        await asyncio.sleep(0)
        recorder.record_sample("level", sample(INTERFACES.encode(FLOAT, {"data": 9.0}), later=0.1))
        recorder.stop()  # decodes what waits
        await when(lambda: cell.kept)
        (shown,) = cell.kept
        plot = shown.plots["curve"]
        assert plot.lines[0].x is not None  # the newest value until the stop
        assert max(float(str(tick.text)) for tick in plot.values) < 9.0
        ((_, kept),) = shown.lines["log"]
        assert (kept.level, kept.node, kept.text) == ("error", "arm", "stopped")

    run(test, TREND, LOG)


def test_of_several_robots_each_has_its_own_and_the_widgets_of_others(run: Callable[..., None]) -> None:
    async def test(cell: Cell) -> None:
        cell.says("left", "left")
        cell.says("right", "right")
        cell.stops("left")
        await when(lambda: cell.kept)
        (shown,) = cell.kept
        assert shown.robot == "left"
        assert (heard(shown), heard(shown, "others")) == ("left", "right")
        assert next(cell.folder.iterdir()).name.endswith("-left.json.gz")

    run(test, FREE, HEARD, OTHERS, robot=ROBOTS)


def test_robots_that_stop_together_are_kept_one_in_a_step(
    run: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def test(cell: Cell) -> None:
        taken: list[str] = []
        real = cell.views._taken

        def noted(session: RobotSession) -> ShownView:
            taken.append(str(session.robot.id))
            if len(taken) == 1:
                raise ValueError("a view that can't be built")
            return real(session)

        monkeypatch.setattr(cell.views, "_taken", noted)
        asyncio.get_running_loop().set_exception_handler(lambda *_: None)
        for robot in ("left", "right", "third"):
            cell.stops(robot)
        steps = []
        while len(taken) < 3:
            await asyncio.sleep(0)
            steps.append(len(taken))
        assert steps == [1, 2, 3]
        await when(lambda: len(cell.kept) == 2)

    third = {"id": "third", "name": "Third", "namespace": "/third"}
    run(test, FREE, HEARD, robot=[*ROBOTS, third])


def test_what_the_disk_refuses_is_said_once(
    run: Callable[..., None], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(stop_views, "TOGETHER_S", 0.0)

    def refuse(*_: Any) -> None:
        raise LogError("no space")

    monkeypatch.setattr(stop_views, "write", refuse)

    async def test(cell: Cell) -> None:
        for _ in range(3):
            cell.stops()
            await asyncio.sleep(0.002)
        await cell.views.stop()
        assert [record.message for record in caplog.records if "stop" in record.message] == [
            "what was shown at a stop is not kept: no space"
        ]

    run(test)


def test_at_shutdown_what_waits_is_written_at_once(run: Callable[..., None]) -> None:
    async def test(cell: Cell) -> None:
        cell.says("last")
        cell.stops()
        await asyncio.sleep(0)
        began = time.monotonic()
        await cell.views.stop()
        assert [heard(shown) for shown in cell.kept] == ["last"]
        assert time.monotonic() - began < stop_views.ALARMS_WITHIN_S

    run(test)


def test_what_is_shown_now_is_written_nowhere(run: Callable[..., None]) -> None:
    async def test(cell: Cell) -> None:
        cell.says("now")
        shown = from_bytes(await cell.views.now(cell.fleet.first))
        assert heard(shown) == "now"
        assert not cell.folder.exists()

    run(test)

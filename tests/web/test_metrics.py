"""What Prometheus reads, of a kiosk that is really there (with no bridge to reach)."""

import asyncio
from collections.abc import Callable

from prometheus_client.parser import text_string_to_metric_families

from app.cell.robot.state import Sample
from app.cell.session.fleet import Fleet
from app.cell.session.session import RobotSession
from app.panel.model import Panel
from app.records import NullLog
from app.ros.dialects.bridge_dialect import bridge_token
from app.ros.zenoh.config import config_to
from app.web.metrics import Metrics
from app.web.prometheus import exposition
from tests.support.builders import BRIDGE, panel_of, small_panel

Samples = dict[tuple[str, tuple[str, ...]], float]

NOWHERE = "tcp/127.0.0.1:1"


def read(metrics: Metrics) -> Samples:
    """(name, values of its labels) → value; the one robot of these panels has no name."""
    families = text_string_to_metric_families(exposition(metrics)[0].decode())
    samples = [sample for family in families for sample in family.samples]
    values = {(s.name, tuple(s.labels.values())): s.value for s in samples}
    assert len(values) == len(samples), "a sample is there twice"
    return values


def nowhere(panel: Panel) -> Fleet:
    return Fleet(panel, lambda _: config_to(NOWHERE), "r1", NullLog())


def of_kiosk(change: Callable[[RobotSession], None], panel: Panel | None = None) -> Samples:
    """What is read of a kiosk after a change."""

    async def followed() -> Samples:
        fleet = nowhere(panel or small_panel())
        try:
            metrics = Metrics(fleet)
            change(fleet.first)
            return read(metrics)
        finally:
            await fleet.stop()

    return asyncio.run(followed())


def test_a_kiosk_without_a_link_is_not_ready() -> None:
    samples = of_kiosk(lambda kiosk: None)
    assert samples["kiosk_link_up", ("",)] == 0
    assert samples["kiosk_bridges", ("",)] == 0
    assert samples["kiosk_ready", ("",)] == 0


def test_a_kiosk_that_can_send_is_ready() -> None:
    def connect(session: RobotSession) -> None:
        session.robot.link_up = True
        session.robot.settled_at = 0.0
        session.robot.graph.apply_token(bridge_token(BRIDGE), True)

    samples = of_kiosk(connect)
    assert samples["kiosk_link_up", ("",)] == 1
    assert samples["kiosk_bridges", ("",)] == 1
    assert samples["kiosk_ready", ("",)] == 1


def test_the_clock_of_the_robot_is_a_metric_once_it_is_known() -> None:
    samples = of_kiosk(lambda kiosk: None)
    assert ("kiosk_clock_skew_seconds", ("",)) not in samples
    assert samples["kiosk_simulated_time", ("",)] == 0

    def measure(session: RobotSession) -> None:
        for at in (0.0, 1.0):
            session.robot.clock.record_peer(BRIDGE, at - 41.0, at, at)
        session.robot.clock.begin_simulated()

    samples = of_kiosk(measure)
    assert samples["kiosk_clock_skew_seconds", ("",)] == -41.0
    assert samples["kiosk_simulated_time", ("",)] == 1


def test_samples_that_were_not_their_type_are_counted_by_key() -> None:
    def hear(session: RobotSession) -> None:
        for seq in (1, 2):
            session.robot.update("heard", Sample(b"broken", seq, 0.0, 0.0, BRIDGE))
            session.robot.reading("/heard")

    assert of_kiosk(hear)["kiosk_undecodable_total", ("heard", "")] == 2


def test_a_list_of_options_that_is_not_known_is_counted() -> None:
    source = {"topic": "/joints", "type": "sensor_msgs/msg/JointState", "field": "name"}
    select = {"id": "program", "kind": "select", "label": "Program", "options_from": source}
    samples = of_kiosk(lambda kiosk: None, panel_of(select))
    assert samples["kiosk_options_known", ("", "program")] == 0


def test_presses_are_counted_by_outcome() -> None:
    metrics = Metrics()
    for outcome in ("published", "published", "refused"):
        metrics.pressed(outcome)
    samples = read(metrics)
    assert samples["kiosk_presses_total", ("published",)] == 2
    assert samples["kiosk_presses_total", ("refused",)] == 1


def test_open_streams_are_counted() -> None:
    metrics = Metrics()
    with metrics.streams.another(), metrics.streams.another():
        assert read(metrics)["kiosk_streams", ()] == 2
    assert read(metrics)["kiosk_streams", ()] == 0


def test_two_applications_count_for_themselves() -> None:
    metrics, other = Metrics(), Metrics()
    metrics.pressed("published")
    assert ("kiosk_presses_total", ("published",)) not in read(other)

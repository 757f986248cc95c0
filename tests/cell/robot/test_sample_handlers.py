"""The table of what handles the samples of a topic."""

from app.cell.commands.confirmations import Confirmations
from app.cell.commands.goals import GoalTracker
from app.cell.commands.parameters import ParameterSync
from app.cell.commands.services import ServiceCalls
from app.cell.robot.sample_handlers import SampleHandler, SampleHandlers
from app.ros.dialects.dialect import Endpoint
from app.ros.zenoh.sample import Sample
from tests.support.builders import (
    BRIDGE,
    COUNT,
    FREE,
    HEARD,
    INTERFACES,
    MESSAGE,
    NOW,
    FakeTransport,
    panel_of,
    robot_there,
)

CONFIRM = {"topic": "/heard", "field": "data", "equals": "{message}", "within_s": 0.5}
SAMPLE = Sample(b"", 1, NOW, NOW, BRIDGE)


def test_a_handler_takes_the_samples_of_its_topic_and_says_whether_they_are_stored() -> None:
    handlers, taken = SampleHandlers(), list[Sample]()
    handlers.add("status", SampleHandler(taken.append, is_immediate=True))
    handlers.add("events", SampleHandler(taken.append, is_stored=True))
    assert not handlers.take("status", SAMPLE)
    assert handlers.take("events", SAMPLE)
    assert handlers.take("heard", SAMPLE)
    assert taken == [SAMPLE, SAMPLE]
    assert [*handlers.immediate] == ["status"]
    assert ("status" in handlers, "heard" in handlers) == (True, False)


def test_lost_endpoints_reach_each_part_that_asked_for_them() -> None:
    handlers, lost = SampleHandlers(), list[Endpoint]()
    handlers.on_endpoint_lost(lost.append)
    handlers.on_endpoint_lost(lost.append)
    handlers.endpoint_lost(Endpoint(BRIDGE))
    assert lost == [Endpoint(BRIDGE)] * 2


def test_goals_parameters_and_confirmations_register_themselves() -> None:
    panel = panel_of(COUNT, MESSAGE, {**FREE, "confirm": CONFIRM}, HEARD)
    robot, transport, handlers = robot_there(panel), FakeTransport(), SampleHandlers()
    calls = ServiceCalls(INTERFACES, robot, transport, lambda _: None)
    confirmations = Confirmations(robot, lambda _: None)
    GoalTracker(INTERFACES, robot, transport, lambda _: None).register(handlers, panel.actions())
    ParameterSync(panel, INTERFACES, robot, transport, calls, lambda: None).register(handlers)
    confirmations.register(handlers, panel.confirmations())
    assert {*handlers.immediate} == {"count/_action/status", "parameter_events"}
    assert "count/_action/feedback" in handlers
    assert not handlers.is_awaited("heard")  # no command waits for it
    vars(confirmations)["is_awaited"] = lambda key: True
    confirmations.register(handlers, panel.confirmations())
    assert handlers.is_awaited("heard")
    assert not handlers.is_awaited("count/_action/status")

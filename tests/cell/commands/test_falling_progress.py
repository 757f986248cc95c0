"""The progress of a goal by what remains: it falls to 0."""

import asyncio
import math
import uuid

import pytest

from app.cell.commands.goals import FEEDBACK, Goal
from app.panel.widgets.service_action import Action
from app.ros.messages import Fields
from tests.cell.commands.test_calls_and_goals import COUNT


def fractions(values: list[float], **keys: float) -> list[float | None]:
    """The progress after each of these feedbacks."""
    table = {"id": "go", "kind": "action", "label": "Go", "action": "/go", "type": COUNT}
    widget = Action.model_validate({**table, "progress": "left", "progress_falls": True, **keys})

    async def run() -> list[float | None]:
        cut = asyncio.get_running_loop().create_future()
        goal, seen = Goal(widget, "press", uuid.uuid4(), cut, lambda _: None), []
        for value in values:
            goal.apply_feedback(Fields({f"{FEEDBACK}left": value}))
            seen.append(goal.fraction)
        return seen

    return asyncio.run(run())


def test_it_falls_from_its_greatest_value() -> None:
    assert fractions([8.0, 6.0, 2.0, 0.0]) == [0.0, 0.25, 0.75, 1.0]


def test_a_goal_that_is_planned_first_is_not_done_then() -> None:
    assert fractions([0.0, 0.0, 8.0, 4.0]) == [None, None, 0.0, 0.5]


def test_a_longer_way_begins_again_and_a_number_that_is_none_is_not_known() -> None:
    assert fractions([8.0, 16.0, math.nan, math.inf, 4.0]) == [0.0, 0.0, None, 0.0, 0.75]


@pytest.mark.parametrize(("left", "done"), [(10.0, 0.0), (20.0, 0.0), (2.5, 0.75), (-1.0, 1.0)])
def test_it_may_fall_from_a_given_value(left: float, done: float) -> None:
    assert fractions([left], progress_max=10) == [done]

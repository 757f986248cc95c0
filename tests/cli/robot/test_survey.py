"""How often a topic is published, from when its messages arrived."""

import pytest

from app.cli.robot.survey import Heard


@pytest.mark.parametrize(
    ("arrivals", "period_s"),
    [
        ([5.0, 5.1, 5.2], 0.1),
        ([5.0, 5.9, 7.0], 1.1),
        ([5.0, 5.0, 5.1], 0.1),  # a machine that was busy
        ([5.0, 5.1], None),  # perhaps two events
        ([5.0, 5.1, 6.1], None),  # not regular
        ([], None),
    ],
)
def test_the_period_is_known_of_what_is_regular(arrivals: list[float], period_s: float | None) -> None:
    assert Heard(arrivals=arrivals).period_s == (period_s and pytest.approx(period_s))


def test_of_a_latched_topic_one_message_is_enough() -> None:
    assert Heard(message=True).is_enough(latched=True)
    assert not Heard(message=True, arrivals=[1.0]).is_enough(latched=False)
    assert Heard(message=True, arrivals=[1.0, 2.0, 3.0]).is_enough(latched=False)
    assert not Heard(arrivals=[1.0, 2.0, 3.0]).is_enough(latched=False)

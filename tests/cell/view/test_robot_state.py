"""Whether the robot is there, in a word."""

import pytest

from app.cell.permission.verdict import PERMITTED, Verdict
from app.cell.view.link_status import robot_word
from tests.support.words import english


@pytest.mark.parametrize(
    ("link", "state", "word"),
    [
        (PERMITTED, "online", "ONLINE"),
        (Verdict(False, "link_connecting"), "unknown", "UNKNOWN"),
        (Verdict(False, "link_catching_up"), "unknown", "UNKNOWN"),
        (Verdict(False, "link_unreachable"), "lost", "NO LINK"),
        (Verdict(False, "link_no_bridge"), "lost", "NO LINK"),
        (Verdict(False, "link_bridge_silent"), "lost", "NO LINK"),
    ],
)
def test_the_robot_is_online_only_with_a_link_that_can_be_used(
    link: Verdict, state: str, word: str
) -> None:
    shown = robot_word(link)
    assert shown["state"] == state
    assert english(shown["text"]) == word

"""The robot's state in a word."""

from typing import Final

import pytest

from app.permission.verdict import PERMITTED, Verdict
from app.view.robot_state import robot_word
from tests.support.words import english

FORBIDS: Final = Verdict(False, "forbidden")
UNMET: Final = Verdict(False, "unmet")
WAITS: Final = Verdict(False, "waiting")
OLD: Final = Verdict(False, "stale")


@pytest.mark.parametrize(
    ("link", "interlocks", "state"),
    [
        (PERMITTED, [], "online"),
        (PERMITTED, [PERMITTED, PERMITTED], "ready"),
        (PERMITTED, [PERMITTED, FORBIDS], "locked"),
        (PERMITTED, [UNMET], "locked"),
        (PERMITTED, [PERMITTED, WAITS], "unknown"),
        (PERMITTED, [OLD], "unknown"),
        (PERMITTED, [WAITS, FORBIDS], "locked"),  # which is known
        (Verdict(False, "joining"), [PERMITTED], "unknown"),
        (Verdict(False, "catching_up"), [FORBIDS], "unknown"),
        (Verdict(False, "no_link"), [PERMITTED], "lost"),
        (Verdict(False, "no_bridge"), [FORBIDS], "lost"),
        (Verdict(False, "bridge_silent"), [], "lost"),
    ],
)
def test_it_is_ready_only_where_all_is_known_to_permit(
    link: Verdict, interlocks: list[Verdict], state: str
) -> None:
    assert robot_word(link, interlocks)["state"] == state


def test_it_is_a_word_of_the_catalogue() -> None:
    words = [robot_word(PERMITTED, [one])["text"] for one in (PERMITTED, FORBIDS, WAITS)]
    words += [robot_word(one, [])["text"] for one in (PERMITTED, Verdict(False, "no_link"))]
    assert [english(word) for word in words] == ["READY", "LOCKED", "UNKNOWN", "ONLINE", "NO LINK"]

"""A receipt's `code`: the stable name of its reason, whatever frames the sentence."""

import pytest

from app.cell.commands.receipts import ADVICE, FRAMES, reason_code
from app.system.texts import ENGLISH, TextLike, joined, say, sentences

LOCKED = say("interlock_waiting", topic="/operation_enabled")


@pytest.mark.parametrize(
    ("reason", "code"),
    [
        ("", None),
        ("the robot's own words", None),
        (say("published", topic="/go", time="10:00:00"), "published"),
        (say("refused", why=LOCKED, time="10:00:00"), "interlock_waiting"),
        (
            say("press_not_encoded", why='the input "speed" is missing', time="10:00:00"),
            "press_not_encoded",
        ),
        (
            say("with_reply", said=say("call_rejected", time="10:00:00"), reply="the arm moves"),
            "call_rejected",
        ),
        (say("hold_ended", time="10:00:00", seconds="1.2", why=LOCKED), "interlock_waiting"),
        (joined([say("timed_out", seconds="2"), say("service_cyclone_hint")]), "timed_out"),
        (
            joined(
                [
                    say("published", topic="/go", time="10:00:00"),
                    say("confirmation_missing", topic="/on"),
                ]
            ),
            "confirmation_missing",
        ),
        (
            say("log_not_on_disk", said=say("refused", why=LOCKED, time="10:00:00"), why="full"),
            "interlock_waiting",
        ),
    ],
)
def test_the_code_is_that_of_the_sentence_that_says_why(reason: TextLike, code: str | None) -> None:
    assert reason_code(reason) == code


def test_frames_and_advice_are_sentences_of_the_catalogue_with_that_parameter() -> None:
    known = sentences(ENGLISH)
    assert set(known) >= ADVICE
    for code, parameter in FRAMES.items():
        assert f"{{{parameter}}}" in known[code]

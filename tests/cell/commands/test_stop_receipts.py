"""The receipt of a press that stops several robots: what may go on comes first."""

import re
from datetime import UTC, datetime

import pytest

from app.cell.commands.press import MAX_ID_LENGTH
from app.cell.commands.receipts import Receipt
from app.cell.commands.stop_receipts import StopOutcome, id_of_robot, receipt_of_several
from app.records.entry import OutcomeCode
from app.system.errors import Cause
from app.system.texts import render

AT = datetime(2026, 5, 4, 19, 50, 42, tzinfo=UTC).isoformat(timespec="milliseconds")
Made = tuple[OutcomeCode, Cause]
SENT: Made = ("published", "")
STOPPED: Made = ("confirmed", "")
NO_ANSWER: Made = ("unknown", "")
NO_LINK: Made = ("refused", "link")
REJECTED: Made = ("rejected", "")
# The receipts of the cells 1, 2, …, then outcome, cause, sentence and the words on the button, without
# the time.
TABLE: list[tuple[list[Made], Made, str, str]] = [
    ([STOPPED, STOPPED], STOPPED, "Cell 1, Cell 2 stopped.", "All stopped"),
    ([SENT, SENT], SENT, "Stop sent to Cell 1, Cell 2.", "Sent to all"),
    ([STOPPED, SENT], STOPPED, "Cell 1 stopped. Stop sent to Cell 2.", "Sent to all"),
    (
        [STOPPED, NO_ANSWER],
        NO_ANSWER,
        "Cell 2: no answer – use its emergency stop. Cell 1 stopped.",
        "Use E-stop: Cell 2",
    ),
    (
        [NO_LINK, STOPPED, REJECTED],
        NO_LINK,
        "Cell 1: no connection – use its emergency stop. Cell 3: not stopped – use its emergency stop. "
        "Cell 2 stopped.",
        "Use E-stop: 2 of 3",
    ),
]


def receipt(outcome: OutcomeCode, cause: Cause) -> Receipt:
    return Receipt("press", "stop", outcome, "", AT, cause, {}, "")


@pytest.mark.parametrize(("made", "expected", "sentence", "brief"), TABLE)
def test_what_may_go_on_is_named_first(
    made: list[Made], expected: Made, sentence: str, brief: str
) -> None:
    stops = [StopOutcome(f"c{n}", f"Cell {n}", receipt(*each)) for n, each in enumerate(made, 1)]
    all_of = receipt_of_several("one", stops)
    assert (all_of.id, all_of.outcome, all_of.cause) == ("one", *expected)
    assert list(all_of.parts) == [stop.robot for stop in stops]
    assert without_time(render(all_of.reason)) == sentence
    assert without_time(render(all_of.brief)) == brief


def without_time(said: str) -> str:
    return re.sub(r" \d\d:\d\d:\d\d", "", said)


def test_the_press_of_each_robot_has_an_id_that_a_press_may_have() -> None:
    ids = {id_of_robot("p" * length, robot) for length in (8, 64) for robot in ("r1", "r" * 60)}
    assert len(ids) == 4
    assert all(len(press_id) <= MAX_ID_LENGTH for press_id in ids)

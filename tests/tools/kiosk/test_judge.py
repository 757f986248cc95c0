"""What is done about what the screen shows."""

from itertools import pairwise

import pytest

from app.tools.kiosk.judge import (
    FOREIGN_AFTER_S,
    LONGEST_PAUSE_S,
    SILENT_AFTER_S,
    UNDRAWN_AFTER_S,
    Action,
    Judge,
    PageStatus,
)

pytestmark = pytest.mark.promise("kiosk")

LIVE = PageStatus(on_panel=True, ours=True, age_s=0.2)
SILENT = PageStatus(on_panel=True, ours=True, age_s=60.0)


def actions(
    look: PageStatus, server: bool | None, for_s: float, judge: Judge | None = None
) -> list[Action]:
    """What a judge does about the same look once a second."""
    judge = judge or Judge()
    return [judge.judge(look, server, float(second)).action for second in range(int(for_s) + 1)]


def first(look: PageStatus, server: bool | None = True) -> Action:
    return Judge().judge(look, server, 0.0).action


def test_a_live_panel_is_left_alone() -> None:
    assert set(actions(LIVE, None, 600)) == {Action.NONE}


def test_a_page_without_a_stream_is_left_alone() -> None:
    assert set(actions(PageStatus(on_panel=True, ours=True), True, 600)) == {Action.NONE}


def test_unresponsive_process_is_restarted() -> None:
    assert first(PageStatus(responds=False)) is Action.RESTART


def test_a_crashed_page_is_opened_again_or_waits_for_the_server() -> None:
    assert first(PageStatus(crashed=True), True) is Action.OPEN_PANEL
    assert first(PageStatus(crashed=True), False) is Action.OPEN_WAITING


def test_a_page_that_crashes_again_and_again_needs_another_browser() -> None:
    assert Action.RESTART in actions(PageStatus(crashed=True), True, 5)


def test_the_waiting_page_stays_until_the_server_answers() -> None:
    waiting = PageStatus(waiting=True)
    assert set(actions(waiting, False, 600)) == {Action.NONE}
    assert first(waiting, True) is Action.OPEN_PANEL


def test_another_page_is_left_at_once() -> None:
    assert first(PageStatus(), True) is Action.OPEN_PANEL
    assert first(PageStatus(), False) is Action.OPEN_WAITING


def test_a_page_of_the_server_that_is_none_of_the_panel_is_left_soon() -> None:
    decided = actions(PageStatus(on_panel=True), True, FOREIGN_AFTER_S)
    assert (set(decided[:-1]), decided[-1]) == ({Action.NONE}, Action.OPEN_PANEL)


def test_a_page_that_draws_nothing_is_restarted() -> None:
    undrawn = PageStatus(on_panel=True, ours=True, age_s=0.2, drawn=False)
    decided = actions(undrawn, None, UNDRAWN_AFTER_S)
    assert (set(decided[:-1]), decided[-1]) == ({Action.NONE}, Action.RESTART)


def test_one_drawn_frame_restarts_the_timer() -> None:
    judge = Judge()
    undrawn = PageStatus(on_panel=True, ours=True, age_s=0.2, drawn=False)
    looks = [undrawn] * 4 + [LIVE] + [undrawn] * 4
    decided = {judge.judge(look, None, float(at)).action for at, look in enumerate(looks)}
    assert decided == {Action.NONE}


def test_a_locked_page_stays_while_the_server_is_gone() -> None:
    assert set(actions(SILENT, False, 600)) == {Action.NONE}


def test_silent_page_is_reopened_then_the_browser_is_restarted_at_growing_intervals() -> None:
    decided = actions(SILENT, True, 3600)
    acted = [at for at, action in enumerate(decided) if action is not Action.NONE]
    assert acted[0] == SILENT_AFTER_S
    assert decided[acted[0]] is Action.OPEN_PANEL
    assert decided[acted[1]] is Action.RESTART
    pauses = [after - before for before, after in pairwise(acted)]
    assert pauses == sorted(pauses)
    assert pauses[-1] >= LONGEST_PAUSE_S

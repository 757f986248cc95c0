"""The table of states is the documented one, and no order of events loses an alarm."""

from dataclasses import replace
from itertools import product

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from app.cell.alarms.states import (
    HIGH,
    KINDS,
    NORMAL,
    SHIFT_S,
    ActResult,
    AlarmKind,
    AlarmRules,
    AlarmStatus,
    Event,
    Moment,
    Override,
    State,
    TakenOut,
    acknowledge,
    expire,
    find_row,
    remove_from_service,
    reset,
    return_to_service,
    shelve,
    unshelve,
    update_level,
    update_suppression,
)
from app.system.texts import say
from tests.support.form import several
from tests.support.parts import ROOT

pytestmark = pytest.mark.promise("alarms")

NOW = Moment(100.0, 1_700_000_000.0)
LATCHED = AlarmRules(AlarmKind(latched=True))
PLAIN = AlarmRules()
TWO_LEVELS = AlarmRules(priorities=(3, 1))
SELECTS = {
    "all": lambda kind: True,
    "latched": lambda kind: kind.latched,
    "not latched": lambda kind: not kind.latched,
    '`ack = "required"`': lambda kind: kind.acknowledge,
    '`ack = "none"`': lambda kind: not kind.acknowledge,
}


def documented() -> dict[tuple[State, Event, AlarmKind], tuple[str, bool]]:
    """(next state or refusal, new occurrence) of every row of docs/reference/alarms.md."""
    text = (
        (ROOT / "docs/reference/alarms.md").read_text().partition("## Events")[2].partition("\n## ")[0]
    )
    lines = [
        [cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if "|" in line
    ]
    rows = {}
    for state, event, alarms, after, occurrence in lines[2:]:
        for kind in filter(SELECTS[alarms], KINDS):
            key = State(state.strip("`")), Event(event), kind
            assert key not in rows, key
            rows[key] = (after.removeprefix("refused: ").strip("`"), occurrence == "yes")
    return rows


def test_state_table_is_the_documented_table() -> None:
    rows = documented()
    for key in product(State, Event, KINDS):
        row = find_row(*key)
        expected, occurrence = rows.get(key, (key[0], False))
        assert (row.refusal.code if row.refusal else row.next, row.occurrence) == (
            expected,
            occurrence,
        ), key


def raised(rules: AlarmRules, level: int = 1) -> AlarmStatus:
    return update_level(NORMAL, rules, level, NOW)


def acknowledged(rules: AlarmRules, level: int = 1) -> AlarmStatus:
    return acknowledge(raised(rules, level), rules, 1).status


def shelf(for_s: float = 600, reason: str = "Sensor is replaced") -> TakenOut:
    return TakenOut(NOW, reason, "Ann", NOW.monotonic + for_s)


def refusal(result: ActResult) -> str:
    return result.refusal.code if result.refusal else ""


def test_an_older_occurrence_is_not_acknowledged() -> None:
    again = update_level(update_level(raised(PLAIN), PLAIN, 0, NOW), PLAIN, 1, NOW)
    assert again.occurrence == 2
    assert acknowledge(again, PLAIN, 1) == ActResult(again, say("alarm_came_again"))


def test_acknowledging_twice_is_acknowledging_once() -> None:
    status = acknowledged(PLAIN)
    assert acknowledge(status, PLAIN, 1) == ActResult(status, repeated=True)


def test_a_level_that_rises_is_raised_again_with_its_priority() -> None:
    risen = update_level(acknowledged(TWO_LEVELS), TWO_LEVELS, 2, NOW)
    assert (risen.state, risen.occurrence) == (State.UNACKNOWLEDGED, 2)
    assert TWO_LEVELS.priority(risen.raised_level) == 1
    fallen = update_level(risen, TWO_LEVELS, 1, NOW)
    assert (fallen.state, fallen.level, fallen.raised_level) == (State.UNACKNOWLEDGED, 1, 2)


def test_acknowledgement_of_a_lower_level_is_refused_after_a_rise() -> None:
    risen = update_level(raised(TWO_LEVELS), TWO_LEVELS, 2, NOW)
    assert refusal(acknowledge(risen, TWO_LEVELS, 1)) == "alarm_came_again"


def test_an_acknowledged_level_that_falls_and_rises_is_raised_again() -> None:
    fallen = update_level(acknowledged(TWO_LEVELS, 2), TWO_LEVELS, 1, NOW)
    assert (fallen.state, fallen.occurrence) == (State.ACKNOWLEDGED, 1)
    assert update_level(fallen, TWO_LEVELS, 2, NOW).state is State.UNACKNOWLEDGED


def test_a_latched_alarm_is_reset_after_it_is_acknowledged_and_has_returned() -> None:
    assert refusal(reset(raised(LATCHED), LATCHED)) == "alarm_still_active"
    returned = update_level(raised(LATCHED), LATCHED, 0, NOW)
    assert refusal(reset(returned, LATCHED)) == "alarm_acknowledge_first"
    ready = acknowledge(returned, LATCHED, 1).status
    assert ready.state is State.LATCHED_ACKNOWLEDGED
    assert reset(ready, LATCHED).status.is_normal
    assert reset(NORMAL, LATCHED).repeated
    assert refusal(reset(raised(PLAIN), PLAIN)) == "alarm_not_latched"


def test_an_alarm_stays_while_its_source_is_unknown() -> None:
    unknown = update_level(raised(PLAIN), PLAIN, None, NOW)
    assert (unknown.state, unknown.unknown_since) == (State.UNACKNOWLEDGED, NOW)
    assert unknown.is_standing
    assert update_level(unknown, PLAIN, None, Moment(200.0, 0.0)).unknown_since == NOW
    assert update_level(unknown, PLAIN, 1, NOW) == raised(PLAIN)
    assert update_level(unknown, PLAIN, 0, NOW).state is State.RETURNED_UNACKNOWLEDGED


def test_alarm_acknowledged_while_unknown_is_normal_only_after_a_message() -> None:
    returned = update_level(raised(PLAIN), PLAIN, 0, NOW)
    unknown = acknowledge(update_level(returned, PLAIN, None, NOW), PLAIN, 1).status
    assert unknown.state is State.ACKNOWLEDGED
    assert update_level(unknown, PLAIN, 0, NOW).is_normal
    again = update_level(unknown, PLAIN, 1, NOW)
    assert (again.state, again.occurrence) == (State.UNACKNOWLEDGED, 2)


def test_a_latched_alarm_is_not_reset_while_its_source_is_unknown() -> None:
    ready = update_level(acknowledged(LATCHED), LATCHED, 0, NOW)
    unknown = update_level(ready, LATCHED, None, NOW)
    assert refusal(reset(unknown, LATCHED)) == "alarm_source_unknown"


def test_an_unknown_source_raises_where_the_alarm_says_so() -> None:
    rules = AlarmRules(raise_unknown=True)
    unknown = update_level(NORMAL, rules, None, NOW)
    assert (unknown.state, unknown.occurrence) == (State.UNACKNOWLEDGED, 1)
    assert update_level(unknown, rules, 1, NOW).occurrence == 1
    assert update_level(NORMAL, PLAIN, None, NOW).is_normal


@pytest.mark.parametrize(
    ("rules", "taken", "code"),
    [
        (PLAIN, shelf(SHIFT_S + 1), "alarm_shelve_too_long"),
        (PLAIN, shelf(0), "alarm_shelve_too_long"),
        (PLAIN, shelf(reason=" "), "alarm_reason_missing"),
        (AlarmRules(priorities=(HIGH,)), shelf(), "alarm_shelve_high"),
    ],
)
def test_a_shelf_needs_a_reason_and_a_limit_and_is_not_for_high_priority(
    rules: AlarmRules, taken: TakenOut, code: str
) -> None:
    status = raised(rules)
    result = shelve(status, rules, taken)
    assert (refusal(result), result.status) == (code, status)


def test_a_shelf_ends_at_its_time_and_an_active_alarm_is_raised_again() -> None:
    shelved = shelve(acknowledged(PLAIN), PLAIN, shelf()).status
    assert (shelved.override, shelved.is_standing) == (Override.SHELVED, False)
    assert expire(shelved, PLAIN, Moment(699.9, 0.0)) == shelved
    ended = expire(shelved, PLAIN, Moment(700.0, 0.0))
    assert (ended.state, ended.occurrence, ended.override) == (State.UNACKNOWLEDGED, 2, None)


def test_a_shelf_ends_when_a_level_of_high_priority_is_reached() -> None:
    shelved = shelve(raised(TWO_LEVELS), TWO_LEVELS, shelf()).status
    risen = update_level(shelved, TWO_LEVELS, 2, NOW)
    assert (risen.override, risen.state) == (None, State.UNACKNOWLEDGED)


def test_an_alarm_that_returned_on_its_shelf_is_normal_or_latched_at_the_end() -> None:
    for rules, state in ((PLAIN, State.NORMAL), (LATCHED, State.LATCHED_UNACKNOWLEDGED)):
        shelved = shelve(acknowledged(rules), rules, shelf()).status
        returned = update_level(shelved, rules, 0, NOW)
        assert unshelve(returned, rules, NOW).status.state is state
    assert unshelve(NORMAL, PLAIN, NOW).repeated


def test_out_of_service_ends_a_shelf_and_refuses_another() -> None:
    shelved = shelve(raised(PLAIN), PLAIN, shelf()).status
    out = remove_from_service(shelved, TakenOut(NOW, "Line is rebuilt", "Ann")).status
    assert (out.override, out.shelf) == (Override.OUT_OF_SERVICE, None)
    assert refusal(shelve(out, PLAIN, shelf())) == "alarm_out_of_service"
    assert remove_from_service(out, shelf()).repeated
    assert refusal(remove_from_service(NORMAL, shelf(reason=""))) == "alarm_reason_missing"
    assert return_to_service(out, PLAIN, NOW).status.occurrence == 2
    assert return_to_service(NORMAL, PLAIN, NOW).repeated


def test_an_alarm_suppressed_by_design_is_raised_when_the_suppression_ends() -> None:
    suppressed = update_suppression(NORMAL, PLAIN, True, NOW)
    unseen = update_level(suppressed, PLAIN, 1, NOW)
    assert (unseen.override, unseen.is_standing) == (Override.SUPPRESSED, False)
    shown = update_suppression(unseen, PLAIN, False, NOW)
    assert (shown.state, shown.is_standing) == (State.UNACKNOWLEDGED, True)


class AnAlarm(RuleBasedStateMachine):
    """One alarm under random events. `seen` is the occurrence on the operator's screen."""

    behaviour: AlarmRules = TWO_LEVELS

    def __init__(self) -> None:
        super().__init__()
        self.now = NOW
        self.status = self.before = NORMAL
        self.seen = 0
        self.act = ""

    def next(self, after: AlarmStatus, act: str = "") -> None:
        self.before, self.status, self.act = self.status, after, act

    @rule(level=st.sampled_from([None, 0, 1, 2]))
    def level_changes(self, level: int | None) -> None:
        self.next(update_level(self.status, self.behaviour, level, self.now))

    @rule(seconds=st.floats(0, 2 * SHIFT_S))
    def time_passes(self, seconds: float) -> None:
        self.now = Moment(self.now.monotonic + seconds, self.now.wall - seconds)
        self.next(expire(self.status, self.behaviour, self.now))

    @rule()
    def operator_looks(self) -> None:
        self.seen = self.status.occurrence

    @rule()
    def operator_acknowledges(self) -> None:
        result = acknowledge(self.status, self.behaviour, self.seen)
        if self.seen != self.status.occurrence:
            assert result.status == self.status
        self.next(result.status, "acknowledge")

    @rule()
    def operator_resets(self) -> None:
        self.next(reset(self.status, self.behaviour).status, "reset")

    @rule(for_s=st.floats(-10, 2 * SHIFT_S), reason=st.sampled_from(["", "Tests"]))
    def operator_shelves(self, for_s: float, reason: str) -> None:
        taken = TakenOut(self.now, reason, "Ann", self.now.monotonic + for_s)
        self.next(shelve(self.status, self.behaviour, taken).status, "shelve")

    @rule()
    def operator_unshelves(self) -> None:
        self.next(unshelve(self.status, self.behaviour, self.now).status, "unshelve")

    @rule()
    def maintenance_takes_it_out_of_service(self) -> None:
        taken = TakenOut(self.now, "Line is rebuilt", "Bob")
        self.next(remove_from_service(self.status, taken).status, "out_of_service")

    @rule()
    def maintenance_returns_it_to_service(self) -> None:
        self.next(return_to_service(self.status, self.behaviour, self.now).status, "in_service")

    @rule(suppressed=st.booleans())
    def suppression_changes(self, suppressed: bool) -> None:
        self.next(update_suppression(self.status, self.behaviour, suppressed, self.now))

    @invariant()
    def none_is_acknowledged_without_an_act(self) -> None:
        states = self.before.state, self.status.state
        if self.behaviour.kind.acknowledge and states == (State.UNACKNOWLEDGED, State.ACKNOWLEDGED):
            assert (self.act, self.seen) == ("acknowledge", self.status.occurrence)
        if self.act == "" and self.before.override is None and self.behaviour.kind.acknowledge:
            assert self.status.is_acknowledged <= self.before.is_acknowledged

    @invariant()
    def none_is_lost(self) -> None:
        if self.status.level:
            assert self.status.state in (State.UNACKNOWLEDGED, State.ACKNOWLEDGED)
        if self.behaviour.kind.latched and not self.before.is_normal and self.status.is_normal:
            assert self.act == "reset"

    @invariant()
    def none_becomes_normal_while_its_source_is_unknown(self) -> None:
        if self.status.unknown_since and not self.before.is_normal:
            assert not self.status.is_normal

    @invariant()
    def a_shelf_has_a_limit_and_holds_no_high_priority(self) -> None:
        if shelved := self.status.shelf:
            assert 0 < shelved.until - shelved.since.monotonic <= SHIFT_S
            assert shelved.until > self.now.monotonic
            assert not self.status.level or self.behaviour.priority(self.status.level) != HIGH

    @invariant()
    def occurrences_only_count_up(self) -> None:
        assert self.status.occurrence >= self.before.occurrence
        if self.before.is_standing < self.status.is_standing and self.status.level:
            assert self.status.occurrence > self.before.occurrence


class ALatchedAlarm(AnAlarm):
    behaviour = replace(TWO_LEVELS, kind=AlarmKind(latched=True))


class AnAlarmThatNeedsNoAcknowledgement(AnAlarm):
    behaviour = replace(TWO_LEVELS, kind=AlarmKind(acknowledge=False))


class AnAlarmRaisedWhenUnknown(AnAlarm):
    behaviour = replace(TWO_LEVELS, raise_unknown=True)


OFTEN = settings(max_examples=several(40, 150), stateful_step_count=40, deadline=None)
TestAnAlarm = AnAlarm.TestCase
TestALatchedAlarm = ALatchedAlarm.TestCase
TestAnAlarmThatNeedsNoAcknowledgement = AnAlarmThatNeedsNoAcknowledgement.TestCase
TestAnAlarmRaisedWhenUnknown = AnAlarmRaisedWhenUnknown.TestCase
for case in (
    TestAnAlarm,
    TestALatchedAlarm,
    TestAnAlarmThatNeedsNoAcknowledgement,
    TestAnAlarmRaisedWhenUnknown,
):
    case.settings = OFTEN
del case  # else its tests run twice

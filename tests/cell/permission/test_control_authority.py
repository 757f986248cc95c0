"""Who has control: one at a time, never the absent, and never by accident."""

import math
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from app.cell.permission.control import (
    ASK_AGAIN_S,
    LIFE_S,
    ControlAuthority,
    ControlRefusal,
    HandOver,
    Role,
    role,
)
from app.panel import Panel, load_panel
from app.panel.rules import ControlRules
from app.records.principal import Clients, Principal, anonymous
from app.system.errors import PanelError
from tests.support.builders import faults_text
from tests.support.form import several
from tests.support.words import english

pytestmark = pytest.mark.promise("control")

RULES = ControlRules(required=True)
TAKEOVER_S = RULES.takeover_after_s
FORM_LIFE_S = 35.0

_KNOWN = Clients()
ANN, BOB, CY = (Principal(_KNOWN.identify(f"{n:032x}", f"192.0.2.{n}")) for n in (1, 2, 3))
CELL, CELL2 = (Principal(_KNOWN.identify(f"{n:032x}", "127.0.0.1")) for n in (8, 9))
ANONYMOUS = Principal(anonymous("192.0.2.99"))


class Room:
    """A control whose time is set; `pass_s` lets time pass while some give signs of life."""

    def __init__(self, rules: ControlRules = RULES, robot: str = "Robot 1") -> None:
        self.now = 1000.0
        self.logged: list[str] = []
        self.hand_overs: list[HandOver] = []
        self.control = ControlAuthority(
            rules,
            robot,
            monotonic=lambda: self.now,
            wall=lambda: self.now,
            log_line=self.logged.append,
            on_hand_over=self.hand_overs.append,
        )

    def pass_s(self, seconds: float, *alive: Principal, touched: bool = False) -> None:
        end = self.now + seconds
        while self.now < end:
            self.now = min(end, self.now + 1)
            for browser in alive:
                self.control.keepalive(browser, touched)

    def may(self, client: Principal) -> bool:
        return self.control.verdict(client).permitted

    def role(self, client: Principal) -> Role:
        return role(self.control.view(), client, self.control.rules)


@pytest.fixture
def room() -> Room:
    return Room()


@pytest.fixture
def held(room: Room) -> Room:
    """Ann has control."""
    assert room.control.take(ANN) == ""
    return room


@pytest.fixture
def requested(held: Room) -> Room:
    """Ann has control, and Bob asks for it."""
    assert held.control.ask(BOB) == ""
    return held


def test_every_client_may_press_where_control_is_not_required() -> None:
    room = Room(ControlRules(required=False))
    assert all(room.may(client) for client in (ANN, CELL, ANONYMOUS))
    assert not room.control.view()["required"]
    assert room.control.until == math.inf


def test_no_client_has_control_at_first(room: Room) -> None:
    assert room.control.holder is None
    verdict = room.control.verdict(ANN)
    assert (verdict.permitted, verdict.code) == (False, "control_free")
    assert english(verdict.reason) == "No panel has control of Robot 1. Take control first."
    assert not room.may(CELL)


def test_holder_of_control_may_press_and_others_see_the_holder(held: Room) -> None:
    assert held.may(ANN)
    for other in (BOB, CELL, ANONYMOUS):
        verdict = held.control.verdict(other)
        assert verdict.code == "control_held"
        assert english(verdict.reason) == "Panel 1 (192.0.2.1) has control of Robot 1."


def test_unnamed_robot_is_called_the_robot() -> None:
    room = Room(robot="")
    room.control.take(CELL)
    assert (
        english(room.control.verdict(ANN).reason) == "The panel at the cell has control of the robot."
    )


def test_a_press_takes_nothing(room: Room) -> None:
    room.control.touch(ANN)
    assert room.control.holder is None


def test_taking_twice_is_taking_once(held: Room) -> None:
    lines = len(held.logged)
    assert held.control.take(ANN) == ""
    assert held.control.holder == ANN
    assert len(held.logged) == lines


def test_control_of_another_client_is_not_taken(held: Room) -> None:
    assert held.control.take(BOB) == "control_held_by_other"
    assert held.control.holder == ANN


def test_client_without_a_token_gets_nothing(room: Room) -> None:
    assert room.control.take(ANONYMOUS) == room.control.ask(ANONYMOUS) == "control_no_cookie"
    assert room.control.until == math.inf
    room.control.take(ANN)
    assert room.control.take(ANONYMOUS) == room.control.ask(ANONYMOUS) == "control_no_cookie"
    assert (room.control.holder, room.control.requester) == (ANN, None)
    assert room.control.give(ANONYMOUS, "") == room.control.release(ANONYMOUS) == "control_changed"


def test_the_panel_at_the_cell_takes_over(requested: Room) -> None:
    assert requested.control.take(CELL) == ""
    assert requested.control.holder == CELL
    assert not requested.may(ANN)
    assert requested.control.requester == BOB  # whose request is now shown there


def test_the_panel_at_the_cell_needs_no_consent(held: Room) -> None:
    assert held.control.ask(CELL) == ""
    assert held.control.holder == CELL


def test_without_local_the_panel_at_the_cell_asks_like_others() -> None:
    room = Room(ControlRules(required=True, local=False))
    room.control.take(ANN)
    assert room.control.take(CELL) == "control_held_by_other"
    assert room.control.ask(CELL) == ""
    assert (room.control.holder, room.control.requester) == (ANN, CELL)


# Asking.


def test_free_control_is_taken_without_a_request(room: Room) -> None:
    assert room.control.ask(BOB) == ""
    assert room.control.holder == BOB


def test_the_holder_asks_for_nothing(held: Room) -> None:
    assert held.control.ask(ANN) == ""
    assert held.control.requester is None


def test_a_request_is_shown_to_all(requested: Room) -> None:
    view = requested.control.view()
    assert (view["holder"], view["asker"]) == (ANN.client.id, BOB.client.id)
    assert english(view["asker_name"]) == "Panel 2 (192.0.2.2)"
    assert english(view["holder_text"]) == (
        "Panel 2 (192.0.2.2) requests control of Robot 1."
        " If this panel is not touched, control passes in 30 s."
    )
    assert "control passes to you in 30 s" in str(view["asker_text"])
    assert english(view["text"]) == "Panel 1 (192.0.2.1) has control of Robot 1."
    assert view["since"] == "1970-01-01T00:16:40.000+00:00"


def test_requester_of_control_may_not_press(requested: Room) -> None:
    assert requested.may(ANN)
    assert not requested.may(BOB)


def test_only_one_client_requests_control_at_a_time(requested: Room) -> None:
    assert requested.control.ask(BOB) == ""
    assert requested.control.ask(CY) == "control_already_requested"
    assert requested.control.requester == BOB


def test_the_holder_gives(requested: Room) -> None:
    assert requested.control.give(ANN, BOB.client.id) == ""
    assert (requested.control.holder, requested.control.requester) == (BOB, None)
    assert not requested.may(ANN)


def test_the_holder_keeps_and_the_request_can_be_repeated_later(requested: Room) -> None:
    assert requested.control.keep(ANN, BOB.client.id) == ""
    assert (requested.control.holder, requested.control.requester) == (ANN, None)
    assert requested.control.ask(BOB) == "control_denied"
    assert requested.control.ask(CY) == ""  # another one may
    requested.control.keep(ANN, CY.client.id)
    requested.pass_s(ASK_AGAIN_S, ANN)
    assert requested.control.ask(BOB) == ""


@pytest.mark.parametrize("act", [ControlAuthority.give, ControlAuthority.keep])
@pytest.mark.parametrize("who", [BOB, CY, CELL, ANONYMOUS])
def test_only_the_holder_answers_a_request(
    requested: Room, act: Callable[[ControlAuthority, Principal, str], ControlRefusal], who: Principal
) -> None:
    assert act(requested.control, who, BOB.client.id) == "control_changed"
    assert (requested.control.holder, requested.control.requester) == (ANN, BOB)


@pytest.mark.parametrize("act", [ControlAuthority.give, ControlAuthority.keep])
@pytest.mark.parametrize("to", [CY.client.id, ANN.client.id, ""])
def test_an_answer_is_for_the_request_that_was_on_the_screen(
    requested: Room, act: Callable[[ControlAuthority, Principal, str], ControlRefusal], to: str
) -> None:
    assert act(requested.control, ANN, to) == "control_changed"
    assert (requested.control.holder, requested.control.requester) == (ANN, BOB)


def test_a_request_that_was_withdrawn_can_not_be_granted(requested: Room) -> None:
    assert requested.control.release(BOB) == ""
    assert requested.control.give(ANN, BOB.client.id) == "control_changed"
    assert requested.control.holder == ANN


def test_a_request_goes_through_without_a_touch(requested: Room) -> None:
    requested.pass_s(TAKEOVER_S - 0.5, ANN, BOB)
    assert requested.control.holder == ANN
    requested.pass_s(0.5, ANN, BOB)
    assert (requested.control.holder, requested.control.requester) == (BOB, None)
    assert not requested.may(ANN)


def test_the_holder_has_the_whole_time_from_the_request_on(held: Room) -> None:
    held.pass_s(10 * TAKEOVER_S, ANN)
    held.control.ask(BOB)
    held.pass_s(TAKEOVER_S - 1, ANN, BOB)
    assert held.control.holder == ANN


def test_every_touch_makes_a_request_wait_longer(requested: Room) -> None:
    requested.pass_s(5 * TAKEOVER_S, ANN, BOB, touched=True)
    assert requested.control.holder == ANN
    requested.pass_s(TAKEOVER_S, ANN, BOB)
    assert requested.control.holder == BOB


def test_a_touch_of_another_counts_for_nothing(requested: Room) -> None:
    for _ in range(int(TAKEOVER_S)):
        requested.pass_s(1, ANN)
        requested.control.keepalive(BOB, True)
        requested.control.touch(CY)
    assert requested.control.holder == BOB


def test_a_press_is_a_touch(requested: Room) -> None:
    requested.pass_s(TAKEOVER_S - 1, ANN, BOB)
    requested.control.touch(ANN)
    requested.pass_s(TAKEOVER_S - 1, ANN, BOB)
    assert requested.control.holder == ANN


def test_new_holder_keeps_control_for_a_minimum_time(requested: Room) -> None:
    requested.pass_s(TAKEOVER_S, ANN, BOB)
    requested.control.ask(ANN)
    requested.pass_s(TAKEOVER_S - 1, ANN, BOB)
    assert requested.control.holder == BOB


def test_a_shorter_time_may_be_set() -> None:
    room = Room(ControlRules(required=True, takeover_after_s=3))
    room.control.take(ANN)
    room.control.ask(BOB)
    assert "to you in 3 s" in str(room.control.view()["asker_text"])
    room.pass_s(3, ANN, BOB)
    assert room.control.holder == BOB


# Giving it up, and being lost.


def test_releasing_frees_control(held: Room) -> None:
    assert held.control.release(ANN) == ""
    assert held.control.holder is None
    assert held.control.release(ANN) == "control_changed"
    assert held.control.view()["since"] == ""


def test_releasing_during_a_request_passes_control_to_the_requester(requested: Room) -> None:
    requested.control.release(ANN)
    assert (requested.control.holder, requested.control.requester) == (BOB, None)


@pytest.mark.parametrize("who", [BOB, CELL, ANONYMOUS])
def test_only_the_holder_releases_control(held: Room, who: Principal) -> None:
    assert held.control.release(who) == "control_changed"
    assert held.control.holder == ANN


def test_a_holder_that_is_there_holds_for_hours(held: Room) -> None:
    held.pass_s(7200, ANN)
    assert held.control.holder == ANN


def test_lost_holder_frees_control_in_time(held: Room) -> None:
    held.pass_s(60, ANN)
    assert held.control.until == held.now + LIFE_S
    held.now += LIFE_S - 0.01
    assert held.may(ANN)
    held.now += 0.01
    assert not held.may(ANN)
    assert held.control.holder is None


def test_lost_holder_passes_control_to_the_requester(requested: Room) -> None:
    requested.pass_s(LIFE_S, BOB)
    assert (requested.control.holder, requested.control.requester) == (BOB, None)


def test_a_request_ends_with_its_asker(requested: Room) -> None:
    requested.pass_s(LIFE_S, ANN)
    assert (requested.control.holder, requested.control.requester) == (ANN, None)


def test_lost_holder_and_lost_requester_leave_control_free(requested: Room) -> None:
    requested.now += 3600
    assert (requested.control.holder, requested.control.requester) == (None, None)
    assert not requested.may(BOB)


def test_returning_client_takes_control_as_any_other(held: Room) -> None:
    held.now += LIFE_S
    held.control.keepalive(ANN, True)
    assert not held.may(ANN)
    held.control.take(BOB)
    assert held.control.take(ANN) == "control_held_by_other"


def test_without_scripts_each_page_lasts_until_the_next(room: Room) -> None:
    room.control.take(ANN, FORM_LIFE_S)
    for _ in range(10):
        room.now += FORM_LIFE_S - 0.1
        room.control.loaded(ANN, FORM_LIFE_S, opened_by_person=True)
    assert room.may(ANN)
    room.now += FORM_LIFE_S
    assert not room.may(ANN)


def test_a_page_with_scripts_is_lost_as_fast_after_a_page_load(held: Room) -> None:
    held.control.loaded(ANN, FORM_LIFE_S, opened_by_person=True)
    held.now += LIFE_S
    assert not held.may(ANN)


# The panel at the cell takes what is free with its first page.


def test_first_page_at_the_cell_takes_free_control(room: Room) -> None:
    room.control.loaded(CELL, FORM_LIFE_S, opened_by_person=True)
    assert room.may(CELL)
    room.control.keepalive(CELL, False)
    room.now += LIFE_S
    assert not room.may(CELL)


@pytest.mark.parametrize(
    ("who", "opened_by_person"), [(ANN, True), (CELL, False), (Principal(anonymous("::1")), True)]
)
def test_no_other_page_takes_anything(room: Room, who: Principal, opened_by_person: bool) -> None:
    room.control.loaded(who, FORM_LIFE_S, opened_by_person)
    assert room.control.holder is None


def test_page_load_never_takes_control_from_a_holder(held: Room) -> None:
    held.control.loaded(CELL, FORM_LIFE_S, opened_by_person=True)
    assert held.control.holder == ANN


def test_no_page_takes_where_local_is_off() -> None:
    room = Room(ControlRules(required=True, local=False))
    room.control.loaded(CELL, FORM_LIFE_S, opened_by_person=True)
    assert room.control.holder is None


def test_released_control_is_taken_by_the_button_only(room: Room) -> None:
    room.control.take(CELL)
    room.control.release(CELL)
    room.control.loaded(CELL, FORM_LIFE_S, opened_by_person=True)
    assert room.control.holder is None
    room.control.take(CELL)
    room.now += LIFE_S
    room.control.loaded(CELL, FORM_LIFE_S, opened_by_person=True)
    assert room.control.holder == CELL


def test_every_role_is_in_the_view(room: Room) -> None:
    everybody = (ANN, BOB, CY, CELL, ANONYMOUS)
    assert {room.role(client) for client in everybody} == {"free"}
    room.control.take(ANN)
    assert [room.role(client) for client in everybody] == ["holding", "held", "held", "over", "held"]
    room.control.ask(BOB)
    assert [room.role(client) for client in everybody] == ["asked", "asking", "held", "over", "held"]


def test_each_change_of_control_is_logged_with_its_client(requested: Room) -> None:
    requested.control.give(ANN, BOB.client.id)
    requested.control.take(CELL)
    requested.now += LIFE_S
    requested.control.advance()
    assert requested.logged == [
        "control taken by Panel 1 (192.0.2.1)",
        "Panel 2 (192.0.2.2) asks for control",
        "control given by Panel 1 (192.0.2.1), now of Panel 2 (192.0.2.2)",
        "control taken over by the panel at the cell (127.0.0.1)",
        "control lost by the panel at the cell (127.0.0.1), now of no one",
    ]


# Reading writes nothing; `advance` records.


def read_all(room: Room) -> list[object]:
    """What every getter answers."""
    control = room.control
    verdicts = [control.verdict(who) for who in (ANN, BOB, CELL, ANONYMOUS)]
    return [control.holder, control.requester, control.lock, control.until, control.view(), *verdicts]


@pytest.mark.parametrize(
    ("alive", "hand_over"),
    [
        ((BOB,), HandOver("lost", ANN, BOB)),
        ((ANN,), HandOver("request_lost", BOB)),
        ((ANN, BOB), HandOver("idle", ANN, BOB)),
    ],
)
def test_reading_after_an_expiry_writes_nothing_and_the_next_advance_records_it_once(
    requested: Room, alive: tuple[Principal, ...], hand_over: HandOver
) -> None:
    due = requested.now + (TAKEOVER_S if len(alive) > 1 else LIFE_S)
    requested.pass_s(due - requested.now - 1, *alive)
    requested.now = due + 0.5
    lines = len(requested.logged)
    before = read_all(requested)
    assert (len(requested.logged), requested.hand_overs) == (lines, [])

    requested.control.advance()
    assert read_all(requested) == before
    requested.control.advance()
    assert requested.hand_overs == [hand_over]
    assert requested.logged[lines:] == [str(hand_over)]


def test_control_that_passed_by_time_counts_from_when_it_was_due(requested: Room) -> None:
    requested.pass_s(TAKEOVER_S - 1, ANN, BOB)
    requested.now += 3
    since = requested.control.view()["since"]
    assert since.startswith("1970-01-01T00:17:10.000")  # 1000 s and the time to a takeover
    requested.now += 1
    assert requested.control.view()["since"] == since


def test_a_takeover_stands_if_its_client_is_lost_before_it_is_recorded(requested: Room) -> None:
    requested.pass_s(TAKEOVER_S - 1, ANN, BOB)
    requested.now += 1 + LIFE_S
    requested.control.advance()
    assert requested.hand_overs == [HandOver("idle", ANN, BOB), HandOver("lost", BOB)]


# What a panel file says of it.


def panel_with(folder: Path, table: str) -> Panel:
    path = folder / "cell.toml"
    path.write_text(f'title = "Cell"\n{table}\n[[page]]\nid = "one"\ntitle = "One"\n')
    return load_panel(path)


def test_control_is_off_by_default(tmp_path: Path) -> None:
    assert panel_with(tmp_path, "").control.required is False
    assert panel_with(tmp_path, "[control]\nrequired = false").control.required is False


def test_one_key_requires_control(tmp_path: Path) -> None:
    rules = panel_with(tmp_path, "[control]\nrequired = true").control
    assert (rules.required, rules.takeover_after_s, rules.local) == (True, 30.0, True)


@pytest.mark.parametrize(
    ("table", "fault"),
    [
        ("control = true", "control: must be a table, not true"),
        ("[control]", "control.required: is missing"),
        ("[control]\ntakeover_after_s = 5", "control.required: is missing"),
        ('[control]\nrequired = "yes"', 'control.required: must be true or false, not "yes"'),
        (
            "[control]\nrequired = true\ntakeover_after_s = 0",
            "control.takeover_after_s: must be more than 0, not 0",
        ),
        ("[control]\nrequired = true\ntakeover_after_s = nan", "control.takeover_after_s: "),
        ("[control]\nrequired = true\ntakeover_after_s = 1e9", "control.takeover_after_s: "),
        ("[control]\nrequired = true\nlocl = true", 'control.locl: unknown key; did you mean "local"?'),
    ],
)
def test_faults_of_the_control_table_are_reported_with_all_others(
    tmp_path: Path, table: str, fault: str
) -> None:
    with pytest.raises(PanelError) as caught:
        panel_with(tmp_path, f'{table}\n[[interlock]]\nid = "a"\ntopic = "nowhere"\n')
    assert fault in faults_text(caught.value)
    assert "interlock[0].topic" in faults_text(caught.value)


# Whatever they do, in whatever order.

EVERYBODY = (ANN, BOB, CY, CELL, CELL2, ANONYMOUS)
WHO = st.sampled_from(EVERYBODY)
SCRIPTED = st.booleans()
SECONDS = st.floats(0, 45, allow_nan=False)


class Everybody(RuleBasedStateMachine):
    """Acts of six browsers in any order, beside a second book of who was heard of when."""

    def __init__(self) -> None:
        super().__init__()
        self.room = Room()
        self.alive_until = dict.fromkeys(EVERYBODY, -math.inf)
        self.wanted: set[str] = set()

    def heard(self, who: Principal, life_s: float = LIFE_S) -> None:
        self.alive_until[who] = max(self.alive_until[who], self.room.now + life_s)

    @rule(seconds=SECONDS)
    def time_passes(self, seconds: float) -> None:
        self.room.now += seconds

    @rule(who=WHO, scripted=SCRIPTED)
    def take(self, who: Principal, scripted: bool) -> None:
        life_s = LIFE_S if scripted else FORM_LIFE_S
        before = self.room.control.holder
        refusal = self.room.control.take(who, life_s)
        self.heard(who, life_s)
        self.wanted.add(who.client.id)
        if before not in (None, who) and not who.client.local and who.client.id:
            assert refusal == "control_held_by_other"
            assert self.room.control.holder == before

    @rule(who=WHO, scripted=SCRIPTED)
    def ask(self, who: Principal, scripted: bool) -> None:
        life_s = LIFE_S if scripted else FORM_LIFE_S
        before = self.room.control.holder
        self.room.control.ask(who, life_s)
        self.heard(who, life_s)
        self.wanted.add(who.client.id)
        if before not in (None, who) and not who.client.local:
            assert self.room.control.holder == before

    @rule(who=WHO, to=WHO)
    def give(self, who: Principal, to: Principal) -> None:
        before, asker = self.room.control.holder, self.room.control.requester
        refusal = self.room.control.give(who, to.client.id)
        granted = before == who and asker == to and bool(who.client.id)
        assert (refusal == "") == granted
        assert self.room.control.holder == (to if granted else before)

    @rule(who=WHO, to=WHO)
    def keep(self, who: Principal, to: Principal) -> None:
        before = self.room.control.holder
        if self.room.control.keep(who, to.client.id) == "":
            assert before == who
            assert self.room.control.requester is None
            self.heard(who)
        assert self.room.control.holder == before

    @rule(who=WHO)
    def release(self, who: Principal) -> None:
        before, asker = self.room.control.holder, self.room.control.requester
        if self.room.control.release(who) == "" and before == who:
            assert self.room.control.holder == asker
        else:
            assert self.room.control.holder == before

    @rule(who=WHO, touched=st.booleans())
    def here(self, who: Principal, touched: bool) -> None:
        self.room.control.keepalive(who, touched)
        self.heard(who)

    @rule(who=WHO, opened_by_person=st.booleans())
    def loads_a_page(self, who: Principal, opened_by_person: bool) -> None:
        before = self.room.control.holder
        self.room.control.loaded(who, FORM_LIFE_S, opened_by_person)
        self.heard(who, FORM_LIFE_S)
        if who.client.local:
            self.wanted.add(who.client.id)
        if before or not opened_by_person:
            assert self.room.control.holder == before

    @rule(who=WHO)
    def presses(self, who: Principal) -> None:
        before = self.room.control.holder
        self.room.control.touch(who)
        assert self.room.may(who) == (before == who)
        assert self.room.control.holder == before
        self.heard(who)

    @precondition(lambda self: self.room.control.holder and self.room.control.requester)
    @rule(touched=st.booleans())
    def both_stay_for_the_time_of_a_takeover(self, touched: bool) -> None:
        holder, asker = self.room.control.holder, self.room.control.requester
        assert holder
        assert asker
        self.room.pass_s(TAKEOVER_S, holder, asker, touched=touched)
        self.heard(holder)
        self.heard(asker)
        assert self.room.control.holder == (holder if touched else asker)

    @rule()
    def all_are_lost(self) -> None:
        self.room.now += FORM_LIFE_S
        assert (self.room.control.holder, self.room.control.requester) == (None, None)

    @invariant()
    def at_most_one_may_press(self) -> None:
        holder = self.room.control.holder
        assert [client for client in EVERYBODY if self.room.may(client)] == ([holder] if holder else [])
        assert holder is None or holder.client.id

    @invariant()
    def no_absent_client_holds_or_asks(self) -> None:
        for party in (self.room.control.holder, self.room.control.requester):
            assert party is None or self.alive_until[party] > self.room.now

    @invariant()
    def no_client_gets_it_by_accident(self) -> None:
        for party in (self.room.control.holder, self.room.control.requester):
            assert party is None or party.client.id in self.wanted

    @invariant()
    def no_client_asks_for_what_is_free_or_own(self) -> None:
        asker = self.room.control.requester
        assert asker is None or self.room.control.holder not in (None, asker)

    @invariant()
    def what_time_will_change_is_known(self) -> None:
        control = self.room.control
        assert control.until > self.room.now
        assert (control.until == math.inf) == (control.holder is None)

    @invariant()
    def the_view_says_the_same(self) -> None:
        view, control = self.room.control.view(), self.room.control
        assert view["holder"] == (control.holder.client.id if control.holder else "")
        assert view["asker"] == (control.requester.client.id if control.requester else "")
        roles = [self.room.role(client) for client in EVERYBODY]
        assert sum(role in ("holding", "asked") for role in roles) == (control.holder is not None)


TestEverybody = Everybody.TestCase
TestEverybody.settings = settings(
    max_examples=several(25, 150),
    stateful_step_count=60,
    deadline=None,
    database=None,
    derandomize=True,
)

"""Sessions of signed-in users, by an injected clock."""

from dataclasses import dataclass

from app.cell.people.sessions import MOST, MOST_OF_USER, Sessions
from app.records.principal import Client

CELL = Client("c0ffee", "127.0.0.1", True, 1)
TABLET = Client("badcafe", "10.0.0.9", False, 1)


@dataclass
class Clock:
    now: float = 50.0

    def __call__(self) -> float:
        return self.now


def test_a_session_is_that_of_its_browser_only() -> None:
    sessions = Sessions(600, Clock())
    session = sessions.begin("Sato", CELL)
    assert sessions.get(session.id, CELL.id) is session
    assert sessions.get(session.id, TABLET.id) is None
    assert sessions.get(session.id, "") is None
    assert sessions.get("", CELL.id) is None


def test_a_browser_has_one_session() -> None:
    sessions = Sessions(600, Clock())
    first = sessions.begin("Sato", CELL)
    second = sessions.begin("Weber", CELL)
    assert sessions.get(first.id, CELL.id) is None
    assert sessions.get(second.id, CELL.id) is second


def test_a_session_without_a_touch_ends() -> None:
    clock = Clock()
    sessions = Sessions(60, clock)
    session = sessions.begin("Sato", CELL)
    clock.now += 59
    assert sessions.left_s(session) == 1
    sessions.touch(session)
    clock.now += 59.5
    assert sessions.end_due() == []
    clock.now += 0.5
    assert sessions.get(session.id, CELL.id) is None
    assert sessions.end_due() == [(session, "idle")]
    sessions.touch(session)
    assert sessions.get(session.id, CELL.id) is None


def test_a_session_does_not_end_during_a_hold() -> None:
    clock = Clock()
    sessions = Sessions(60, clock)
    session = sessions.begin("Sato", CELL)
    with sessions.holding(session):
        clock.now += 1000
        assert sessions.end_due() == []
        assert sessions.get(session.id, CELL.id) is session
    clock.now += 59
    assert sessions.end_due() == []
    clock.now += 1
    assert sessions.end_due() == [(session, "idle")]


def test_without_a_time_a_session_never_ends_by_itself() -> None:
    clock = Clock()
    sessions = Sessions(0, clock)
    session = sessions.begin("Sato", CELL)
    clock.now += 1e7
    assert (sessions.left_s(session), sessions.end_due()) == (None, [])


def test_sessions_of_changed_users_end() -> None:
    sessions = Sessions(600, Clock())
    session, other = sessions.begin("Sato", CELL), sessions.begin("Weber", TABLET)
    assert sessions.end_users(frozenset({"Sato"})) == [session]
    assert sessions.get(other.id, TABLET.id) is other


def test_the_number_of_sessions_is_bounded() -> None:
    sessions = Sessions(600, Clock())
    first = sessions.begin("Weber", CELL)
    for number in range(MOST + 5):
        sessions.begin(f"user {number // 2}", Client(f"{number:x}", "10.0.0.9", False, number))
        sessions.end_surplus()
    assert len(sessions) == MOST
    assert sessions.get(first.id, CELL.id) is first


def test_a_user_has_so_many_sessions_at_most_and_one_that_holds_stays() -> None:
    sessions = Sessions(600, Clock())
    begun = [
        sessions.begin("Sato", Client(f"{number:x}", "10.0.0.9", False, number))
        for number in range(MOST_OF_USER + 1)
    ]
    sessions.touch(begun[1])
    with sessions.holding(begun[0]):
        assert sessions.end_surplus() == [begun[2]]


def test_a_user_has_at_most_so_many_sessions_as_the_panel_says() -> None:
    sessions = Sessions(600, Clock(), most=2)
    first, *_ = [
        sessions.begin("Sato", Client(f"{number:x}", "10.0.0.9", False, number)) for number in range(3)
    ]
    assert sessions.end_surplus() == [first]
    sessions.begin("Weber", CELL)
    assert sessions.end_surplus() == []


def test_a_session_has_a_longest_time_whatever_is_touched() -> None:
    clock = Clock()
    sessions = Sessions(60, clock, longest_s=100)
    session = sessions.begin("Sato", CELL)
    clock.now += 50
    sessions.touch(session)
    assert (sessions.left_s(session), sessions.ends_by(session)) == (50, "longest")
    clock.now += 45
    sessions.touch(session)
    with sessions.holding(session):
        clock.now += 1000
        assert sessions.end_due() == []
        assert sessions.get(session.id, CELL.id) is session
    assert sessions.get(session.id, CELL.id) is None
    assert sessions.end_due() == [(session, "longest")]


def test_idle_time_comes_first_where_it_ends_first() -> None:
    clock = Clock()
    sessions = Sessions(60, clock, longest_s=100)
    session = sessions.begin("Sato", CELL)
    assert (sessions.left_s(session), sessions.ends_by(session)) == (60, "idle")
    clock.now += 61
    assert sessions.end_due() == [(session, "idle")]


def test_others_name_a_session_without_its_secret() -> None:
    clock = Clock()
    sessions = Sessions(600, clock)
    session = sessions.begin("Sato", CELL)
    clock.now += 9
    sessions.touch(session)
    clock.now += 3
    assert sessions.seen_s(session) == (12, 3)
    assert sessions.of_handle(session.handle) is session
    assert sessions.of_handle(session.id) is None
    assert sessions.get(session.handle, CELL.id) is None
    sessions.end(session)
    assert (sessions.of_handle(session.handle), [*sessions]) == (None, [])

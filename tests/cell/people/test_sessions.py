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
    assert sessions.end_idle() == []
    clock.now += 0.5
    assert sessions.get(session.id, CELL.id) is None
    assert sessions.end_idle() == [session]
    sessions.touch(session)
    assert sessions.get(session.id, CELL.id) is None


def test_a_session_does_not_end_during_a_hold() -> None:
    clock = Clock()
    sessions = Sessions(60, clock)
    session = sessions.begin("Sato", CELL)
    with sessions.holding(session):
        clock.now += 1000
        assert sessions.end_idle() == []
        assert sessions.get(session.id, CELL.id) is session
    clock.now += 59
    assert sessions.end_idle() == []
    clock.now += 1
    assert sessions.end_idle() == [session]


def test_without_a_time_a_session_never_ends_by_itself() -> None:
    clock = Clock()
    sessions = Sessions(0, clock)
    session = sessions.begin("Sato", CELL)
    clock.now += 1e7
    assert (sessions.left_s(session), sessions.end_idle()) == (None, [])


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

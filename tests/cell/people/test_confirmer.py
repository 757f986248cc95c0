"""Confirmations of single presses: by whom, for which press, for how long, and once."""

from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

import pytest

from app.cell.people.access import Access, Attempt
from app.cell.people.confirmer import VALID_S, Confirmer, Question, able_users
from app.cell.people.secrets_hash import hashed
from app.cell.people.sessions import Session
from app.cell.people.users import User, UserBook
from app.cell.permission.roles import ConfirmedBy
from app.panel.roles import ENGINEER, MAINTENANCE, OPERATOR, VIEWER
from app.records.principal import Principal
from app.system.texts import Text
from tests.cell.people.test_access import CELL, KeptLog, book, pin, run
from tests.cell.people.test_access import QUICK as QUICK_COST

pytestmark = pytest.mark.promise("users")

PIN: Final = Question("start", "inputs", "pin", frozenset({OPERATOR}))
TWO: Final = replace(PIN, confirmation="two_persons")
SATO, NOVAK = pin("M. Sato", "2580"), Attempt("K. Novak", "password", "long enough")


class Bench:
    """A signed-in operator, and a clock."""

    def __init__(self, access: Access, log: KeptLog, session: Session) -> None:
        self.access, self.log, self.session, self.now = access, log, session, 0.0
        self.confirmer = Confirmer(access, lambda: self.now)

    @property
    def who(self) -> Principal:
        return self.access.principal(CELL, self.session.id)

    async def confirmed(self, question: Question, attempt: Attempt) -> str:
        """The token, or the code of the refusal."""
        checked, token = await self.confirmer.confirm(self.who, self.session, question, attempt)
        return token or f"refused: {checked.code}"

    def take(self, token: str, **other: str) -> ConfirmedBy | None:
        press = {"session": self.session.id, "widget": "start", "inputs": "inputs"} | other
        return self.confirmer.take(token, **press)


def with_operator(folder: Path, work: Callable[[Bench], Awaitable[None]]) -> KeptLog:
    async def signed_in(access: Access, log: KeptLog) -> None:
        _, session = await access.sign_in(CELL, SATO)
        assert session is not None
        await work(Bench(access, log, session))

    return run(folder, signed_in, everyone())


def everyone() -> UserBook:
    known = book()
    viewer = User("V. Iewer", VIEWER, pin=hashed("1111", QUICK_COST))
    return replace(known, users=(*known.users, viewer))


def test_a_confirmation_is_for_one_press(tmp_path: Path) -> None:
    async def work(bench: Bench) -> None:
        token = await bench.confirmed(PIN, SATO)
        assert bench.take(token) == ConfirmedBy("M. Sato", "", "pin")
        assert bench.take(token) is None

    with_operator(tmp_path, work)


@pytest.mark.parametrize(
    "other", [{"session": "another"}, {"widget": "stop"}, {"inputs": "of another press"}]
)
def test_it_is_not_for_another_press(tmp_path: Path, other: dict[str, str]) -> None:
    async def work(bench: Bench) -> None:
        token = await bench.confirmed(PIN, SATO)
        assert bench.take(token, **other) is None
        assert bench.take(token) is None  # who tried it has used it up

    with_operator(tmp_path, work)


@pytest.mark.parametrize(("after_s", "counts"), [(VALID_S, True), (VALID_S + 0.1, False)])
def test_it_is_for_half_a_minute(tmp_path: Path, after_s: float, counts: bool) -> None:
    async def work(bench: Bench) -> None:
        token = await bench.confirmed(PIN, SATO)
        bench.now += after_s
        assert (bench.take(token) is not None) == counts

    with_operator(tmp_path, work)


def test_the_second_person_is_named_beside_the_first(tmp_path: Path) -> None:
    async def work(bench: Bench) -> None:
        token = await bench.confirmed(TWO, NOVAK)
        assert bench.take(token) == ConfirmedBy("M. Sato", "K. Novak", "password")

    with_operator(tmp_path, work)


@pytest.mark.parametrize(
    ("attempt", "code"),
    [
        (SATO, "confirm_same_person"),
        (Attempt("", "badge", "04A2"), "confirm_same_person"),  # known only when the badge is read
        (pin("V. Iewer", "1111"), "confirm_second_role"),
        (pin("Gone", "2580"), "confirm_wrong_pin"),
    ],
)
def test_a_second_person_is_another_one_who_may_press_it(
    tmp_path: Path, attempt: Attempt, code: str
) -> None:
    async def work(bench: Bench) -> None:
        assert await bench.confirmed(TWO, attempt) == f"refused: {code}"

    with_operator(tmp_path, work)


def test_a_user_whose_rights_have_changed_has_confirmed_nothing(tmp_path: Path) -> None:
    async def work(bench: Bench) -> None:
        token = await bench.confirmed(TWO, NOVAK)

        def disabled(users: UserBook) -> UserBook:
            changed = (replace(user, disabled=user.name == "K. Novak") for user in users.users)
            return replace(users, users=tuple(changed))

        await bench.access.edit(disabled)
        assert bench.take(token) is None

    with_operator(tmp_path, work)


def test_who_may_not_press_it_can_not_confirm_it(tmp_path: Path) -> None:
    async def work(bench: Bench) -> None:
        need = replace(PIN, needs=frozenset({ENGINEER}))
        assert (await bench.confirmed(need, SATO)).startswith("refused: ")
        program = replace(bench.who, program=True)
        checked, token = await bench.confirmer.confirm(program, bench.session, PIN, SATO)
        assert (checked.user, token) == (None, "")
        none, token = await bench.confirmer.confirm(bench.who, None, PIN, SATO)
        assert (none.user, token) == (None, "")

    with_operator(tmp_path, work)


def test_a_wrong_pin_confirms_nothing_and_is_in_the_log(tmp_path: Path) -> None:
    async def work(bench: Bench) -> None:
        assert (await bench.confirmed(PIN, pin("M. Sato", "0000"))).startswith("refused: ")
        reasons = [entry.reason_text for entry in bench.log.entries]
        assert any(isinstance(reason, Text) for reason in reasons)

    with_operator(tmp_path, work)


def test_who_can_sign_in_is_enabled_and_has_a_way(tmp_path: Path) -> None:
    async def work(bench: Bench) -> None:
        able = {person.user: person.role for person in able_users(bench.access)}
        assert able == {"M. Sato": OPERATOR, "K. Novak": MAINTENANCE, "V. Iewer": VIEWER}

    with_operator(tmp_path, work)

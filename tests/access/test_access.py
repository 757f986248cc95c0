"""Who a client is, and sign-ins: with users, without, with a broken file."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from app.access.access import Access, Attempt
from app.access.secrets_hash import SMALL, Cost, badge_hash, hashed, token_hash
from app.access.users import ApiToken, User, UserBook
from app.access.users_file import UsersFile
from app.audit.entry import Entry, Origin
from app.errors import TooMany
from app.i18n import Text, TextLike
from app.panel.rules import AccessRules
from app.permission.clients import Client
from app.roles import ENGINEER, MAINTENANCE, OPERATOR, VIEWER

QUICK = Cost(8, 1)
CELL = Client("c0ffee", "127.0.0.1", True, 1)
TABLET = Client("badcafe", "10.0.0.9", False, 1)
PROGRAM = Client("", "10.0.0.9", False, 0)


@dataclass
class KeptLog:
    """An operator's log that keeps its entries in memory."""

    entries: list[Entry] = field(default_factory=list)
    room: bool = True
    suppressed: int = 0

    def add(self, entry: Entry) -> None:
        self.entries.append(entry)

    def allowed(self, origin: Origin) -> bool:
        return self.room

    def suppress(self, origin: Origin, limited: bool = False) -> None:
        self.suppressed += 1

    async def closed(self, entry: Entry) -> TextLike:
        self.entries.append(entry)
        return ""

    @property
    def codes(self) -> list[str]:
        texts = [entry.reason_text for entry in self.entries]
        return [text.code if isinstance(text, Text) else text for text in texts]


def book() -> UserBook:
    empty = UserBook()
    users = (
        User(
            "M. Sato", OPERATOR, pin=hashed("2580", QUICK), badge=badge_hash("04A2", empty.badge_salt)
        ),
        User("K. Novak", MAINTENANCE, ("quality",), password=hashed("long enough", QUICK)),
        User("Gone", ENGINEER, pin=hashed("2580", QUICK), disabled=True),
    )
    tokens = (ApiToken("line", OPERATOR, token_hash("opt_line")),)
    return replace(empty, users=users, tokens=tokens)


Work = Callable[[Access, KeptLog], Awaitable[None]]


def run(
    folder: Path, work: Work, users: UserBook | None = None, cost: Cost = QUICK, **rules: object
) -> KeptLog:
    """Runs with an access of this folder, whose file has these users."""

    async def opened() -> KeptLog:
        log = KeptLog()
        file = UsersFile(folder)
        if users is not None:
            file.edit(lambda _: users)
        access = Access(file, AccessRules.model_validate(rules), log, cost=cost)
        try:
            await access.reload()
            await work(access, log)
        finally:
            access.close()
        return log

    return asyncio.run(opened())


def pin(name: str, secret: str) -> Attempt:
    return Attempt(name, "pin", secret)


def test_without_users_everybody_is_an_engineer(tmp_path: Path) -> None:
    async def work(access: Access, log: KeptLog) -> None:
        for client in (CELL, TABLET, PROGRAM):
            assert access.principal(client).role == ENGINEER
        assert access.principal(PROGRAM, bearer="anything").role == ENGINEER

    run(tmp_path, work)


def test_a_panel_that_is_not_open_has_viewers_only_until_there_are_users(tmp_path: Path) -> None:
    async def work(access: Access, log: KeptLog) -> None:
        assert access.principal(CELL).role == VIEWER

    run(tmp_path, work, open=False)


def test_with_users_nobody_signed_in_is_a_viewer(tmp_path: Path) -> None:
    async def work(access: Access, log: KeptLog) -> None:
        for client in (CELL, TABLET, PROGRAM):
            assert (access.principal(client).role, access.principal(client).user) == (VIEWER, "")

    run(tmp_path, work, book())


def test_a_signed_in_user_has_name_role_and_groups(tmp_path: Path) -> None:
    async def work(access: Access, log: KeptLog) -> None:
        _, session = await access.sign_in(CELL, Attempt("k. novak", "password", "long enough"))
        assert session is not None
        who = access.principal(CELL, session.id)
        assert (who.user, who.role, who.groups) == ("K. Novak", MAINTENANCE, frozenset({"quality"}))
        assert access.principal(TABLET, session.id).role == VIEWER

    assert run(tmp_path, work, book()).codes == ["log_signed_in_password"]


@pytest.mark.parametrize(
    ("attempt", "code"),
    [
        (pin("M. Sato", "2581"), "sign_in_wrong_pin"),
        (pin("Nobody", "2580"), "sign_in_wrong_pin"),
        (pin("Gone", "2580"), "sign_in_wrong_pin"),
        (pin("K. Novak", "2580"), "sign_in_wrong_pin"),
        (Attempt("M. Sato", "password", "2580"), "sign_in_wrong_password"),
        (Attempt("", "badge", "04A3"), "sign_in_wrong_badge"),
        (Attempt("K. Novak", "badge", "04A2"), "sign_in_wrong_badge"),
    ],
)
def test_a_wrong_sign_in_says_the_same_for_every_user(
    tmp_path: Path, attempt: Attempt, code: str
) -> None:
    async def work(access: Access, log: KeptLog) -> None:
        checked, session = await access.sign_in(CELL, attempt)
        assert (checked.code, checked.tries_left, session) == (code, 4, None)

    log = run(tmp_path, work, book())
    assert log.codes == [code]
    assert attempt.secret not in str(log.entries)


def test_a_badge_says_who_it_is(tmp_path: Path) -> None:
    async def work(access: Access, log: KeptLog) -> None:
        checked, session = await access.sign_in(CELL, Attempt("", "badge", "04A2"))
        assert session is not None
        assert checked.user is not None
        assert checked.user.name == "M. Sato"

    run(tmp_path, work, book())


def test_after_five_failures_the_correct_pin_waits_too(tmp_path: Path) -> None:
    async def work(access: Access, log: KeptLog) -> None:
        for _ in range(5):
            await access.check(TABLET, pin("M. Sato", "0000"))
        late = await access.check(TABLET, pin("M. Sato", "2580"))
        assert (late.user, late.code, late.wait_s) == (None, "sign_in_wait", 30)
        assert (await access.check(CELL, pin("M. Sato", "2580"))).user is not None

    run(tmp_path, work, book())


def test_failures_over_the_quota_of_refusals_have_no_entry(tmp_path: Path) -> None:
    async def work(access: Access, log: KeptLog) -> None:
        log.room = False
        await access.check(CELL, pin("M. Sato", "0000"))

    log = run(tmp_path, work, book())
    assert (log.entries, log.suppressed) == ([], 1)


def test_too_many_sign_ins_at_once_are_refused_for_others_and_not_for_the_cell(tmp_path: Path) -> None:
    async def work(access: Access, log: KeptLog) -> None:
        for number in range(10):
            await access.check(replace(TABLET, address=f"10.0.{number}.1"), pin("M. Sato", "0000"))
        with pytest.raises(TooMany):
            await access.check(TABLET, pin("M. Sato", "0000"))
        assert (await access.check(CELL, pin("M. Sato", "2580"))).user is not None

    run(tmp_path, work, book())


def test_a_hand_over_ends_the_session_of_the_user_before(tmp_path: Path) -> None:
    async def work(access: Access, log: KeptLog) -> None:
        _, first = await access.sign_in(CELL, pin("M. Sato", "2580"))
        _, second = await access.sign_in(CELL, Attempt("K. Novak", "password", "long enough"))
        assert first
        assert second
        assert access.principal(CELL, first.id).role == VIEWER
        assert access.principal(CELL, second.id).user == "K. Novak"

    assert run(tmp_path, work, book()).codes == [
        "log_signed_in_pin",
        "log_signed_out_hand_over",
        "log_signed_in_password",
    ]


@pytest.mark.parametrize("change", ["role", "disable", "pin", "remove"])
def test_a_changed_user_is_signed_out(tmp_path: Path, change: str) -> None:
    def edit(users: UserBook) -> UserBook:
        sato = users.user("M. Sato")
        assert sato is not None
        changed = {
            "role": replace(sato, role=VIEWER),
            "disable": replace(sato, disabled=True),
            "pin": replace(sato, pin="another"),
        }
        return (
            users.with_user(changed[change], "") if change in changed else users.without_user(sato.name)
        )

    async def work(access: Access, log: KeptLog) -> None:
        _, session = await access.sign_in(CELL, pin("M. Sato", "2580"))
        ended = []
        access.on_end(lambda over, reason: ended.append((over, reason)))
        access.file.edit(edit)
        await access.reload()
        assert session
        assert ended == [(session, "changed")]
        assert access.principal(CELL, session.id).role == VIEWER

    run(tmp_path, work, book())


def test_a_broken_file_signs_everybody_out_and_says_why(tmp_path: Path) -> None:
    async def work(access: Access, log: KeptLog) -> None:
        _, session = await access.sign_in(CELL, pin("M. Sato", "2580"))
        access.file.path.write_text("{")
        await access.reload()
        assert session
        assert access.principal(CELL, session.id).role == VIEWER
        assert access.principal(PROGRAM, bearer="opt_line").role == VIEWER
        checked = await access.check(CELL, pin("M. Sato", "2580"))
        assert checked.code == "users_unreadable"
        assert str(access.file.path) in str(checked.reason)
        access.file.path.unlink()
        await access.reload()
        assert access.principal(CELL).role == ENGINEER  # no file: no users

    run(tmp_path, work, book())


def test_users_elsewhere_have_at_most_the_role_that_the_panel_allows(tmp_path: Path) -> None:
    async def work(access: Access, log: KeptLog) -> None:
        attempt = Attempt("K. Novak", "password", "long enough")
        for client, role in ((TABLET, OPERATOR), (CELL, MAINTENANCE)):
            _, session = await access.sign_in(client, attempt)
            assert session
            assert access.principal(client, session.id).role == role

    run(tmp_path, work, book(), remote="operator")


def test_a_token_has_its_role_and_name(tmp_path: Path) -> None:
    async def work(access: Access, log: KeptLog) -> None:
        who = access.principal(PROGRAM, bearer="opt_line")
        assert (who.user, who.role, access.knows("opt_line")) == ("line", OPERATOR, True)
        assert who.client.id
        assert "opt_line" not in repr(who)
        assert (access.principal(PROGRAM, bearer="opt_no").role, access.knows("opt_no")) == (
            VIEWER,
            False,
        )
        allowed = [access.admit_token("opt_line") for _ in range(400)]
        assert 100 <= sum(allowed) < 400

    run(tmp_path, work, book())


def test_each_change_of_users_is_logged_once_over_restarts(tmp_path: Path) -> None:
    async def nothing(access: Access, log: KeptLog) -> None:
        await access.reload()

    noted = book().noted("2026-11-27T08:00:00", "add", "M. Sato", "operator", "root")
    assert run(tmp_path, nothing, noted).codes == ["log_users_add"]
    assert run(tmp_path, nothing).codes == []
    UsersFile(tmp_path).edit(lambda users: users.noted("later", "role", "M. Sato", "viewer", "root"))
    assert run(tmp_path, nothing).codes == ["log_users_role"]


def test_an_unknown_user_takes_as_long_as_a_known_one(tmp_path: Path) -> None:
    """Compares processor time, which other tests do not change: each hashes once."""

    async def work(access: Access, log: KeptLog) -> None:
        spent = {}
        for name in ("M. Sato", "Nobody"):
            before = time.process_time()
            await access.check(CELL, pin(name, "0000"))
            spent[name] = time.process_time() - before
        assert spent["M. Sato"] / 3 < spent["Nobody"] < 3 * spent["M. Sato"]

    user = User("M. Sato", OPERATOR, pin=hashed("2580", SMALL))
    run(tmp_path, work, replace(book(), users=(user,)), SMALL)

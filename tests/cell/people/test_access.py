"""Who a client is, and sign-ins: with users, without, with a broken file."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from app.cell.people.access import Access, Attempt, SignInDelays
from app.cell.people.oidc import ExternalUser
from app.cell.people.secrets_hash import SMALL, Cost, badge_hash, hashed, token_hash
from app.cell.people.sessions import MOST_OF_USER
from app.cell.people.users import ApiToken, User, UserBook
from app.cell.people.users_file import UsersFile, users_configured
from app.panel.roles import ENGINEER, MAINTENANCE, OPERATOR, VIEWER
from app.panel.rules import AccessRules
from app.records.entry import Entry, Origin
from app.records.principal import Client
from app.system.errors import TooMany
from app.system.texts import Text, TextLike, say
from app.tools.cli.users import main

pytestmark = pytest.mark.promise("users")

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


def test_own_sign_ins_are_those_of_the_same_user_and_of_no_namesake(tmp_path: Path) -> None:
    """A program's token and a user of the plant's provider may have the name of a user."""
    name = "oidc:M. Sato"
    namesake = User(name, OPERATOR, pin=hashed("2580", QUICK))
    users = replace(
        book(),
        users=(*book().users, namesake),
        tokens=(ApiToken("M. Sato", OPERATOR, token_hash("opt_sato")),),
    )
    third, provided = (replace(CELL, id=f"cell{n}", number=n) for n in (3, 4))

    async def work(access: Access, log: KeptLog) -> None:
        def own(client: Client, session_id: str = "", bearer: str = "") -> list[str]:
            sessions = access.own_sessions(access.principal(client, session_id, bearer))
            return [session.client.id for session in sessions]

        clients = (CELL, replace(CELL, id="cell2", number=2), third)
        names = ("M. Sato", "M. Sato", name)
        ids = []
        for client, user in zip(clients, names, strict=True):
            _, session = await access.sign_in(client, pin(user, "2580"))
            assert session
            ids.append(session.id)
        external = access.sign_in_external(provided, ExternalUser(name, ENGINEER, frozenset(), ""))
        assert own(CELL, ids[0]) == own(clients[1], ids[1]) == ["c0ffee", "cell2"]
        assert own(third, ids[2]) == ["cell3"]
        assert own(provided, external.id) == ["cell4"]
        assert own(CELL) == own(TABLET) == own(TABLET, ids[0]) == []
        assert own(PROGRAM, bearer="opt_sato") == own(CELL, ids[0], "opt_sato") == []

    run(tmp_path, work, users)


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
        left = 4 if attempt.name else 0
        assert (checked.code, checked.tries_left, session) == (code, left, None)

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

    run(tmp_path, work, book(), pin="anywhere")


def test_a_pin_is_taken_at_the_panel_only_unless_its_file_permits_it_anywhere(tmp_path: Path) -> None:
    async def work(access: Access, log: KeptLog) -> None:
        for _ in range(8):
            elsewhere = await access.check(TABLET, pin("M. Sato", "2580"))
            assert (elsewhere.user, elsewhere.code) == (None, "sign_in_pin_here")
        for client, attempt in (
            (CELL, pin("M. Sato", "2580")),
            (TABLET, Attempt("K. Novak", "password", "long enough")),
            (TABLET, Attempt("", "badge", "04A2")),
        ):
            assert (await access.check(client, attempt)).user is not None

    run(tmp_path, work, book())


def test_whose_password_is_tried_elsewhere_is_named_only_if_there_is_such_a_user(
    tmp_path: Path,
) -> None:
    async def work(access: Access, log: KeptLog) -> None:
        assert access.guessed is None
        for name, named in (("m. sato", "M. Sato"), ("2580", "")):
            for number in range(30):
                access.delays.failed(name, f"10.0.0.{number}", False)
            guessed = access.guessed
            assert guessed
            assert (guessed.user, len(guessed.addresses)) == (named, 20)
            access.delays = SignInDelays()

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

    run(tmp_path, work, book(), pin="anywhere")


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

    run(tmp_path, work, book())


@pytest.mark.parametrize("empty", [None, "", '{"version": 1, "badge_salt": "' + 32 * "0" + '"}'])
def test_users_that_vanish_lock_the_panel_over_restarts_until_somebody_opens_it(
    tmp_path: Path, empty: str | None
) -> None:
    async def vanish(access: Access, log: KeptLog) -> None:
        _, session = await access.sign_in(CELL, pin("M. Sato", "2580"))
        access.file.path.unlink()
        if empty is not None:
            access.file.path.write_text(empty)
            access.file.path.chmod(0o600)
        await access.reload()
        assert session
        assert access.principal(CELL, session.id).role == access.principal(CELL).role == VIEWER
        assert (await access.check(CELL, pin("M. Sato", "2580"))).code == "users_unreadable"
        assert access.fault

    async def locked(access: Access, log: KeptLog) -> None:
        assert access.principal(CELL).role == VIEWER
        assert users_configured(tmp_path)

    async def opened(access: Access, log: KeptLog) -> None:
        assert access.principal(CELL).role == ENGINEER
        assert not users_configured(tmp_path)

    codes = run(tmp_path, vanish, book()).codes
    assert codes == [
        "log_signed_in_pin",
        "users_unreadable" if empty == "" else "users_lost",
        "log_signed_out_changed",
    ]
    assert run(tmp_path, locked).codes == codes[1:2]
    if empty == "":
        return  # it is no file of users: it has to be removed first
    assert main(["open", "--data", str(tmp_path)]) == 0
    assert run(tmp_path, opened).codes == ["log_users_open"]


def test_a_users_file_that_is_made_again_is_logged_from_its_first_change(tmp_path: Path) -> None:
    async def nothing(access: Access, log: KeptLog) -> None:
        assert not access.fault

    def noted(users: UserBook) -> UserBook:
        return users.with_change("now", "add", "M. Sato", "operator", "root")

    run(tmp_path, nothing, noted(noted(book())))
    UsersFile(tmp_path).path.unlink()
    assert run(tmp_path, nothing, noted(book())).codes == ["log_users_add"]


def test_the_sessions_of_a_user_are_limited_and_push_out_nobody_elses(tmp_path: Path) -> None:
    async def work(access: Access, log: KeptLog) -> None:
        _, novak = await access.sign_in(CELL, Attempt("K. Novak", "password", "long enough"))
        ended: list[tuple[int, str]] = []
        access.on_end(lambda over, reason: ended.append((over.client.number, reason)))
        for number in range(2, MOST_OF_USER + 5):
            browser = Client(f"{number:x}", "127.0.0.1", True, number)
            await access.sign_in(browser, pin("M. Sato", "2580"))
        assert ended == [(2, "limit"), (3, "limit"), (4, "limit")]
        assert not access.end_reason(browser)
        assert novak
        assert access.principal(CELL, novak.id).user == "K. Novak"
        pushed_out = Client("2", "127.0.0.1", True, 2)
        assert access.end_reason(pushed_out) == say("signin_ended_limit")
        await access.sign_in(pushed_out, pin("M. Sato", "2580"))
        assert access.end_reason(pushed_out) == ""

    assert run(tmp_path, work, book()).codes.count("log_signed_out_limit") == 4


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

    noted = book().with_change("2026-11-27T08:00:00", "add", "M. Sato", "operator", "root")
    assert run(tmp_path, nothing, noted).codes == ["log_users_add"]
    assert run(tmp_path, nothing).codes == []
    UsersFile(tmp_path).edit(
        lambda users: users.with_change("later", "role", "M. Sato", "viewer", "root")
    )
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

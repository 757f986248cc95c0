"""Acts of the page of users: add, change, disable and remove users, make and revoke tokens, end
sign-ins.

`ActRequest.object` is the name of a user or token, `secrets` what signs in, which is neither logged nor
kept. `values` has the `role`, the `groups`, and the `version` that the screen showed: a change that was
made since, by the command line or another browser, is not overwritten.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from typing import Any, Final, NamedTuple

from app.cell.commands.acts import Act, ActRequest, Applied, Finish, server_permits
from app.cell.people.access import Access
from app.cell.people.edits import (
    add_token,
    add_user,
    hashes_of,
    keeps_engineer,
    remove_user,
    revoke_token,
    set_disabled,
    set_role,
    set_secrets,
)
from app.cell.people.secrets_hash import WAYS, Cost, Way, fault_of, token_hash
from app.cell.people.users import UserBook, UsersError
from app.cell.permission.roles import role_verdict
from app.cell.permission.verdict import Verdict
from app.panel.roles import ANYBODY, ENGINEER
from app.records.press_record import origin_of
from app.system.errors import os_error_text
from app.system.texts import Text, TextLike, say

TOKEN: Final = "token"
END: Final = "end"
REMOVED: Final = "removed"


class Planned(NamedTuple):
    """What a change is made of: its request, the cost of a hash, and the time in ISO 8601."""

    request: ActRequest
    cost: Cost
    now: str

    @property
    def name(self) -> str:
        return self.request.object

    @property
    def secrets(self) -> dict[Way, str]:
        return {way: self.request.secrets[way] for way in WAYS if self.request.secrets.get(way)}

    def hashes(self, book: UserBook) -> dict[Way, str]:
        return hashes_of(self.secrets, book, self.name, self.cost)

    def value(self, name: str) -> Any:
        return self.request.values.get(name)


Plan = Callable[[UserBook, Planned], UserBook]


@dataclass(slots=True)
class _Log:
    """Why the entry of a change is not on the disk, "" if it is."""

    fault: TextLike = ""


def _changes(
    plan: Plan, detail: Callable[[ActRequest], str], code: str
) -> Callable[[Access, ActRequest], Applied]:
    """`Act.apply` from a change of the users' file. `detail` says in the log what changed, `code` is
    the sentence of the receipt."""

    def apply(access: Access, request: ActRequest) -> Applied:
        refusal = _refusal(access, request)
        if refusal is not None:
            return Applied(refusal)
        now = datetime.now(UTC).isoformat(timespec="seconds")
        planned, origin = Planned(request, access.checker.cost, now), origin_of(request.who)

        def edit(book: UserBook) -> UserBook:
            version = request.values.get("version")
            if version is not None and book.version(request.object) > version:
                raise UsersError(say("users_changed_since", name=request.object))
            after = keeps_engineer(book, plan(book, planned))
            about = (now, request.act, request.object, detail(request), origin.who)
            return after.with_change(*about, origin.address, origin.browser)

        log = _Log()
        return Applied(
            finish=_finish(access, edit, log),
            fails_by="interlock",
            note=say(code, name=request.object),
            logged=lambda: log.fault,
        )

    return apply


def _finish(access: Access, edit: Callable[[UserBook], UserBook], log: _Log) -> Finish:
    async def finish() -> Text | None:
        try:
            log.fault = await access.edit(edit)
        except UsersError as error:
            text = error.text
            return text if isinstance(text, Text) else say("users_not_written", why=text)
        except OSError as error:
            return say("users_not_written", why=os_error_text(error))
        return None

    return finish


def _refusal(access: Access, request: ActRequest) -> Text | None:
    """What is wrong with a request by itself."""
    if not access.configured and not request.who.client.local:
        return say("users_first_here")
    for way in WAYS:
        secret = request.secrets.get(way, "")
        if secret and (fault := fault_of(way, secret)):
            return fault
    return None


def _set_secret(way: Way, book: UserBook, planned: Planned) -> UserBook:
    hashes = planned.hashes(book)
    if way not in hashes and planned.value("none") is not True:
        raise UsersError(say("users_secret_missing"))
    return set_secrets(book, planned.name, {way: hashes.get(way, "")}, planned.now)


def _role_of(request: ActRequest) -> str:
    return ", ".join((request.values.get("role", ""), *(request.values.get("groups") or ())))


def _secret_of(request: ActRequest) -> str:
    return "changed" if any(request.secrets.get(way) for way in WAYS) else REMOVED


def _end_session(access: Access, request: ActRequest) -> Applied:
    """`request.object` is the handle of a session."""
    session = access.sessions.of_handle(request.object)
    if session is None:
        return Applied(say("users_session_gone"))
    access.end(session, request.who)
    return Applied(note=say("users_done_end", name=session.user, where=session.client.address))


def end_lock(access: Access, request: ActRequest) -> Verdict | None:
    """Why a client may not end a sign-in, None if it may: everyone ends their own, an engineer all."""
    session = access.sessions.of_handle(request.object) if request.act == END else None
    if session is None or session in access.own_sessions(request.who):
        return None
    return role_verdict({ENGINEER}, request.who)


def _row(plan: Plan, detail: Callable[[ActRequest], str], code: str) -> Act[Access, Applied]:
    # A change that was made has its entry by the file, which also has those of the command line.
    # The word of such an act is that of its change, in `app/cell/people/access_log.py`.
    return Act("", server_permits, _changes(plan, detail, code), lambda applied: applied.note, ENGINEER)


SECRET_DONE: Final[Mapping[Way, str]] = {
    "pin": "users_done_pin",
    "password": "users_done_password",
    "badge": "users_done_badge",
}
USER_ACTS: Final[Mapping[str, Act[Access, Applied]]] = {
    "add": _row(
        lambda book, p: add_user(
            book, p.name, p.value("role") or "", p.value("groups") or (), p.hashes(book), p.now
        ),
        _role_of,
        "users_done_add",
    ),
    "role": _row(
        lambda book, p: set_role(book, p.name, p.value("role") or "", p.value("groups"), p.now),
        _role_of,
        "users_done_role",
    ),
    **{way: _row(partial(_set_secret, way), _secret_of, SECRET_DONE[way]) for way in WAYS},
    "disable": _row(
        lambda book, p: set_disabled(book, p.name, True, p.now),
        lambda request: request.act,
        "users_done_disable",
    ),
    "enable": _row(
        lambda book, p: set_disabled(book, p.name, False, p.now),
        lambda request: request.act,
        "users_done_enable",
    ),
    "remove": _row(
        lambda book, p: remove_user(book, p.name), lambda _: "with all rights", "users_done_remove"
    ),
    TOKEN: _row(
        lambda book, p: add_token(
            book, p.name, p.value("role") or "", token_hash(p.request.secrets[TOKEN]), p.now
        ),
        _role_of,
        "users_done_token",
    ),
    "revoke": _row(
        lambda book, p: revoke_token(book, p.name), lambda _: "revoked", "users_done_revoke"
    ),
    # No change of the users' file: its entry is the act's own, beside that of the sign-out. Whose
    # sign-in it may be says `end_lock`.
    END: Act("", server_permits, _end_session, lambda applied: applied.note, ANYBODY),
}

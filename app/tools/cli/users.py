"""`operator-panel users`: users, roles and tokens of programs, in the data folder.

A running server takes a change within a second. Exit status: 0 done, 1 refused, 2 the data folder or
its users' file can't be used. Secrets come from standard input only.
"""

import getpass
import json
import os
import sys
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from functools import partial
from typing import Any, Final

from app.cell.people.edits import (
    add_token,
    add_user,
    hashes_of,
    open_panel,
    remove_user,
    revoke_token,
    set_disabled,
    set_role,
    set_secrets,
    tokens_json,
    users_json,
)
from app.cell.people.secrets_hash import (
    LONGEST,
    WAYS,
    Way,
    cost_of_machine,
    fault_of,
    memory_of_machine,
    new_api_token,
    token_hash,
)
from app.cell.people.users import OPEN, UserBook, UsersError, check_group, check_name
from app.cell.people.users_file import UsersFile, is_lost, read_state
from app.panel.roles import ROLES
from app.system.errors import KioskError
from app.system.texts import say
from app.tools.cli.arguments import add_data_folder, data_folder
from app.tools.cli.parser import Parser

PROG: Final = "python -m app.cli users"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    try:
        file = UsersFile(data_folder(options))
    except (KioskError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    try:
        status: int = options.run(options, file)
    except UsersError as error:
        print(error, file=sys.stderr)
        return 1
    except OSError as error:
        print(f"{file.path}: {error.strerror or error}", file=sys.stderr)
        return 2
    return status


def _change(options: Any, file: UsersFile, edit: Callable[[UserBook], UserBook], detail: str) -> None:
    """Changes the file, with the change for the operator's log."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    act, name, by = options.act, options.name, os.environ.get("SUDO_USER") or getpass.getuser()
    file.edit(lambda book: edit(book).with_change(now, act, name, detail, by))


def _secrets(options: Any) -> dict[Way, str]:
    """The secrets that the options name, a line of standard input each, in the order of `WAYS`."""
    secrets: dict[Way, str] = {}
    for way in WAYS:
        if not getattr(options, f"{way}_stdin", False):
            continue
        prompt = f"{way}: "
        if sys.stdin.isatty():
            line = getpass.getpass(prompt)
        else:
            line = sys.stdin.readline(4 * LONGEST).rstrip("\r\n")
        if fault := fault_of(way, line):
            raise UsersError(fault)
        secrets[way] = line
    return secrets


def _hashes(secrets: dict[Way, str], book: UserBook, name: str) -> dict[Way, str]:
    return hashes_of(secrets, book, name, cost_of_machine(memory_of_machine()))


def _add(options: Any, file: UsersFile) -> int:
    name, groups = check_name(options.name), tuple(map(check_group, options.group))
    secrets = _secrets(options)
    if not secrets:
        raise UsersError(
            "a user needs a PIN, a password or a badge: --pin-stdin, --password-stdin or --badge-stdin"
        )

    def edit(book: UserBook) -> UserBook:
        hashes = _hashes(secrets, book, name)
        return add_user(book, name, options.role, groups, hashes, _now())

    _change(options, file, edit, ", ".join((options.role, *groups)))
    print(f'"{name}" can sign in as {options.role} with {" or ".join(secrets)}')
    return 0


def _role(options: Any, file: UsersFile) -> int:
    groups = None if options.group is None else tuple(map(check_group, filter(None, options.group)))

    def edit(book: UserBook) -> UserBook:
        return set_role(book, options.name, options.role, groups, _now())

    _change(options, file, edit, ", ".join((options.role, *(groups or ()))))
    return 0


def _secret(way: Way, options: Any, file: UsersFile) -> int:
    if options.none:
        secrets: dict[Way, str] = {}
    else:
        setattr(options, f"{way}_stdin", True)
        secrets = _secrets(options)

    def edit(book: UserBook) -> UserBook:
        hashes = _hashes(secrets, book, options.name) or {way: ""}
        return set_secrets(book, options.name, hashes, _now())

    _change(options, file, edit, "removed" if options.none else "changed")
    return 0


def _disabled(disabled: bool, options: Any, file: UsersFile) -> int:
    _change(options, file, lambda book: set_disabled(book, options.name, disabled, _now()), options.act)
    return 0


def _remove(options: Any, file: UsersFile) -> int:
    _change(options, file, lambda book: remove_user(book, options.name), "with all rights")
    return 0


def _open(options: Any, file: UsersFile) -> int:
    book = file.read()
    gone = f"{len(book.users)} users and {len(book.tokens)} tokens"
    if (book.users or book.tokens) and not options.yes:
        raise UsersError(f"this removes {gone}, and everyone may do everything then: --yes if so")
    _change(options, file, open_panel, f"{gone} removed")
    print("the panel has no users: everyone at it may do everything")
    return 0


def _list(options: Any, file: UsersFile) -> int:
    book, state = file.read(), read_state(file.folder)
    if is_lost(book, state.configured):
        raise UsersError(say("users_lost", path=str(file.path)))
    rows = users_json(book, state.last)
    if options.json:
        print(json.dumps(rows, ensure_ascii=False, indent=1))
        return 0
    for row in rows:
        groups = f" ({', '.join(row['groups'])})" if row["groups"] else ""
        off = ", disabled" if row["disabled"] else ""
        ways, last = " or ".join(row["signs_in_with"]), row["last_sign_in"] or "never"
        print(f"{row['name']}: {row['role']}{groups}, {ways}{off}, last sign-in {last}")
    if not rows:
        print(f"no users in {file.folder}: everyone at this machine may do everything")
    return 0


def _token(options: Any, file: UsersFile) -> int:
    name, token = check_name(options.name, "token"), new_api_token()

    def edit(book: UserBook) -> UserBook:
        return add_token(book, name, options.role, token_hash(token), _now())

    _change(options, file, edit, options.role)
    print(token)
    print("this token is shown only now: Authorization: Bearer <token>", file=sys.stderr)
    return 0


def _tokens(options: Any, file: UsersFile) -> int:
    rows = tokens_json(file.read(), read_state(file.folder).last)
    if options.json:
        print(json.dumps(rows, ensure_ascii=False, indent=1))
        return 0
    for row in rows:
        print(f"{row['name']}: {row['role']}, last used {row['last_used'] or 'never'}")
    return 0


def _revoke(options: Any, file: UsersFile) -> int:
    _change(options, file, lambda book: revoke_token(book, options.name), "revoked")
    return 0


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog, description="The users of a panel. Secrets are read from standard input."
    )
    commands = parser.add_subparsers(metavar="COMMAND", required=True)

    def add(act: str, about: str, run: Callable[[Any, UsersFile], int], name: str = "NAME") -> Parser:
        command: Parser = commands.add_parser(act, help=about)
        if name:
            command.add_argument("name", metavar=name, help="as it is shown, and typed at a sign-in")
        add_data_folder(command)
        command.set_defaults(run=run, act=act)
        return command

    added = add("add", "add a user", _add)
    roles = add("role", "change a user's role and groups", _role)
    tokens = add("token", "make a token for a program, and print it once", _token)
    for command in (added, roles, tokens):
        command.add_argument("--role", choices=ROLES, required=True)
    added.add_argument("--group", action="append", default=[], help="a group of [access]; repeatable")
    roles.add_argument("--group", action="append", help='instead of the groups so far; "" for none')
    for way in WAYS:
        added.add_argument(f"--{way}-stdin", action="store_true", help=f"the next line is the {way}")
        changed = add(way, f"change a user's {way}, from standard input", partial(_secret, way))
        changed.add_argument("--none", action="store_true", help=f"no {way} any more")
    add("disable", "a user can't sign in, and is signed out", partial(_disabled, True))
    add("enable", "a disabled user can sign in again", partial(_disabled, False))
    add("remove", "remove a user", _remove)
    add("revoke", "remove a token", _revoke)
    opened = add(OPEN, "open the panel for everyone: no users and no tokens", _open, "")
    opened.add_argument("--yes", action="store_true", help="also if there are users or tokens")
    opened.set_defaults(name="")
    for act, about, run in (("list", "list the users", _list), ("tokens", "list the tokens", _tokens)):
        add(act, about, run, "").add_argument("--json", action="store_true", help="as JSON")
    return parser

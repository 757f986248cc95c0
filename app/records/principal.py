"""Who presses: a client, which is a browser or a program, and the user who is signed in there."""

import hashlib
import re
import secrets
from dataclasses import dataclass
from functools import lru_cache
from ipaddress import IPv6Address, ip_address
from typing import Final

from app.panel.roles import ENGINEER, meets
from app.system.limits import BoundedDict
from app.system.texts import Text, TextLike, render, say

# The clients that press: one identity for each browser, by a random token that it keeps, with a short
# name.
#
# It distinguishes browsers, not operators: there are no users.

TOKEN: Final = re.compile(r"[0-9a-f]{32}")
BROWSERS_KEPT: Final = 500
# The code of a name → that of the same where it begins a sentence.
TITLES: Final = {
    "browser": "browser_title",
    "browser_local": "browser_local_title",
    "browser_more": "browser_more_title",
    "browser_unknown": "browser_unknown_title",
}


@dataclass(frozen=True, slots=True)
class Client:
    """`id` is public, the token that it is derived from is known to the browser only; "" for a client
    without a token. `local`: it runs on the kiosk's own machine. `number` distinguishes it
    from other such clients."""

    id: str
    address: str
    local: bool
    number: int

    @property
    def name(self) -> Text:
        """ "Panel 2"; "the panel at the cell"."""
        return say(self._code, number=self.number) if self.id else say(self._code)

    @property
    def title(self) -> Text:
        """The name at the begin of a sentence, with the address where it is of use."""
        return say(TITLES[self._code], number=self.number, address=self.address)

    @property
    def _code(self) -> str:
        if not self.id:
            return "browser_unknown"
        if self.local:
            return "browser_local" if self.number == 1 else "browser_more"
        return "browser"

    def __str__(self) -> str:
        return f"{render(self.name)} ({self.address})"


class Clients:
    """The known browsers, by their tokens; forgets those not seen for the longest time."""

    def __init__(self) -> None:
        self._known = BoundedDict[str, Client](BROWSERS_KEPT)

    def identify(self, token: str, address: str) -> Client:
        """The browser with this token, now at this address."""
        address, local = where(address)
        browser = self._known.get(token)
        if browser is None or (browser.address, browser.local) != (address, local):
            kept = browser is not None and browser.local == local
            number = browser.number if browser is not None and kept else self._free_number(local)
            browser = Client(public_id(token), address, local, number)
        self._known[token] = browser
        return browser

    def _free_number(self, local: bool) -> int:
        taken = {client.number for client in self._known.values() if client.local == local}
        return next(n for n in range(1, len(taken) + 2) if n not in taken)


def anonymous(address: str) -> Client:
    """The client of a request without a token that gets none: mostly a program."""
    address, local = where(address)
    return Client("", address, local, 0)


def new_client(token: str, address: str) -> Client:
    """The client of a token that is being given out; it gets its number when the browser returns with
    the token."""
    address, local = where(address)
    return Client(public_id(token), address, local, 0)


def new_token() -> str:
    return secrets.token_hex(16)


def public_id(token: str) -> str:
    """The public id of a token: stable across restarts; the token can't be derived from it."""
    return hashlib.sha256(token.encode()).hexdigest()[:12]


@lru_cache(BROWSERS_KEPT)
def where(address: str) -> tuple[str, bool]:
    """The address as it is shown, and whether it is this machine's."""
    try:
        parsed = ip_address(address.partition("%")[0])
    except ValueError:
        return render(say("unknown")), False  # as the log has it
    if isinstance(parsed, IPv6Address) and parsed.ipv4_mapped:
        parsed = parsed.ipv4_mapped
    return str(parsed), parsed.is_loopback


# Who presses: a client, and the user who is logged in there.


@dataclass(frozen=True, slots=True)
class Principal:
    """Who asks for something: permissions, limits and log entries are per principal.

    `client` is the browser or program. `user` is the name of the user who is signed in, "" for no one.
    `role` is one of `ROLES`, `groups` are the panel's own groups that the user is in. While there are
    no users, everyone is an engineer. `program`: it has a token, and no person is there.
    """

    client: Client
    user: str = ""
    role: str = ENGINEER
    groups: frozenset[str] = frozenset()
    program: bool = False

    def meets(self, needs: str) -> bool:
        """Whether this principal has the role or is in the group `needs`; "" needs nothing."""
        return meets(needs, self.role, self.groups)

    @property
    def name(self) -> TextLike:
        """As the operator's log names them: the user, else the client."""
        return self.user or self.client.name

    @property
    def title(self) -> TextLike:
        """The name at the start of a sentence."""
        return self.user or self.client.title

    def __str__(self) -> str:
        return f"{render(self.name)} ({self.client.address})"

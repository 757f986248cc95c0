"""Sign-ins by the plant's OpenID Connect provider, from the first request to the user's role.

Each sign-in that has begun has a state, a nonce and a verifier (PKCE) of its own, is for one browser,
and is used once. HTTP is spoken on threads of their own: the event loop waits for no provider.
"""

import asyncio
import logging
import secrets
import time
from collections import OrderedDict
from collections.abc import Callable, Collection, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Final, TypeVar

from app.access.oidc_provider import OidcError, OidcProvider
from app.errors import TooMany
from app.i18n import TextLike, say
from app.panel.oidc import OidcRules
from app.permission.client_places import client_key
from app.permission.clients import Client
from app.printable import printable
from app.rate_limit import Quota, TokenBuckets
from app.roles import ROLES

log = logging.getLogger("kiosk.access")

PREFIX: Final = "oidc:"  # stands before the name, in the operator's log too
LONGEST_NAME: Final = 60
LIFE_S: Final = 600.0  # for somebody to type a password there
BEGUN_KEPT: Final = 500
MOST_WAITING: Final = 8
BEGIN_QUOTA: Final = Quota(10, per_s=0.5)  # of each other machine
AGAIN_S: Final = 2

REASONS: Final = frozenset(
    {
        "oidc_away", "oidc_refused", "oidc_invalid", "oidc_no_role", "oidc_late", "oidc_secret",
        "oidc_not_installed", "oidc_weak",
    }
)  # fmt: skip
Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class ExternalUser:
    """A user whom the provider knows."""

    name: str
    role: str
    groups: frozenset[str]
    id_token: str = field(default="", repr=False)


@dataclass(frozen=True, slots=True)
class Begun:
    """A sign-in that has begun at a browser; `at` is monotonic seconds."""

    client: Client
    redirect_uri: str
    at: float
    state: str = field(default_factory=lambda: secrets.token_urlsafe(32), repr=False)
    nonce: str = field(default_factory=lambda: secrets.token_urlsafe(32), repr=False)
    verifier: str = field(default_factory=lambda: secrets.token_urlsafe(48), repr=False)


class OidcSignIns:
    """Used on the event loop only."""

    def __init__(
        self,
        rules: OidcRules,
        groups: Collection[str],
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        """`groups` are the panel's own."""
        self.rules = rules
        self.provider = OidcProvider(rules)
        self._groups = groups
        self._monotonic = monotonic
        self._begun: OrderedDict[str, Begun] = OrderedDict()
        self._threads = ThreadPoolExecutor(2, "oidc")
        self._quota = TokenBuckets(BEGIN_QUOTA, monotonic)
        self._waiting = 0

    async def begin(self, client: Client, redirect_uri: str) -> tuple[str, str]:
        """The provider's address for a browser, and the state of this sign-in. OidcError if the
        provider is away, TooMany for too many at once."""
        key = client_key(client.address)
        if not client.local:
            if not self._quota.has_token(key):
                raise TooMany(say("sign_in_busy"), AGAIN_S)
            self._quota.take_token(key)
        begun = Begun(client, redirect_uri, self._monotonic())
        url = await self._run(
            partial(
                self.provider.authorization_url,
                redirect_uri,
                begun.state,
                begun.nonce,
                begun.verifier,
            )
        )
        for other in [b for b in self._begun.values() if b.client.id == client.id]:
            del self._begun[other.state]
        self._begun[begun.state] = begun
        while len(self._begun) > BEGUN_KEPT:
            self._begun.popitem(last=False)
        return url, begun.state

    def take(self, state: str) -> Begun:
        """The sign-in with this state, which is used up by it; OidcError for none."""
        begun = self._begun.pop(state, None)
        if begun is None or self._monotonic() - begun.at > LIFE_S:
            raise OidcError(say("oidc_late", name=self.rules.name))
        return begun

    async def user_of(self, begun: Begun, code: str) -> ExternalUser:
        """The user whom a code stands for; OidcError if they may not sign in here."""
        token = await self._run(
            partial(self.provider.id_token, code, begun.redirect_uri, begun.nonce, begun.verifier)
        )
        return replace(external_user(self.rules, self._groups, token.claims), id_token=token.token)

    async def end_url(self, id_token: str, back: str) -> str:
        """Where a browser signs out at the provider too, and comes back to `back`; "" if it can't now:
        the panel's own session ends all the same."""
        try:
            return await self._run(partial(self.provider.end_session_url, id_token, back))
        except (OidcError, TooMany):
            return ""

    def reason(self, code: str) -> TextLike:
        """Why a sign-in failed, by the code of the sentence; "" for another one."""
        if code not in REASONS:
            return ""
        file = self.rules.secret_file or ""
        return say(code, name=self.rules.name, why=self.provider.why_away, file=file)

    def close(self) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)

    async def _run(self, work: Callable[[], Result]) -> Result:
        if self._waiting >= MOST_WAITING:
            raise TooMany(say("sign_in_busy"), AGAIN_S)
        self._waiting += 1
        try:
            return await asyncio.get_running_loop().run_in_executor(self._threads, work)
        except OidcError as error:
            log.warning("%s %s", error.reason, error.why)
            raise
        finally:
            self._waiting -= 1


def external_user(
    rules: OidcRules, own_groups: Collection[str], claims: Mapping[str, Any]
) -> ExternalUser:
    """The user with these claims: the highest role that one of their groups has. A group of the panel's
    own is had by who has one of this name there. OidcError without a role."""
    said = claims.get(rules.groups_claim)
    said = [said] if isinstance(said, str) else said if isinstance(said, list) else []
    groups = {group for group in said if isinstance(group, str)}
    roles = [role for role in ROLES if groups & set(getattr(rules, role))]
    if not roles:
        raise OidcError(say("oidc_no_role", name=rules.name))
    name = claims.get(rules.user_claim) or claims.get("sub")
    if not isinstance(name, str):
        raise OidcError(say("oidc_invalid", name=rules.name), f"{rules.user_claim} is not a text")
    shown = PREFIX + printable(name).strip()[:LONGEST_NAME]
    return ExternalUser(shown, roles[-1], frozenset(groups & set(own_groups)))

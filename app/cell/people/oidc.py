"""Sign-in by the plant's OpenID Connect provider."""

import asyncio
import base64
import importlib
import json
import logging
import os
import secrets
import threading
import time
from collections.abc import Callable, Collection, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from http.client import HTTPException
from pathlib import Path
from typing import IO, Any, Final, NamedTuple, TypeVar
from urllib.error import HTTPError
from urllib.parse import quote, urlencode
from urllib.request import HTTPRedirectHandler, Request, build_opener

from app.cell.permission.client_limits import RATE_LIMITS, RateGuard
from app.cell.permission.client_places import client_key
from app.panel.roles import ROLES
from app.panel.rules import OidcRules, is_protected
from app.records.principal import Client
from app.system.errors import KioskError, TooMany
from app.system.limits import BoundedDict
from app.system.printable import printable
from app.system.texts import Text, TextLike, say

# The plant's OpenID Connect provider: its description, its keys, and the ID token of a code.
#
# Blocking, for a thread. The description and the keys are kept for ten minutes. Authlib and joserfc
# come with the extra `oidc`.

TIMEOUT_S: Final = 5.0  # of each step of a request
WITHIN_S: Final = 10.0  # a whole answer
KEPT_S: Final = 600.0
KEYS_AGAIN_S: Final = 30.0  # between two fetches of the keys for a token whose key is not known
AWAY_S: Final = 3.0  # for so long a failed fetch is not repeated
MOST_BYTES: Final = 256 * 1024
LEEWAY_S: Final = 60  # between the clocks
ALGORITHMS: Final = ("RS256", "RS384", "RS512", "PS256", "PS384", "PS512", "ES256", "ES384", "Ed25519")
DISCOVERY: Final = "/.well-known/openid-configuration"


class OidcError(KioskError):
    """A sign-in that failed; the text is a sentence for the page of sign-in. `why` is for the server's
    log."""

    status = 502

    def __init__(self, text: Text, why: str = "") -> None:
        super().__init__(text)
        self.why = why
        self.reason = text


class IdToken(NamedTuple):
    """An ID token, and its checked claims."""

    token: str
    claims: Mapping[str, Any]


class _NoRedirect(HTTPRedirectHandler):
    """Another address is not the provider."""

    def redirect_request(
        self, req: Request, fp: IO[bytes], code: int, msg: str, headers: Any, newurl: str
    ) -> None:
        return None


class OidcProvider:
    """Used on several threads."""

    def __init__(
        self,
        rules: OidcRules,
        monotonic: Callable[[], float] = time.monotonic,
        wall: Callable[[], float] = time.time,
    ) -> None:
        self.rules = rules
        self._monotonic = monotonic
        self._wall = wall
        self._lock = threading.Lock()
        self._kept: dict[str, tuple[float, Any]] = {}  # by address: when it was fetched
        self._away: tuple[float, str] = (-AWAY_S, "")
        self._opener = build_opener(_NoRedirect)

    @property
    def why_away(self) -> str:
        """Why the last fetch failed."""
        return self._away[1]

    def authorization_url(self, redirect_uri: str, state: str, nonce: str, verifier: str) -> str:
        """Where the browser goes to sign in. The provider asks for the secret again, even if somebody
        is signed in there: the one before may have left the panel."""
        parameters = _authlib("oauth2.rfc6749.parameters")
        challenge = _authlib("oauth2.rfc7636").create_s256_code_challenge(verifier)
        rules, further = self.rules, {}
        if rules.acr_values:
            further["acr_values"] = " ".join(rules.acr_values)
        if rules.max_age_s is not None:
            further["max_age"] = str(rules.max_age_s)
        url: str = parameters.prepare_grant_uri(
            self._endpoint("authorization_endpoint"),
            self.rules.client_id,
            "code",
            redirect_uri,
            "openid profile",
            state,
            nonce=nonce,
            code_challenge=challenge,
            code_challenge_method="S256",
            prompt="login",
            **further,
        )
        return url

    def end_session_url(self, id_token: str, back: str) -> str:
        """Where the browser goes to sign out there too; "" if the provider has no such address. It
        comes back to `back`."""
        if "end_session_endpoint" not in self._metadata():
            return ""
        query = {
            "id_token_hint": id_token,
            "post_logout_redirect_uri": back,
            "client_id": self.rules.client_id,
        }
        address = self._endpoint("end_session_endpoint")
        return f"{address}{'&' if '?' in address else '?'}{urlencode(query)}"

    def id_token(self, code: str, redirect_uri: str, nonce: str, verifier: str) -> IdToken:
        """The ID token that a code stands for, with its checked claims; OidcError for one that is not
        valid."""
        form = {
            "grant_type": "authorization_code",
            "code": code,
            "redirect_uri": redirect_uri,
            "client_id": self.rules.client_id,
            "code_verifier": verifier,
        }
        headers, secret = {"accept": "application/json"}, self._secret()
        methods = self._metadata().get("token_endpoint_auth_methods_supported") or []
        if secret and methods and "client_secret_basic" not in methods:
            form["client_secret"] = secret
        elif secret:
            pair = f"{quote(self.rules.client_id, safe='')}:{quote(secret, safe='')}"
            headers["authorization"] = f"Basic {base64.b64encode(pair.encode()).decode()}"
        answer = self._fetch(self._endpoint("token_endpoint"), urlencode(form).encode(), headers)
        token = answer.get("id_token")
        if not isinstance(token, str):
            raise self._invalid("it has no ID token")
        return IdToken(token, self._check_token(token, nonce))

    def _check_token(self, token: str, nonce: str) -> Mapping[str, Any]:
        jose, jwt = importlib.import_module("joserfc.errors"), importlib.import_module("joserfc.jwt")
        oidc = _authlib("oidc.core")
        rules = self.rules
        options = {
            "iss": {"essential": True, "value": rules.issuer},
            "aud": {"essential": True, "value": rules.client_id},
        }
        try:
            decoded = self._decoded(jwt, token)
            claims = oidc.CodeIDToken(
                decoded.claims, decoded.header, options, {"nonce": nonce, "client_id": rules.client_id}
            )
            claims.validate(int(self._wall()), LEEWAY_S)
        except (jose.JoseError, ValueError, TypeError, KeyError) as error:
            raise self._invalid(f"{type(error).__name__}: {error}") from error
        audience = claims["aud"] if isinstance(claims["aud"], list) else [claims["aud"]]
        if len(audience) > 1 and claims.get("azp") != rules.client_id:
            raise self._invalid("it is for several clients, and not named for this one")
        self._check_way(claims)
        checked: Mapping[str, Any] = dict(claims)
        return checked

    def _check_way(self, claims: Mapping[str, Any]) -> None:
        """OidcError for a sign-in in another way than the panel asks for, or that was too long ago."""
        rules, at = self.rules, claims.get("auth_time")
        why = ""
        if rules.acr_values and claims.get("acr") not in rules.acr_values:
            why = f"its acr is {claims.get('acr')!r}"
        if rules.max_age_s is not None:
            since = at if isinstance(at, int | float) and not isinstance(at, bool) else float("-inf")
            if self._wall() - since > rules.max_age_s + LEEWAY_S:
                why = f"its auth_time is {at!r}"
        if why:
            raise OidcError(say("oidc_weak", name=rules.name), why)

    def _decoded(self, jwt: Any, token: str) -> Any:
        """The token, its signature checked by the provider's keys. A key that is not known is fetched,
        as providers renew theirs."""
        jwk = importlib.import_module("joserfc.jwk")
        try:
            return jwt.decode(token, jwk.KeySet.import_key_set(self._keys(KEPT_S)), ALGORITHMS)
        except Exception:
            keys = self._keys(KEYS_AGAIN_S)
            return jwt.decode(token, jwk.KeySet.import_key_set(keys), ALGORITHMS)

    def _metadata(self) -> Mapping[str, Any]:
        """The description of the provider."""
        about: Mapping[str, Any] = self._cached(self.rules.issuer.rstrip("/") + DISCOVERY, KEPT_S)
        if about.get("issuer") != self.rules.issuer:
            raise self._invalid(f'its issuer is "{about.get("issuer")}"')
        return about

    def _keys(self, kept_s: float) -> Any:
        return self._cached(self._endpoint("jwks_uri"), kept_s)

    def _endpoint(self, name: str) -> str:
        url = self._metadata().get(name)
        if not isinstance(url, str) or not is_protected(url):
            raise self._invalid(f"its {name} is not an https:// address")
        return url

    def _cached(self, url: str, kept_s: float) -> Any:
        with self._lock:
            at, content = self._kept.get(url, (float("-inf"), None))
            if self._monotonic() - at < kept_s:
                return content
            failed_at, why = self._away
            if self._monotonic() - failed_at < AWAY_S:
                raise self._lost(why)
            content = self._fetch(url)
            self._kept[url] = self._monotonic(), content
            return content

    def _fetch(
        self, url: str, data: bytes | None = None, headers: Mapping[str, str] = {}
    ) -> dict[str, Any]:
        """The JSON object that the provider answers; OidcError if it is away, refuses, or takes too
        long."""
        ends = time.monotonic() + WITHIN_S
        request = Request(url, data, dict(headers))
        try:
            with self._opener.open(request, timeout=TIMEOUT_S) as answer:
                content = b""
                while part := answer.read1(65_536):
                    content += part
                    if len(content) > MOST_BYTES or time.monotonic() > ends:
                        raise self._lost("its answer is too long")
        except HTTPError as error:
            with error:
                if data is not None and 400 <= error.code < 500:
                    raise OidcError(say("oidc_refused", name=self.rules.name), str(error)) from None
                raise self._lost(f"HTTP {error.code}") from None
        except (OSError, HTTPException) as error:
            reason = getattr(error, "reason", error)
            raise self._lost(str(getattr(reason, "strerror", None) or reason)) from error
        try:
            decoded = json.loads(content)
        except ValueError:
            decoded = None
        if not isinstance(decoded, dict):
            raise self._invalid("it is not a JSON object")
        return decoded

    def _secret(self) -> str:
        """The secret of the client, "" for a public one."""
        rules = self.rules
        if rules.secret_env is not None and (secret := os.environ.get(rules.secret_env)):
            return secret
        if rules.secret_file is None:
            return ""
        try:
            return Path(rules.secret_file).read_text(encoding="utf-8").strip()
        except (OSError, UnicodeDecodeError) as error:
            raise OidcError(say("oidc_secret", file=rules.secret_file), str(error)) from error

    def _lost(self, why: str) -> OidcError:
        self._away = self._monotonic(), why
        return OidcError(say("oidc_away", name=self.rules.name, why=why), why)

    def _invalid(self, why: str) -> OidcError:
        return OidcError(say("oidc_invalid", name=self.rules.name), why)


def _authlib(module: str) -> Any:
    """A module of Authlib; OidcError without it."""
    try:
        return importlib.import_module(f"authlib.{module}")
    except ImportError:
        raise OidcError(say("oidc_not_installed")) from None


# Sign-ins by the plant's OpenID Connect provider, from the first request to the user's role.
#
# Each pending sign-in has a state, a nonce and a verifier (PKCE) of its own, is for one browser,
# and is used once. HTTP is spoken on threads of their own: the event loop waits for no provider.

log = logging.getLogger("kiosk.access")

PREFIX: Final = "oidc:"  # stands before the name, in the operator's log too
LONGEST_NAME: Final = 60
LIFE_S: Final = 600.0  # for somebody to type a password there
MAX_PENDING: Final = 500
MOST_WAITING: Final = 8
LIMIT: Final = RATE_LIMITS["provider_sign_ins"]

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
class PendingSignIn:
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
        self._pending = BoundedDict[str, PendingSignIn](MAX_PENDING)
        self._threads = ThreadPoolExecutor(2, "oidc")
        self._rate = RateGuard("provider_sign_ins", monotonic=monotonic)
        self._waiting = 0

    async def begin(self, client: Client, redirect_uri: str) -> tuple[str, str]:
        """The provider's address for a browser, and the state of this sign-in. OidcError if the
        provider is away, TooMany for too many at once."""
        if self._rate.exceeded(client.local, provider_sign_ins=client_key(client.address)):
            raise LIMIT.error
        pending = PendingSignIn(client, redirect_uri, self._monotonic())
        url = await self._run(
            partial(
                self.provider.authorization_url,
                redirect_uri,
                pending.state,
                pending.nonce,
                pending.verifier,
            )
        )
        for other in [b for b in self._pending.values() if b.client.id == client.id]:
            del self._pending[other.state]
        self._pending[pending.state] = pending
        return url, pending.state

    def take(self, state: str) -> PendingSignIn:
        """The sign-in with this state, which is used up by it; OidcError for none."""
        pending = self._pending.pop(state, None)
        if pending is None or self._monotonic() - pending.at > LIFE_S:
            raise OidcError(say("oidc_late", name=self.rules.name))
        return pending

    async def user_of(self, pending: PendingSignIn, code: str) -> ExternalUser:
        """The user whom a code stands for; OidcError if they may not sign in here."""
        token = await self._run(
            partial(self.provider.id_token, code, pending.redirect_uri, pending.nonce, pending.verifier)
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
            raise LIMIT.error
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

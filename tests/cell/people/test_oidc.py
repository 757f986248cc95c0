"""ID tokens of a real provider: which are accepted, and what a provider that is away costs."""

import time
from collections.abc import Iterator
from typing import Any
from urllib.parse import parse_qs, urlsplit

import httpx
import pytest
from joserfc.jwk import RSAKey

from app.cell.people.oidc import KEPT_S, KEYS_AGAIN_S, OidcError, OidcProvider, external_user
from app.panel.rules import OidcRules
from tests.support.oidc_provider import CLIENT, SECRET, Provider, provider

BACK = "http://127.0.0.1:8000/session/oidc/back"
NONCE, VERIFIER = "nonce-of-this-sign-in", "v" * 64


class Clock:
    now = 1000.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def plant(monkeypatch: pytest.MonkeyPatch) -> Iterator[Provider]:
    monkeypatch.setenv("OIDC_SECRET", SECRET)
    with provider() as mine:
        yield mine


def rules(plant: Provider, **more: Any) -> OidcRules:
    about = {"issuer": plant.url, "client_id": CLIENT, "name": "Plant", "secret_env": "OIDC_SECRET"}
    return OidcRules.model_validate(about | {"operator": ["line1"], "engineer": ["staff"]} | more)


def code_of(client: OidcProvider, verifier: str = VERIFIER) -> str:
    url = client.authorization_url(BACK, "state", NONCE, verifier)
    answer = httpx.get(url, trust_env=False)
    return parse_qs(urlsplit(answer.headers["location"]).query)["code"][0]


def claims(client: OidcProvider, verifier: str = VERIFIER, nonce: str = NONCE) -> Any:
    return client.id_token(code_of(client), BACK, nonce, verifier).claims


def test_a_code_becomes_checked_claims_once(plant: Provider) -> None:
    client = OidcProvider(rules(plant))
    code = code_of(client)
    assert client.id_token(code, BACK, NONCE, VERIFIER).claims["preferred_username"] == "sato"
    with pytest.raises(OidcError) as refused:
        client.id_token(code, BACK, NONCE, VERIFIER)
    assert refused.value.reason.code == "oidc_refused"
    assert SECRET not in str(plant.forms)


@pytest.mark.parametrize(
    "wrong",
    [
        {"iss": "http://127.0.0.1:1"},
        {"aud": "another"},
        {"aud": [CLIENT, "another"]},
        {"azp": "another"},
        {"nonce": "of another sign-in"},
        {"nonce": None},
        {"exp": int(time.time()) - 3600},
        {"exp": None},
        {"iat": int(time.time()) + 3600},
        {"sub": None},
    ],
)
def test_an_id_token_that_is_wrong_is_refused(plant: Provider, wrong: dict[str, Any]) -> None:
    plant.claims = wrong
    with pytest.raises(OidcError) as refused:
        claims(OidcProvider(rules(plant)))
    assert refused.value.reason.code == "oidc_invalid"


def test_a_stronger_and_fresh_sign_in_is_asked_for_and_checked(plant: Provider) -> None:
    client = OidcProvider(rules(plant, acr_values=["two", "three"], max_age_s=60))
    plant.claims = {"acr": "two", "auth_time": int(time.time())}
    assert claims(client)["acr"] == "two"
    assert (plant.asked["acr_values"], plant.asked["max_age"]) == ("two three", "60")


@pytest.mark.parametrize(
    "wrong",
    [
        {"acr": "one"},
        {"acr": None},
        {"acr": ["two"]},
        {"auth_time": int(time.time()) - 3600},
        {"auth_time": None},
        {"auth_time": "now"},
        {"auth_time": True},
    ],
)
def test_a_weaker_or_old_sign_in_is_refused(plant: Provider, wrong: dict[str, Any]) -> None:
    client = OidcProvider(rules(plant, acr_values=["two"], max_age_s=60))
    plant.claims = {"acr": "two", "auth_time": int(time.time())} | wrong
    with pytest.raises(OidcError) as refused:
        claims(client)
    assert refused.value.reason.code in ("oidc_weak", "oidc_invalid")


def test_what_is_not_asked_for_is_not_checked(plant: Provider) -> None:
    plant.claims = {"acr": "0", "auth_time": 1}
    assert claims(OidcProvider(rules(plant)))["acr"] == "0"
    assert {"acr_values", "max_age"}.isdisjoint(plant.asked)


def test_a_signature_by_another_key_is_refused(plant: Provider) -> None:
    plant.signs_with = RSAKey.generate_key(2048, {"kid": "first"})
    with pytest.raises(OidcError) as refused:
        claims(OidcProvider(rules(plant)))
    assert refused.value.reason.code == "oidc_invalid"


def test_a_code_is_of_no_use_without_its_verifier(plant: Provider) -> None:
    with pytest.raises(OidcError) as refused:
        claims(OidcProvider(rules(plant)), verifier="w" * 64)
    assert refused.value.reason.code == "oidc_refused"


def test_a_new_key_of_the_provider_is_fetched(plant: Provider) -> None:
    clock = Clock()
    client = OidcProvider(rules(plant), clock)
    assert claims(client)["sub"] == "1"
    plant.renew_key("second")
    clock.now += KEYS_AGAIN_S + 1
    assert claims(client)["sub"] == "1"


def test_another_issuer_than_that_of_the_panel_file_is_refused(plant: Provider) -> None:
    plant.issuer = "https://id.evil.example"
    with pytest.raises(OidcError) as refused:
        OidcProvider(rules(plant)).authorization_url(BACK, "state", NONCE, VERIFIER)
    assert refused.value.reason.code == "oidc_invalid"


def test_a_provider_that_is_away_is_said_so_and_comes_back(plant: Provider) -> None:
    clock = Clock()
    client = OidcProvider(rules(plant), clock)
    plant.status = 503
    with pytest.raises(OidcError) as refused:
        client.authorization_url(BACK, "state", NONCE, VERIFIER)
    assert (refused.value.reason.code, client.why_away) == ("oidc_away", "HTTP 503")
    plant.status = 200
    with pytest.raises(OidcError):
        client.authorization_url(BACK, "state", NONCE, VERIFIER)  # not asked again so soon
    clock.now += 10
    assert client.authorization_url(BACK, "state", NONCE, VERIFIER).startswith(f"{plant.url}/auth?")
    plant.status = 503
    clock.now += KEPT_S - 1
    assert client.authorization_url(BACK, "state", NONCE, VERIFIER)


@pytest.mark.parametrize(
    ("groups", "role", "own"),
    [
        (["line1"], "operator", set()),
        (["line1", "staff", "quality"], "engineer", {"quality"}),
        ("staff", "engineer", set()),
        (["line1", 7], "operator", set()),
    ],
)
def test_groups_give_the_highest_role(plant: Provider, groups: Any, role: str, own: set[str]) -> None:
    user = external_user(rules(plant), ("quality",), {"sub": "1", "groups": groups})
    assert (user.name, user.role, set(user.groups)) == ("oidc:1", role, own)


@pytest.mark.parametrize("groups", [None, [], ["others"], {"line1": True}])
def test_without_a_group_that_has_a_role_nobody_comes_in(plant: Provider, groups: Any) -> None:
    with pytest.raises(OidcError) as refused:
        external_user(rules(plant), (), {"sub": "1", "groups": groups})
    assert refused.value.reason.code == "oidc_no_role"

"""The table `[access.oidc]` of a panel file: sign-in by the plant's own provider (OpenID Connect)."""

from typing import Annotated, Final
from urllib.parse import urlsplit

from pydantic import AfterValidator, Field

from app.panel.base import Description

Group = Annotated[str, Field(min_length=1, max_length=200)]
Groups = Annotated[tuple[Group, ...], Field(strict=False, max_length=50)]
Claim = Annotated[str, Field(pattern=r"^[A-Za-z0-9_.:/-]{1,100}$")]
Variable = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$", max_length=100)]
AcrValue = Annotated[str, Field(pattern=r"^[!-~]{1,200}$")]
LOOPBACK: Final = ("localhost", "127.0.0.1", "::1")


def is_protected(url: str) -> bool:
    """Whether nobody on the network can read or forge what this address answers."""
    parts = urlsplit(url)
    return parts.scheme == "https" or (parts.scheme == "http" and parts.hostname in LOOPBACK)


def _check_issuer(issuer: str) -> str:
    parts = urlsplit(issuer)
    if not is_protected(issuer) or not parts.hostname or parts.query or parts.fragment:
        raise ValueError(f'"{issuer}" is not an issuer: an https:// address such as "https://id.plant"')
    return issuer


def _check_path(path: str) -> str:
    if not path.startswith("/"):
        raise ValueError(f'"{path}" is not a whole path: it begins with "/"')
    return path


class OidcRules(Description):
    """The provider, and which of its groups have which role here. The secret of the client is in an
    environment variable of the server, or else in a file there, never in the panel file."""

    issuer: Annotated[str, Field(max_length=300), AfterValidator(_check_issuer)]
    client_id: Annotated[str, Field(min_length=1, max_length=200)]
    name: Annotated[str, Field(min_length=1, max_length=40)]
    secret_env: Variable | None = None
    secret_file: Annotated[str, AfterValidator(_check_path)] | None = None
    user_claim: Claim = "preferred_username"
    groups_claim: Claim = "groups"
    acr_values: Annotated[tuple[AcrValue, ...], Field(strict=False, max_length=20)] = ()
    max_age_s: Annotated[int, Field(gt=0, le=86_400)] | None = None
    viewer: Groups = ()
    operator: Groups = ()
    maintenance: Groups = ()
    engineer: Groups = ()

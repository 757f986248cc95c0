"""Takes secrets out of texts before they leave the machine: by the names of keys, wherever they stand
in JSON, JSON5, TOML, an environment or a log. Rather too much than too little. Pure."""

import re
from collections.abc import Mapping
from typing import Any, Final

REMOVED: Final = "(removed)"
# A part of a key's name between "_", "-" or capitals.
WORDS: Final = (
    "password|passwd|passphrase|pwd|pin|pins|pincode|secret|secrets|token|tokens|apikey|credential|"
    "credentials|cookie|authorization|auth|bearer|private|signature|session|usrpwd"
)
_PART: Final = re.compile(rf"(?:^|[_\-./])(?:{WORDS})(?:$|[_\-./\d])")
_CAPITAL: Final = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")
_QUOTED: Final = r'"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\''
# Keys begin where a word begins and are of a limited length: a search stays linear in a text.
_KEY: Final = r"(?<![\w.\-])(?P<key>[\"']?[A-Za-z][\w.\-]{0,80}[\"']?)(?P<between>\s{0,20}[:=]\s{0,20})"
_PAIR: Final = re.compile(rf"{_KEY}(?P<value>{_QUOTED}|(?:Bearer |Basic )?[^\s,;&}}\]\"'\[{{]+)")
_LIST: Final = re.compile(rf"{_KEY}\[[^\]]{{0,10000}}\]")
_PEM: Final = re.compile(r"-----BEGIN [A-Z ]*PRIVATE KEY-----.*?-----END [A-Z ]*PRIVATE KEY-----", re.S)
_IN_ADDRESS: Final = re.compile(r"(?<=//)[^/\s@\"']+@")


def is_secret(key: str) -> bool:
    """Whether the value of a key with this name is kept back: "tls_private_key", "userPassword"."""
    return _PART.search(_CAPITAL.sub("_", key.strip("\"'")).lower()) is not None


def without_secrets(text: str) -> str:
    """The text with `(removed)` for each value of such a key, private keys and users in addresses."""
    text = _PEM.sub(REMOVED, text)
    text = _IN_ADDRESS.sub(f"{REMOVED}@", text)
    for pattern in (_LIST, _PAIR):
        text = pattern.sub(_kept_back, text)
    return text


def _kept_back(found: re.Match[str]) -> str:
    if not is_secret(found["key"]):
        return found[0]
    return f'{found["key"]}{found["between"]}"{REMOVED}"'


def plain_without_secrets(value: Any) -> Any:
    """The same for JSON values."""
    if isinstance(value, Mapping):
        return {
            key: REMOVED if is_secret(str(key)) else plain_without_secrets(one)
            for key, one in value.items()
        }
    if isinstance(value, list | tuple):
        return [plain_without_secrets(one) for one in value]
    return without_secrets(value) if isinstance(value, str) else value

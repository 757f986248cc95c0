"""Hashes of PINs, passwords and badges: Argon2id, as heavy as this machine's memory allows.

Tokens of programs have 256 random bits, for which SHA-256 is enough.
"""

import hashlib
import hmac
import os
import re
import secrets
from base64 import b64encode
from contextlib import suppress
from typing import Final, Literal, NamedTuple

from cryptography.exceptions import InvalidKey
from cryptography.hazmat.primitives.kdf.argon2 import Argon2id

from app.system.texts import Text, say

Way = Literal["pin", "password", "badge"]
WAYS: Final[tuple[Way, ...]] = ("pin", "password", "badge")

PIN: Final = re.compile(r"[0-9]{4,12}")
SHORTEST_PASSWORD: Final = 8
SHORTEST_BADGE: Final = 4
LONGEST: Final = 128  # characters of a secret
DIGITS: Final = "01234567890 09876543210"
TOKEN_START: Final = "opt_"
LENGTH: Final = 32  # bytes of a hash
LANES: Final = 1


class Cost(NamedTuple):
    """`memory_kib` and `passes` of one hash (RFC 9106)."""

    memory_kib: int
    passes: int


# By the machine's memory; both are of OWASP's table for Argon2id. 130 ms and 160 ms on one slow core.
LARGE: Final = Cost(47_104, 1)
SMALL: Final = Cost(19_456, 2)
LARGE_FROM_BYTES: Final = 2 * 1024**3


def cost_of_machine(memory_bytes: int) -> Cost:
    """The cost for a machine with so much memory."""
    return LARGE if memory_bytes >= LARGE_FROM_BYTES else SMALL


def memory_of_machine() -> int:
    """Bytes of memory; 0 if the system does not say."""
    with suppress(ValueError, OSError):
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return 0


def hashed(secret: str, cost: Cost) -> str:
    """The hash of a PIN or password with its parameters and a new salt, in the PHC form."""
    return _argon(secrets.token_bytes(16), cost).derive_phc_encoded(secret.encode())


def unmatched_hash(cost: Cost) -> str:
    """A hash that no secret is known to have: as slow to check as another, and quick to make."""
    salt, tag = (b64encode(secrets.token_bytes(size)).decode().rstrip("=") for size in (16, LENGTH))
    return f"$argon2id$v=19$m={cost.memory_kib},t={cost.passes},p={LANES}${salt}${tag}"


def matches(phc: str, secret: str) -> bool:
    """Whether the secret has this hash; False for a text that is not a hash."""
    try:
        Argon2id.verify_phc_encoded(secret.encode(), phc)
    except (InvalidKey, ValueError):
        return False
    return True


def badge_hash(number: str, salt: str) -> str:
    """The hash of a badge's number, with the salt of the file (hex): it is looked up, as a reader says
    no name. The cost is always the same."""
    return _argon(bytes.fromhex(salt), SMALL).derive(number.encode()).hex()


def same_text(first: str, second: str) -> bool:
    """Whether two texts are equal, in the same time for all that have this length."""
    return hmac.compare_digest(first.encode(), second.encode())


def new_api_token() -> str:
    return TOKEN_START + secrets.token_urlsafe(32)


def token_hash(token: str) -> str:
    return hashlib.sha256(token.encode()).hexdigest()


def fault_of(way: Way, secret: str) -> Text | None:
    """What is wrong with a new secret and what would be right; None if it can be used. The text never
    has the secret."""
    if len(secret) > LONGEST or not secret.isprintable():
        return say("users_secret_form", most=LONGEST)
    if way == "pin" and not PIN.fullmatch(secret):
        return say("users_pin_form")
    if way == "pin" and (len(set(secret)) == 1 or secret in DIGITS):
        return say("users_pin_guessed")
    if way == "password" and len(secret) < SHORTEST_PASSWORD:
        return say("users_password_short", least=SHORTEST_PASSWORD)
    if way == "badge" and len(secret) < SHORTEST_BADGE:
        return say("users_badge_short", least=SHORTEST_BADGE)
    return None


def _argon(salt: bytes, cost: Cost) -> Argon2id:
    return Argon2id(
        salt=salt, length=LENGTH, iterations=cost.passes, lanes=LANES, memory_cost=cost.memory_kib
    )

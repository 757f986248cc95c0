"""Signatures of files, checked offline, in the form of minisign: Ed25519 of the file's BLAKE2b-512
hash, and of the trusted comment.

Source: https://jedisct1.github.io/minisign (signature format).
"""

import base64
import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from app.system.errors import SettingsError
from app.system.printable import one_line

SIGNATURE_SUFFIX: Final = ".minisig"
PINNED: Final = "/etc/operator-panel/release-keys.pub"
UNTRUSTED: Final = "untrusted comment:"
TRUSTED: Final = "trusted comment: "
KEY_KIND: Final = b"Ed"
PREHASHED: Final = b"ED"
ID_BYTES: Final = 8
KEY_BYTES: Final = 32
SIGNATURE_BYTES: Final = 64


@dataclass(frozen=True, slots=True)
class PublicKey:
    """A key of minisign; `id` only says which key to try."""

    id: bytes
    key: bytes

    @property
    def name(self) -> str:
        """The id as minisign writes it: a number, without zeros before it."""
        return f"{int.from_bytes(self.id, 'little'):X}"


@dataclass(frozen=True, slots=True)
class Signature:
    """A signature of a file, and that of the signature with the trusted comment."""

    key_id: bytes
    signature: bytes
    comment: str
    of_comment: bytes


def parse_keys(text: str, name: str) -> tuple[PublicKey, ...]:
    """The public keys in a file of minisign, or in several of them one after the other; SettingsError.
    `name` is that of the file."""
    lines = (line.strip() for line in text.splitlines())
    keys = tuple(_key(line, name) for line in lines if line and not line.startswith((UNTRUSTED, "#")))
    if not keys:
        raise SettingsError(f"{name} has no public key, as `minisign -G` writes minisign.pub")
    return keys


def _key(line: str, name: str) -> PublicKey:
    data = _decoded(line)
    if len(data) != len(KEY_KIND) + ID_BYTES + KEY_BYTES or not data.startswith(KEY_KIND):
        raise SettingsError(
            f'{name}: "{one_line(line, 80)}" is not a public key: it must be as `minisign -G` '
            "writes minisign.pub"
        )
    return PublicKey(data[2:10], data[10:])


def parse_signature(text: str, name: str) -> Signature:
    """The signature in a file of minisign; SettingsError. `name` is that of the file."""
    lines = [line.rstrip("\r") for line in text.split("\n")]
    if len(lines) < 4 or not (lines[0].startswith(UNTRUSTED) and lines[2].startswith(TRUSTED)):
        raise SettingsError(f"{name} is not a signature of minisign")
    data, of_comment = _decoded(lines[1]), _decoded(lines[3])
    if len(data) != len(PREHASHED) + ID_BYTES + SIGNATURE_BYTES or len(of_comment) != SIGNATURE_BYTES:
        raise SettingsError(f"{name} is not a signature of minisign: it was cut or changed")
    if not data.startswith(PREHASHED):
        raise SettingsError(
            f"{name} is not of the kind ED, which minisign writes by default: sign again, without -l"
        )
    return Signature(data[2:10], data[10:], lines[2].removeprefix(TRUSTED), of_comment)


def _decoded(line: str) -> bytes:
    try:
        return base64.b64decode(line.strip(), validate=True)
    except ValueError:
        return b""


def verify(data: bytes, signature: Signature, keys: Iterable[PublicKey], name: str) -> PublicKey:
    """The key that has signed these bytes; SettingsError if none has. `name` is that of the file."""
    keys = tuple(keys)
    trusted = [key for key in keys if key.id == signature.key_id]
    if not trusted:
        signer = PublicKey(signature.key_id, b"").name
        pinned = ", ".join(key.name for key in keys)
        raise SettingsError(f"{name} is signed with the key {signer}; trusted is {pinned}")
    digest = hashlib.blake2b(data).digest()
    for key in trusted:
        if not _fits(key, signature.signature, digest):
            continue
        if not _fits(key, signature.of_comment, signature.signature + signature.comment.encode()):
            raise SettingsError(f"the signature of {name} was changed: its comment is another")
        return key
    raise SettingsError(f"{name} is not what was signed: it was changed, or is another file")


def _fits(key: PublicKey, signature: bytes, data: bytes) -> bool:
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

    try:
        Ed25519PublicKey.from_public_bytes(key.key).verify(signature, data)
    except (InvalidSignature, ValueError):
        return False
    return True


def check_signed(file: Path, keys: tuple[PublicKey, ...], data: bytes | None = None) -> str:
    """Checks the signature beside a file, whose content is `data` if it was read already; returns what
    to tell. SettingsError if it is not signed by
    one of the keys."""
    path = file.with_name(file.name + SIGNATURE_SUFFIX)
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise SettingsError(f"{file} is not signed: {path.name} is not beside it") from None
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(f"{path} can't be read: {error}") from error
    signature = parse_signature(text, str(path))
    key = verify(file.read_bytes() if data is None else data, signature, keys, file.name)
    return f"{file.name} is signed with the key {key.name}: {one_line(signature.comment)}"

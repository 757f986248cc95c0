"""Signs the operator's log: Ed25519 (RFC 8032), with a key that is made at the first start."""

import base64
import json
import logging
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

from app.records.database import Head, as_log_error
from app.records.entry import Entry, new_entry
from app.records.store import Store
from app.system.errors import LogError
from app.system.texts import say
from app.system.whole_file import write_whole

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

log = logging.getLogger("kiosk.log")

NAME: Final = "log-key.pem"
PUBLIC_BYTES: Final = 32
Why = Literal["hour", "end", "again"]


class Signature(NamedTuple):
    """What an entry of the kind `signed` has: the head that it signs, key and signature in base64."""

    seq: int
    hash: str
    key: str
    signature: str

    def message(self, at: int) -> bytes:
        """The signed bytes; `at` is the time of the entry in ms."""
        return f"operator-panel operator's log 1\n{self.seq}\n{self.hash}\n{at}\n".encode()


class LogKey:
    """A private key. `public` is the public key as base64 of its 32 bytes."""

    def __init__(self, private: "Ed25519PrivateKey") -> None:
        self._private = private
        self.public = base64.b64encode(private.public_key().public_bytes_raw()).decode()

    def signed(self, message: bytes) -> str:
        """The signature of some bytes, in base64."""
        return base64.b64encode(self._private.sign(message)).decode()

    def entry(self, head: Head, why: Why) -> Entry:
        """The entry that signs the newest one, to be written right after it."""
        entry = new_entry("signed", reason=say("log_signed", seq=head.seq))
        about = Signature(head.seq, head.hash, self.public, "")
        signature = self.signed(about.message(entry.at))
        values = about._replace(signature=signature)._asdict() | {"why": why}
        return entry._replace(values=json.dumps(values))


class Signer:
    """Signs the heads of one server's log, if the key can be read; the key is loaded when it is first
    needed. `signed_seq` is the number of the newest entry with a signature."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.signed_seq = 0

    @cached_property
    def _key(self) -> LogKey | None:
        try:
            return load_or_make_key(self._folder)
        except (LogError, ImportError) as error:
            log.error("the operator's log is not signed: %s", error)
            return None

    @property
    def public(self) -> str:
        """The public key, "" if the key can't be read."""
        return self._key.public if self._key else ""

    def due(self, head: Head, why: Why) -> Entry | None:
        """The entry that signs the head, to be written next; None if there is nothing new to sign."""
        if self._key is None or head.seq == self.signed_seq or not head.count:
            return None
        return self._key.entry(head, why)

    def sign(self, store: Store, why: Why) -> None:
        """Signs the newest entry, unless that is a signature of this server; LogError."""
        if (entry := self.due(store.head, why)) is not None:
            store.append([entry])
            self.signed_seq = store.head.seq

    def sign_end(self, store: Store) -> Head:
        """Signs the newest entry at the end of the server; returns the newest entry then."""
        try:
            self.sign(store, "end")
            store.sync()
        except LogError as error:
            log.error("the end of the operator's log is not signed: %s", error)
        return store.head


def load_or_make_key(folder: Path) -> LogKey:
    """The key in the data folder, which is made if there is none; LogError if it can't be read."""
    from cryptography.hazmat.primitives import serialization
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    with as_log_error():
        with suppress(FileNotFoundError):
            return _load(folder)
        key = Ed25519PrivateKey.generate()
        pem = key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
        write_whole(folder / NAME, pem)
    return LogKey(key)


def load_key(folder: Path) -> LogKey | None:
    """The key in the data folder; None if there is none, LogError if it can't be read."""
    with as_log_error():
        try:
            return _load(folder)
        except FileNotFoundError:
            return None


def _load(folder: Path) -> LogKey:
    from cryptography.hazmat.primitives import serialization
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    path = folder / NAME
    try:
        key = serialization.load_pem_private_key(path.read_bytes(), password=None)
    except (ValueError, TypeError) as error:
        raise LogError(f"{path} is not a private key: {error}") from error
    if not isinstance(key, Ed25519PrivateKey):
        raise LogError(f"{path} is not an Ed25519 key")
    return LogKey(key)


def parse_public_key(text: str) -> str:
    """A public key as it is written here; ValueError for another text."""
    with suppress(ValueError):
        if len(base64.b64decode(text.strip(), validate=True)) == PUBLIC_BYTES:
            return text.strip()
    raise ValueError(f'"{text:.80}" is not a public key: base64 of 32 bytes, as `log key` prints it')


def read_signature(entry: Entry) -> Signature | None:
    """The signature in an entry; None if it has none that can be read."""
    try:
        about = json.loads(entry.values)
        fields = Signature(*(about[name] for name in Signature._fields))
    except (ValueError, KeyError, TypeError):
        return None
    types = (int, str, str, str)
    return fields if all(map(isinstance, fields, types)) else None


def is_signed(signature: Signature, at: int) -> bool:
    """Whether the signature fits its key, the head and the time (ms)."""
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

    try:
        key = Ed25519PublicKey.from_public_bytes(base64.b64decode(signature.key, validate=True))
        key.verify(base64.b64decode(signature.signature, validate=True), signature.message(at))
    except (InvalidSignature, ValueError):
        return False
    return True

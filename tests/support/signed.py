"""Signatures in the form of minisign, made here: tests/tools/install/test_minisign.py has those of the
real program."""

import base64
import hashlib
import secrets
from pathlib import Path

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from app.system.minisign import KEY_KIND, PREHASHED, SIGNATURE_SUFFIX, TRUSTED, UNTRUSTED


class Signer:
    """A key pair, whose public half is the file `public`."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True)
        self._key, self._id = Ed25519PrivateKey.generate(), secrets.token_bytes(8)
        self.public = folder / "minisign.pub"
        public = KEY_KIND + self._id + self._key.public_key().public_bytes_raw()
        self.public.write_text(f"{UNTRUSTED} public key\n{_encoded(public)}\n")

    def sign(self, file: Path, comment: str = "0.2.0 for cell 1") -> Path:
        """The signature, beside the file."""
        signature = self._key.sign(hashlib.blake2b(file.read_bytes()).digest())
        of_comment = self._key.sign(signature + comment.encode())
        lines = [f"{UNTRUSTED} signature", _encoded(PREHASHED + self._id + signature)]
        lines += [f"{TRUSTED}{comment}", _encoded(of_comment)]
        path = file.with_name(file.name + SIGNATURE_SUFFIX)
        path.write_text("\n".join(lines) + "\n")
        return path


def _encoded(data: bytes) -> str:
    return base64.b64encode(data).decode()

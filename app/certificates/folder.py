"""A folder with certificates, and their files: NAME.pem, NAME.key, NAME.csr. Keys are the owner's
alone; what is there is not replaced, but by `renew`."""

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from cryptography import x509
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec

from app.certificates import issuing
from app.certificates.issuing import CertificateError, Holder, Issuer, Key

AUTHORITY: Final = "ca"
MOST_BYTES: Final = 1 << 20
OWN: Final = 0o600
PUBLIC: Final = 0o644


@dataclass(frozen=True, slots=True)
class Listed:
    """A certificate in a folder; `days` are those until it runs out, negative afterwards."""

    file: Path
    name: str
    until: datetime
    days: float


class CertificateFolder:
    """The certificates of a cell: `ca`, and one file for each holder."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def certificate(self, name: str) -> Path:
        return self.path / f"{name}.pem"

    def key(self, name: str) -> Path:
        return self.path / f"{name}.key"

    def request(self, name: str) -> Path:
        return self.path / f"{name}.csr"

    def make(self, authority: str, holders: Iterable[tuple[str, Holder]], by_plant: bool) -> list[Path]:
        """Makes the keys of all, and their certificates by a new CA with the name `authority`, or, with
        `by_plant`, requests for the plant's CA. `holders` are (name of the files, holder). Returns the
        files; CertificateError if one of them is there."""
        named = list(holders)
        files = [self._targets(name, by_plant) for name, _ in named]
        if not by_plant:
            files.insert(0, self._targets(AUTHORITY, by_plant))
        self._check_absent([file for pair in files for file in pair])
        self.create()
        issuer = None if by_plant else self._make_authority(authority)
        for name, holder in named:
            self._make(name, holder, issuer)
        return [file for pair in files for file in pair]

    def create(self) -> None:
        """Makes the folder, for its owner alone; one that is there stays as it is."""
        with _writing(self.path):
            self.path.mkdir(mode=0o700, parents=True, exist_ok=True)

    def add(self, name: str, holder: Holder, by_plant: bool) -> list[Path]:
        """Makes one more; see `make`."""
        files = self._targets(name, by_plant)
        self._check_absent(files)
        self._make(name, holder, None if by_plant else self.issuer())
        return list(files)

    def self_sign(self, name: str, holder: Holder, days: int) -> list[Path]:
        """Makes a key and its certificate without any CA."""
        files = self._targets(name, by_plant=False)
        self._check_absent(files)
        key = issuing.new_key()
        write_new(self.key(name), issuing.key_pem(key), OWN)
        certificate = issuing.issue(holder, key, None, days)
        write_new(self.certificate(name), issuing.pem(certificate), PUBLIC)
        return list(files)

    def renew_own(self, name: str, days: int, by_plant: bool) -> Path:
        """Makes a certificate anew for the same key, signed by itself, or a request for it."""
        key = read_key(self.key(name))
        holder = issuing.holder_of(read_certificate(self.certificate(name)))
        if by_plant:
            file, content = self.request(name), issuing.pem(issuing.request(holder, key))
        else:
            certificate = issuing.issue(holder, key, None, days)
            file, content = self.certificate(name), issuing.pem(certificate)
        replace_file(file, content)
        return file

    def renew(self, names: Sequence[str], by_plant: bool) -> list[Path]:
        """Makes the certificates with these names anew, for the same keys, or requests for them. All
        but the CA's without names. Returns the files."""
        names = names or [name for name in self._names() if name != AUTHORITY]
        if AUTHORITY in names:
            raise CertificateError(
                f"{AUTHORITY} is not renewed: make a new folder before it runs out, and give each"
                " machine the new files"
            )
        issuer = None if by_plant else self.issuer()
        written = []
        for name in names:
            certificate, key = read_certificate(self.certificate(name)), read_key(self.key(name))
            holder = issuing.holder_of(certificate)
            if issuer is None:
                file, content = self.request(name), issuing.pem(issuing.request(holder, key))
            else:
                file, content = self.certificate(name), issuing.pem(issuing.issue(holder, key, issuer))
            replace_file(file, content)
            written.append(file)
        return written

    def listed(self) -> list[Listed]:
        """All certificates, the one that runs out first at the beginning."""
        listed = [about(self.certificate(name)) for name in self._names()]
        return sorted(listed, key=lambda each: each.until)

    def issuer(self) -> Issuer:
        """The CA; CertificateError if its key is not here."""
        if not self.key(AUTHORITY).exists():
            raise CertificateError(
                f"{self.key(AUTHORITY)} is not there: bring the key of the CA, or make requests for the"
                " plant's CA with --request"
            )
        return Issuer(read_certificate(self.certificate(AUTHORITY)), read_key(self.key(AUTHORITY)))

    def _names(self) -> list[str]:
        with _writing(self.path):
            return sorted(file.stem for file in self.path.iterdir() if file.suffix == ".pem")

    def _targets(self, name: str, by_plant: bool) -> tuple[Path, Path]:
        return self.key(name), self.request(name) if by_plant else self.certificate(name)

    def _check_absent(self, files: Iterable[Path]) -> None:
        for file in files:
            if file.exists():
                raise CertificateError(
                    f"{file} exists, and is not replaced: name another folder, or renew certificates"
                    " with `operator-panel pki renew`"
                )

    def _make_authority(self, name: str) -> Issuer:
        key = issuing.new_key()
        certificate = issuing.new_authority(name, key)
        write_new(self.key(AUTHORITY), issuing.key_pem(key), OWN)
        write_new(self.certificate(AUTHORITY), issuing.pem(certificate), PUBLIC)
        return Issuer(certificate, key)

    def _make(self, name: str, holder: Holder, issuer: Issuer | None) -> None:
        key = issuing.new_key()
        write_new(self.key(name), issuing.key_pem(key), OWN)
        if issuer is None:
            write_new(self.request(name), issuing.pem(issuing.request(holder, key)), PUBLIC)
        else:
            certificate = issuing.issue(holder, key, issuer)
            write_new(self.certificate(name), issuing.pem(certificate), PUBLIC)


def about(file: Path) -> Listed:
    """When a certificate runs out; CertificateError if it can't be read."""
    certificate = read_certificate(file)
    until = certificate.not_valid_after_utc
    days = (until - datetime.now(UTC)).total_seconds() / 86_400
    return Listed(file, issuing.common_name(certificate), until, days)


def read_certificate(file: Path) -> x509.Certificate:
    """The first certificate of a PEM file; CertificateError names the file."""
    with _writing(file):
        content = file.read_bytes()[:MOST_BYTES]
    try:
        return x509.load_pem_x509_certificate(content)
    except ValueError:
        raise CertificateError(f"{file} is not a certificate: it must be PEM") from None


def read_key(file: Path) -> Key:
    """A key without a password; CertificateError names the file."""
    with _writing(file):
        content = file.read_bytes()[:MOST_BYTES]
    try:
        key = serialization.load_pem_private_key(content, password=None)
    except (ValueError, TypeError):
        raise CertificateError(f"{file} is not a key: it must be PEM, without a password") from None
    if not isinstance(key, ec.EllipticCurvePrivateKey):
        raise CertificateError(f"{file} is not a key on an elliptic curve, as `pki` makes them")
    return key


def write_new(file: Path, content: bytes, mode: int) -> None:
    """Writes a file that is not there yet; never readable by others before its mode is set."""
    with _writing(file):
        descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, mode)
        with os.fdopen(descriptor, "wb") as opened:
            opened.write(content)


def replace_file(file: Path, content: bytes) -> None:
    """Puts a public file in the place of an older one, whole or not at all."""
    draft = file.with_name(f".{file.name}.new")
    with _writing(file):
        draft.unlink(missing_ok=True)
    write_new(draft, content, PUBLIC)
    with _writing(file):
        draft.replace(file)


@contextmanager
def _writing(file: Path) -> Iterator[None]:
    """OSError of the block becomes a CertificateError that names the file."""
    try:
        yield
    except OSError as error:
        raise CertificateError(f"{file}: {(error.strerror or str(error)).lower()}") from error

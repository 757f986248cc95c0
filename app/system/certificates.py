"""X.509 certificates: a small plant CA, the certificates of Zenoh and of the server, and when they
expire. Depends on neither Zenoh, HTTP nor the panel. A server without certificates does not import it:
cryptography's X.509 takes 3 MiB."""

import os
import ssl
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path
from typing import Final, Literal

from cryptography import x509
from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec, rsa
from cryptography.hazmat.primitives.asymmetric.types import PrivateKeyTypes, PublicKeyTypes
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from app.system.errors import KioskError
from app.system.whole_file import write_whole

# Makes keys, certificates and requests for them (X.509, ECDSA P-256). No I/O.

CA_DAYS: Final = 3650
DAYS: Final = 730
BEFORE: Final = timedelta(hours=1)  # a clock of another machine may be behind
LONGEST_NAME: Final = 64  # X.520
Purpose = Literal["client", "server"]
_USAGES: Final = {
    "client": ExtendedKeyUsageOID.CLIENT_AUTH,
    "server": ExtendedKeyUsageOID.SERVER_AUTH,
}
Key = ec.EllipticCurvePrivateKey


class CertificateError(KioskError):
    """A certificate or key that can't be read, made or used."""


@dataclass(frozen=True, slots=True)
class Holder:
    """Whom a certificate is for. `hosts` are names and addresses under which a server is reached."""

    name: str
    purpose: Purpose
    hosts: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Issuer:
    """A CA: its certificate and its key."""

    certificate: x509.Certificate
    key: PrivateKeyTypes


def new_key() -> Key:
    return ec.generate_private_key(ec.SECP256R1())


def key_pem(key: Key) -> bytes:
    return key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )


def pem(document: x509.Certificate | x509.CertificateSigningRequest) -> bytes:
    return document.public_bytes(serialization.Encoding.PEM)


def new_authority(name: str, key: Key) -> x509.Certificate:
    """The certificate of a CA, which signs those of holders and no other CA."""
    usage = _usage(signs=True)
    return (
        _builder(_subject(name), _subject(name), key.public_key(), CA_DAYS)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .sign(key, hashes.SHA256())
    )


def issue(holder: Holder, key: Key, issuer: Issuer | None, days: int = DAYS) -> x509.Certificate:
    """A holder's certificate, self-signed without an issuer. It ends no later than the issuer's."""
    subject = _subject(holder.name)
    signer = issuer.key if issuer else key
    if not isinstance(signer, ec.EllipticCurvePrivateKey):
        raise CertificateError("the key of the CA must be one on an elliptic curve: use --request")
    by = issuer.certificate.subject if issuer else subject
    latest = issuer.certificate.not_valid_after_utc if issuer else None
    builder = _builder(subject, by, key.public_key(), days, latest)
    builder = builder.add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
    builder = builder.add_extension(_usage(signs=False), critical=True)
    authority = signer.public_key()
    builder = builder.add_extension(
        x509.AuthorityKeyIdentifier.from_issuer_public_key(authority), critical=False
    )
    for extension in _extensions(holder):
        builder = builder.add_extension(extension, critical=False)
    return builder.sign(signer, hashes.SHA256())


def request(holder: Holder, key: Key) -> x509.CertificateSigningRequest:
    """What the plant's CA makes a certificate of."""
    builder = x509.CertificateSigningRequestBuilder().subject_name(_subject(holder.name))
    for extension in _extensions(holder):
        builder = builder.add_extension(extension, critical=False)
    return builder.sign(key, hashes.SHA256())


def holder_of(certificate: x509.Certificate) -> Holder:
    """Whom a certificate is for, to make the next one alike."""
    extensions = certificate.extensions
    usages: Iterable[x509.ObjectIdentifier] = ()
    hosts: Sequence[str] = ()
    for extension in extensions:
        if isinstance(extension.value, x509.ExtendedKeyUsage):
            usages = extension.value
        elif isinstance(extension.value, x509.SubjectAlternativeName):
            hosts = [str(each.value) for each in extension.value]
    purpose: Purpose = "server" if ExtendedKeyUsageOID.SERVER_AUTH in usages else "client"
    return Holder(common_name(certificate), purpose, tuple(hosts))


def common_name(certificate: x509.Certificate) -> str:
    """ "" without one."""
    for attribute in certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME):
        return str(attribute.value)
    return ""


def _subject(name: str) -> x509.Name:
    if not 0 < len(name) <= LONGEST_NAME:
        raise CertificateError(f'"{name}" is no name for a certificate: 1 to {LONGEST_NAME} characters')
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])


def _builder(
    subject: x509.Name,
    issuer: x509.Name,
    key: ec.EllipticCurvePublicKey,
    days: int,
    latest: datetime | None = None,
) -> x509.CertificateBuilder:
    now = datetime.now(UTC)
    end = now + timedelta(days=days)
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - BEFORE)
        .not_valid_after(min(end, latest) if latest else end)
    )


def _usage(*, signs: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=signs,
        crl_sign=signs,
        encipher_only=False,
        decipher_only=False,
    )


def _extensions(holder: Holder) -> list[x509.ExtensionType]:
    extensions: list[x509.ExtensionType] = [x509.ExtendedKeyUsage([_USAGES[holder.purpose]])]
    if holder.hosts:
        extensions.append(x509.SubjectAlternativeName([_host(host) for host in holder.hosts]))
    return extensions


def _host(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ip_address(host.strip("[]")))
    except ValueError:
        pass
    try:
        return x509.DNSName(host)
    except ValueError:
        raise CertificateError(f'"{host}" is neither a name nor an address of a machine') from None


# A folder with certificates, and their files: NAME.pem, NAME.key, NAME.csr. Keys are the owner's alone;
# what is there is not replaced, but by `renew`.

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
        """Makes the folder, for its owner alone; an existing one stays unchanged."""
        with _writing(self.path):
            self.path.mkdir(mode=0o700, parents=True, exist_ok=True)

    def add(self, name: str, holder: Holder, by_plant: bool) -> list[Path]:
        """Adds an item; see `make`."""
        files = self._targets(name, by_plant)
        self._check_absent(files)
        self._make(name, holder, None if by_plant else self.issuer())
        return list(files)

    def self_sign(self, name: str, holder: Holder, days: int) -> list[Path]:
        """Makes a key and its certificate without any CA."""
        files = self._targets(name, by_plant=False)
        self._check_absent(files)
        key = new_key()
        write_new(self.key(name), key_pem(key), OWN)
        certificate = issue(holder, key, None, days)
        write_new(self.certificate(name), pem(certificate), PUBLIC)
        return list(files)

    def renew_own(self, name: str, days: int, by_plant: bool) -> Path:
        """Makes a certificate again for the same key, signed by itself, or a request for it."""
        key = read_key(self.key(name))
        holder = holder_of(read_certificate(self.certificate(name)))
        if by_plant:
            file, content = self.request(name), pem(request(holder, key))
        else:
            certificate = issue(holder, key, None, days)
            file, content = self.certificate(name), pem(certificate)
        replace_file(file, content)
        return file

    def renew(self, names: Sequence[str], by_plant: bool) -> list[Path]:
        """Makes the certificates with these names again, for the same keys, or requests for them. All
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
            holder = holder_of(certificate)
            if issuer is None:
                file, content = self.request(name), pem(request(holder, key))
            else:
                file, content = self.certificate(name), pem(issue(holder, key, issuer))
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
        key = new_key()
        certificate = new_authority(name, key)
        write_new(self.key(AUTHORITY), key_pem(key), OWN)
        write_new(self.certificate(AUTHORITY), pem(certificate), PUBLIC)
        return Issuer(certificate, key)

    def _make(self, name: str, holder: Holder, issuer: Issuer | None) -> None:
        key = new_key()
        write_new(self.key(name), key_pem(key), OWN)
        if issuer is None:
            write_new(self.request(name), pem(request(holder, key)), PUBLIC)
        else:
            certificate = issue(holder, key, issuer)
            write_new(self.certificate(name), pem(certificate), PUBLIC)


def about(file: Path) -> Listed:
    """When a certificate runs out; CertificateError if it can't be read."""
    certificate = read_certificate(file)
    until = certificate.not_valid_after_utc
    days = (until - datetime.now(UTC)).total_seconds() / 86_400
    return Listed(file, common_name(certificate), until, days)


def read_file(file: Path) -> bytes:
    """The content of a certificate's or a key's file; CertificateError names the file."""
    with _writing(file), file.open("rb") as opened:
        return opened.read(MOST_BYTES)


def read_certificate(file: Path) -> x509.Certificate:
    """The first certificate of a PEM file; CertificateError names the file."""
    try:
        return x509.load_pem_x509_certificate(read_file(file))
    except ValueError:
        raise CertificateError(f"{file} is not a certificate: it must be PEM") from None


def read_key(file: Path) -> Key:
    """A key without a password; CertificateError names the file."""
    try:
        key = serialization.load_pem_private_key(read_file(file), password=None)
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
    with _writing(file):
        write_whole(file, content, mode=PUBLIC)


@contextmanager
def _writing(file: Path) -> Iterator[None]:
    """OSError of the block becomes a CertificateError that names the file."""
    try:
        yield
    except OSError as error:
        raise CertificateError(f"{file}: {(error.strerror or str(error)).lower()}") from error


# Why a certificate and its key can't be used for TLS: a sentence that names the file, the fault and the
# correction. In English, for the terminal, the server's log and the doctor.

LEAST_RSA_BITS: Final = 2048  # that OpenSSL and rustls accept
DER: Final = b"\x30"  # begins each document in DER
CERTIFICATE: Final = b"-----BEGIN CERTIFICATE-----"
PRIVATE: Final = b"PRIVATE KEY-----"


def pair_fault(certificate: Path, key: Path | None, password: str | None = None) -> str:
    """Why a server or client can't use a certificate with its key; "" if it can. `key` is None if it is
    in the certificate's file."""
    try:
        chain = _chain(certificate)
        own_key = _private_key(key or certificate, password)
        _check_pair(certificate, key or certificate, chain, own_key)
    except CertificateError as error:
        return str(error)
    return _refusal(certificate, key, password)


def authority_fault(file: Path) -> str:
    """Why the certificates of a CA can't be used to verify others; "" if they can."""
    try:
        _chain(file)
    except CertificateError as error:
        return str(error)
    return ""


def _chain(file: Path) -> list[x509.Certificate]:
    """All certificates of a file, in their order."""
    content = read_file(file)
    if content.startswith(DER):
        raise CertificateError(
            f"{file} is in DER, and PEM is needed: openssl x509 -inform DER -in {file} -out {file}.pem"
        )
    if CERTIFICATE not in content:
        content_name = "a private key" if PRIVATE in content else "no certificate"
        raise CertificateError(
            f"{file} has {content_name}: name the file that begins with -----BEGIN CERTIFICATE-----"
        )
    try:
        return x509.load_pem_x509_certificates(content)
    except ValueError as error:
        cut = f"{file} has a certificate that is cut or damaged: copy it again"
        raise CertificateError(cut) from error


def _private_key(file: Path, password: str | None) -> PrivateKeyTypes:
    content = read_file(file)
    if content.startswith(DER):
        raise CertificateError(
            f"{file} is in DER, and PEM is needed: openssl pkey -inform DER -in {file} -out {file}.pem"
        )
    if PRIVATE not in content:
        raise CertificateError(
            f"{file} has no private key: name the file that begins with -----BEGIN PRIVATE KEY-----"
        )
    try:
        return serialization.load_pem_private_key(content, password.encode() if password else None)
    except TypeError as error:
        raise CertificateError(
            f"{file} is encrypted, and a server that starts by itself has no password for it:"
            f" openssl pkey -in {file} -out {file}.plain, and let only its owner read that file"
        ) from error
    except (ValueError, UnsupportedAlgorithm) as error:
        raise CertificateError(f"{file} has a private key that can't be read: copy it again") from error


def _check_pair(
    certificate: Path, key: Path, chain: list[x509.Certificate], own_key: PrivateKeyTypes
) -> None:
    own = _public(own_key.public_key())
    if _public(chain[0].public_key()) != own:
        later = next((each for each in chain[1:] if _public(each.public_key()) == own), None)
        if later is not None:
            raise CertificateError(
                f"{certificate} begins with the certificate of {common_name(chain[0])}: that of"
                f" {common_name(later)}, to which {key} belongs, comes first, then its CA's"
            )
        raise CertificateError(
            f"{key} is not the key of the certificate in {certificate} ({common_name(chain[0])}):"
            " name the two files that were made together"
        )
    for each in chain:
        if bits := _weak(each.public_key()):
            raise CertificateError(
                f"{certificate} has an RSA key of {bits} bits ({common_name(each)}), which TLS refuses:"
                f" make it with {LEAST_RSA_BITS} bits or more, or with ECDSA P-256"
            )


def _public(key: PublicKeyTypes) -> bytes:
    return key.public_bytes(serialization.Encoding.DER, serialization.PublicFormat.SubjectPublicKeyInfo)


def _weak(key: PublicKeyTypes) -> int:
    """The bits of an RSA key that is too short, else 0."""
    return key.key_size if isinstance(key, rsa.RSAPublicKey) and key.key_size < LEAST_RSA_BITS else 0


def _refusal(certificate: Path, key: Path | None, password: str | None) -> str:
    """What OpenSSL itself refuses."""
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(certificate, key, password)
    except (OSError, ValueError) as error:
        return f"{certificate} can't be used for TLS: {_reason(error)}"
    return ""


def _reason(error: Exception) -> str:
    if isinstance(error, ssl.SSLError):
        return (error.reason or "no PEM").lower().replace("_", " ")
    return str(getattr(error, "strerror", None) or error).lower()

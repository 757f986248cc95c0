"""Makes keys, certificates and requests for them (X.509, ECDSA P-256). No I/O."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from typing import Final, Literal

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.types import PrivateKeyTypes
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from app.errors import KioskError

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

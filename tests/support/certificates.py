"""A small certificate authority, for one server on this machine; a Zenoh session with a certificate."""

import ipaddress
import json
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, NamedTuple

import zenoh
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID


class Certificates(NamedTuple):
    """The files of the authority's certificate, and of a server's with its key."""

    ca: Path
    server: Path
    key: Path


def make_certificates(folder: Path, address: str = "127.0.0.1") -> Certificates:
    """Certificates of a server at an IP address, valid for a day."""
    ca_key, key = ec.generate_private_key(ec.SECP256R1()), ec.generate_private_key(ec.SECP256R1())
    ca_name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "Tests")])
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "Broker")])
    begin = datetime.now(UTC) - timedelta(hours=1)

    def signed(subject: x509.Name, public: ec.EllipticCurvePublicKey, *, is_ca: bool) -> bytes:
        builder = (
            x509.CertificateBuilder()
            .subject_name(subject)
            .issuer_name(ca_name)
            .public_key(public)
            .serial_number(x509.random_serial_number())
            .not_valid_before(begin)
            .not_valid_after(begin + timedelta(days=1))
            .add_extension(x509.BasicConstraints(ca=is_ca, path_length=None), critical=True)
        )
        if not is_ca:
            host = x509.IPAddress(ipaddress.ip_address(address))
            builder = builder.add_extension(x509.SubjectAlternativeName([host]), critical=False)
        return builder.sign(ca_key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM)

    files = Certificates(folder / "ca.pem", folder / "server.pem", folder / "server.key")
    files.ca.write_bytes(signed(ca_name, ca_key.public_key(), is_ca=True))
    files.server.write_bytes(signed(name, key.public_key(), is_ca=False))
    files.key.write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
    )
    return files


def tls_session(endpoint: str, folder: Path, name: str = "") -> zenoh.Session:
    """A client that has the certificate `name` of the folder, or none."""
    config = zenoh.Config()
    tls: dict[str, Any] = {"root_ca_certificate": str(folder / "ca.pem")}
    if name:
        tls["connect_certificate"] = str(folder / f"{name}.pem")
        tls["connect_private_key"] = str(folder / f"{name}.key")
        tls["enable_mtls"] = True
    for place, value in {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "connect/timeout_ms": 3_000,
        "scouting/multicast/enabled": False,
        "transport/link/tls": tls,
    }.items():
        config.insert_json5(place, json.dumps(value))
    return zenoh.open(config)

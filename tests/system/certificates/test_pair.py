"""Certificates and keys that TLS can't use: what is wrong, and what would be right."""

from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec, rsa

from app.ros.zenoh.config import tls_files
from app.system.certificates import (
    Holder,
    Issuer,
    authority_fault,
    issue,
    key_pem,
    new_authority,
    new_key,
    pair_fault,
    pem,
)
from app.tools.cli.command import main

CA_KEY: Final = new_key()
CA: Final = new_authority("Plant", CA_KEY)
HOLDER: Final = Holder("panel1", "server", ("localhost",))
KEY: Final = new_key()
OWN: Final = issue(HOLDER, KEY, Issuer(CA, CA_KEY))
PEM: Final = serialization.Encoding.PEM
DER: Final = serialization.Encoding.DER
PKCS8: Final = serialization.PrivateFormat.PKCS8
WEAK: Final = rsa.generate_private_key(65537, 1024)


HALF_A_KEY: Final = key_pem(KEY)[:100] + b"\n-----END PRIVATE KEY-----\n"


def weak() -> bytes:
    """A certificate of an RSA key of 1024 bits."""
    builder = x509.CertificateBuilder().subject_name(OWN.subject).issuer_name(CA.subject)
    builder = builder.not_valid_before(OWN.not_valid_before_utc).serial_number(7)
    builder = builder.not_valid_after(OWN.not_valid_after_utc).public_key(WEAK.public_key())
    return builder.sign(CA_KEY, hashes.SHA256()).public_bytes(PEM)


def encrypted(key: ec.EllipticCurvePrivateKey) -> bytes:
    return key.private_bytes(PEM, PKCS8, serialization.BestAvailableEncryption(b"secret"))


class Files(NamedTuple):
    """What is in the files, and words of the sentence about it, "" where both can be used."""

    certificate: bytes
    key: bytes
    words: str


FILES: Final[dict[str, Files]] = {
    "both": Files(pem(OWN), key_pem(KEY), ""),
    "a chain": Files(pem(OWN) + pem(CA), key_pem(KEY), ""),
    "the CA first": Files(
        pem(CA) + pem(OWN), key_pem(KEY), "begins with the certificate of Plant: that of panel1"
    ),
    "another key": Files(pem(OWN), key_pem(CA_KEY), "is not the key of the certificate in"),
    "an encrypted key": Files(pem(OWN), encrypted(KEY), "is encrypted"),
    "an encrypted key of old": Files(
        pem(OWN),
        KEY.private_bytes(
            PEM,
            serialization.PrivateFormat.TraditionalOpenSSL,
            serialization.BestAvailableEncryption(b"secret"),
        ),
        "is encrypted",
    ),
    "a certificate in DER": Files(OWN.public_bytes(DER), key_pem(KEY), "openssl x509 -inform DER"),
    "a key in DER": Files(
        pem(OWN),
        KEY.private_bytes(DER, PKCS8, serialization.NoEncryption()),
        "openssl pkey -inform DER",
    ),
    "RSA 1024": Files(
        weak(), WEAK.private_bytes(PEM, PKCS8, serialization.NoEncryption()), "RSA key of 1024 bits"
    ),
    "the files interchanged": Files(key_pem(KEY), pem(OWN), "has a private key: name the file"),
    "twice the certificate": Files(pem(OWN), pem(OWN), "has no private key: name the file"),
    "an empty certificate": Files(b"", key_pem(KEY), "has no certificate"),
    "half a certificate": Files(pem(OWN)[:200], key_pem(KEY), "cut or damaged"),
    "half a key": Files(pem(OWN), HALF_A_KEY, "can't be read"),
}
BROKEN: Final = {name: files for name, files in FILES.items() if files.words}


@pytest.fixture
def written(tmp_path: Path) -> Callable[[Files], tuple[Path, Path]]:
    def write(files: Files) -> tuple[Path, Path]:
        certificate, key = tmp_path / "own.pem", tmp_path / "own.key"
        certificate.write_bytes(files.certificate)
        key.write_bytes(files.key)
        return certificate, key

    return write


@pytest.mark.parametrize("name", FILES)
def test_a_sentence_says_why_files_can_not_be_used(
    name: str, written: Callable[[Files], tuple[Path, Path]]
) -> None:
    fault = pair_fault(*written(FILES[name]))
    assert FILES[name].words in fault
    assert bool(fault) == bool(FILES[name].words), fault
    assert "\n" not in fault


@pytest.mark.parametrize("name", BROKEN)
def test_a_server_does_not_start_with_such_files_and_says_one_line(
    name: str, written: Callable[[Files], tuple[Path, Path]], capsys: pytest.CaptureFixture[str]
) -> None:
    certificate, key = written(BROKEN[name])
    tls = ["--ssl-certfile", str(certificate), "--ssl-keyfile", str(key)]
    assert main(["run", *tls]) == 1
    said = capsys.readouterr().err
    assert BROKEN[name].words in said
    assert said.count("\n") == 1


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    for fault in (pair_fault(tmp_path / "a.pem", None), authority_fault(tmp_path / "a.pem")):
        assert fault == f"{tmp_path / 'a.pem'}: no such file or directory"


@pytest.mark.parametrize("end", ["connect", "listen"])
def test_the_files_of_a_zenoh_configuration_are_checked(
    end: str, written: Callable[[Files], tuple[Path, Path]], tmp_path: Path
) -> None:
    config, authority = tmp_path / "zenoh.json5", tmp_path / "ca.pem"
    for name, files in FILES.items():
        certificate, key = written(files)
        authority.write_bytes(pem(CA))
        tls = f'{end}_certificate: "{certificate}", {end}_private_key: "{key}"'
        tls += f', root_ca_certificate: "{authority}"'
        config.write_text(f"{{ transport: {{ link: {{ tls: {{ {tls} }} }} }} }}")
        used = tls_files(config)
        assert used.certificates == [authority, certificate]
        (*faults,) = used.faults()
        assert len(faults) == bool(files.words), name
        assert all(files.words in fault for fault in faults)
    authority.write_bytes(CA.public_bytes(DER))
    assert "in DER" in tls_files(config).faults()[0]

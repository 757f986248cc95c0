"""`operator-panel pki`: what it makes, what it does not replace, and what it says."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
import zenoh
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey
from cryptography.x509.oid import ExtendedKeyUsageOID

from app.system.certificates import (
    PUBLIC,
    CertificateFolder,
    pem,
    read_certificate,
    read_key,
    write_new,
)
from app.tools.cli.command import main
from tests.support.panel_text import CELL

SERVER = ExtendedKeyUsageOID.SERVER_AUTH
TWO = CELL.replace(
    'namespace = "/cell9"',
    'robot = [{ id = "left", name = "Left", connect = ["tcp/192.0.2.1:7447"], dialect = "bridge" },'
    ' { id = "right", name = "Right", connect = ["tls/[2001:db8::5]:7447"], dialect = "rmw_zenoh" }]',
)


@pytest.fixture
def panel(tmp_path: Path) -> Path:
    path = tmp_path / "cell1.toml"
    path.write_text(CELL)
    return path


def made(panel: Path, *options: str) -> CertificateFolder:
    folder = panel.parent / "pki"
    assert main(["pki", "new", str(folder), "--panel", str(panel), *options]) == 0
    return CertificateFolder(folder)


def hosts(certificate: x509.Certificate | x509.CertificateSigningRequest) -> list[str]:
    names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    return [str(name.value) for name in names]


def test_a_new_folder_has_a_ca_and_what_it_signed(panel: Path) -> None:
    folder = made(panel, "--host", "192.0.2.10")
    authority = read_certificate(folder.certificate("ca"))
    for name, purpose in (("kiosk", ExtendedKeyUsageOID.CLIENT_AUTH), ("bridge", SERVER)):
        certificate = read_certificate(folder.certificate(name))
        certificate.verify_directly_issued_by(authority)
        usage = certificate.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
        assert list(usage) == [purpose]
        assert certificate.public_key() == read_key(folder.key(name)).public_key()
        assert certificate.not_valid_after_utc - datetime.now(UTC) > timedelta(days=729)
    assert hosts(read_certificate(folder.certificate("bridge")))[:2] == ["192.0.2.10", "localhost"]
    *first, last = [each.name for each in folder.listed()]  # by the second in which each runs out
    assert (sorted(first), last) == (["cell1-bridge", "cell1-kiosk"], "cell1 CA")


def test_keys_are_the_owners_alone(panel: Path) -> None:
    folder = made(panel)
    assert folder.path.stat().st_mode & 0o777 == 0o700
    keys = sorted(folder.path.glob("*.key"))
    assert [key.name for key in keys] == ["bridge.key", "ca.key", "kiosk.key"]
    assert {key.stat().st_mode & 0o777 for key in keys} == {0o600}


def test_nothing_is_replaced(panel: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = made(panel)
    before = {file: file.read_bytes() for file in folder.path.iterdir()}
    assert main(["pki", "new", str(folder.path), "--panel", str(panel)]) == 1
    assert main(["pki", "add", str(folder.path), "kiosk", "--client"]) == 1
    assert "is not replaced" in capsys.readouterr().err
    assert {file: file.read_bytes() for file in folder.path.iterdir()} == before


def test_each_robot_of_several_has_certificates(
    panel: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    panel.write_text(TWO)
    folder = made(panel)
    assert hosts(read_certificate(folder.certificate("bridge-left")))[0] == "192.0.2.1"
    assert hosts(read_certificate(folder.certificate("router-right")))[0] == "2001:db8::5"
    assert "must be over TLS: tls/192.0.2.1:7447" in capsys.readouterr().out


def test_a_renewed_certificate_has_the_same_key_and_names(panel: Path) -> None:
    folder = made(panel, "--host", "robot1.plant")
    before = read_certificate(folder.certificate("bridge"))
    assert main(["pki", "renew", str(folder.path)]) == 0
    after = read_certificate(folder.certificate("bridge"))
    after.verify_directly_issued_by(read_certificate(folder.certificate("ca")))
    assert after.serial_number != before.serial_number
    assert after.public_key() == before.public_key()
    assert (after.subject, hosts(after)) == (before.subject, hosts(before))
    assert main(["pki", "renew", str(folder.path), "ca"]) == 1


def test_the_plants_ca_can_sign(panel: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plant = made(panel)
    folder = CertificateFolder(panel.parent / "asked")
    options = ["--panel", str(panel), "--host", "robot1.plant", "--request"]
    assert main(["pki", "new", str(folder.path), *options]) == 0
    assert "the plant's CA makes NAME.pem of each NAME.csr" in capsys.readouterr().out
    assert sorted(file.name for file in folder.path.iterdir()) == [
        "bridge.csr",
        "bridge.key",
        "kiosk.csr",
        "kiosk.key",
        "zenoh.json5",
    ]
    asked = x509.load_pem_x509_csr(folder.request("bridge").read_bytes())
    assert asked.is_signature_valid
    assert hosts(asked)[0] == "robot1.plant"
    issuer, now = plant.issuer(), datetime.now(UTC)
    key = issuer.key
    assert isinstance(key, EllipticCurvePrivateKey)
    builder = x509.CertificateBuilder(extensions=list(asked.extensions)).subject_name(asked.subject)
    builder = builder.issuer_name(issuer.certificate.subject).public_key(asked.public_key())
    builder = builder.serial_number(1).not_valid_before(now).not_valid_after(now + timedelta(days=9))
    write_new(folder.certificate("bridge"), pem(builder.sign(key, hashes.SHA256())), PUBLIC)
    write_new(folder.certificate("ca"), plant.certificate("ca").read_bytes(), PUBLIC)
    capsys.readouterr()
    assert main(["pki", "list", str(folder.path)]) == 1
    assert "bridge.pem  cell1-bridge" in (out := capsys.readouterr().out)
    assert "9 days" in out
    assert main(["pki", "renew", str(folder.path), "bridge"]) == 1
    assert "bring the key of the CA" in capsys.readouterr().err
    assert main(["pki", "renew", str(folder.path), "bridge", "--request"]) == 0


def test_the_kiosks_configuration_is_one_of_zenoh(panel: Path) -> None:
    folder = made(panel, "--connect", "tcp/192.0.2.10:7447")
    config = zenoh.Config.from_file(folder.path / "zenoh.json5")
    assert config.get_json("connect/endpoints") == '["tls/192.0.2.10:7447"]'
    assert str(folder.key("kiosk")) in config.get_json("transport/link/tls/connect_private_key")


@pytest.mark.parametrize("command", ["bridge-config", "router-config"])
def test_tls_needs_the_files(command: str, panel: Path, capsys: pytest.CaptureFixture[str]) -> None:
    if command == "router-config":
        panel.write_text(f'dialect = "rmw_zenoh"\n{CELL}')
    assert main([command, str(panel), "--tls", str(panel.parent / "none")]) == 2
    assert "none/" in capsys.readouterr().err
    made(panel)
    if command == "router-config":
        with pytest.raises(SystemExit):
            main([command, str(panel), "--tls", str(panel.parent / "pki")])
        assert "--listen tls/" in capsys.readouterr().err
    else:
        assert main([command, str(panel), "--tls", str(panel.parent / "pki")]) == 0
        assert 'cert_common_names: ["cell1-kiosk"]' in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["new", "f", "--host", "a b\u00e9"], "neither a name nor an address"),
        (["new", "f", "--cell", "x" * 70], "is no name for a certificate"),
        (["list", "f"], "no such file"),
    ],
)
def test_a_mistake_is_named(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command, name, *options = arguments
    assert main(["pki", command, str(tmp_path / name), *options]) == 1
    assert words in capsys.readouterr().err

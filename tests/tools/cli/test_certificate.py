"""`operator-panel certificate`: what it makes, for whom and for how long."""

import socket
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.x509.oid import ExtendedKeyUsageOID

from app.system.certificates import CertificateFolder, common_name, read_certificate, read_key
from app.tools.cli.command import main
from tests.tools.cli.test_pki import hosts

HERE = ["localhost", "127.0.0.1", "::1"]


def test_a_certificate_signed_by_itself(tmp_path: Path) -> None:
    folder = CertificateFolder(tmp_path / "tls")
    options = ["--host", "panel1.local", "--host", "192.0.2.7", "--days", "90"]
    assert main(["certificate", str(folder.path), *options]) == 0
    certificate = read_certificate(folder.certificate("panel"))
    certificate.verify_directly_issued_by(certificate)
    assert hosts(certificate) == ["panel1.local", "192.0.2.7", *HERE]
    assert common_name(certificate) == "panel1.local"
    usage = certificate.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    assert list(usage) == [ExtendedKeyUsageOID.SERVER_AUTH]
    left = certificate.not_valid_after_utc - datetime.now(UTC)
    assert timedelta(days=89) < left <= timedelta(days=90)
    assert certificate.public_key() == read_key(folder.key("panel")).public_key()
    assert folder.key("panel").stat().st_mode & 0o777 == 0o600


def test_without_a_host_it_is_for_this_machine(tmp_path: Path) -> None:
    assert main(["certificate", str(tmp_path), "--common-name", "Cell 1"]) == 0
    certificate = read_certificate(tmp_path / "panel.pem")
    assert hosts(certificate) == list(dict.fromkeys([socket.gethostname(), *HERE]))
    assert common_name(certificate) == "Cell 1"


def test_a_request_is_for_the_plants_ca(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["certificate", str(tmp_path), "--host", "panel1.local", "--request"]) == 0
    assert "panel.pem of panel.csr" in capsys.readouterr().out
    request = x509.load_pem_x509_csr((tmp_path / "panel.csr").read_bytes())
    assert request.is_signature_valid
    assert isinstance(request.signature_hash_algorithm, hashes.SHA256)
    assert hosts(request) == ["panel1.local", *HERE]
    assert not (tmp_path / "panel.pem").exists()
    assert (tmp_path / "panel.key").stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize("by_plant", [False, True])
def test_a_renewed_one_has_the_same_key_and_hosts(tmp_path: Path, by_plant: bool) -> None:
    assert main(["certificate", str(tmp_path), "--host", "panel1.local"]) == 0
    before, key = read_certificate(tmp_path / "panel.pem"), (tmp_path / "panel.key").read_bytes()
    more = ["--request"] if by_plant else []
    assert main(["certificate", str(tmp_path), "--renew", *more]) == 0
    after = read_certificate(tmp_path / "panel.pem")
    assert (after.serial_number == before.serial_number) is by_plant
    assert hosts(after) == hosts(before)
    assert (tmp_path / "panel.key").read_bytes() == key
    assert (tmp_path / "panel.csr").exists() is by_plant


def test_nothing_is_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["certificate", str(tmp_path)]) == 0
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    for options in ([], ["--request"]):
        assert main(["certificate", str(tmp_path), *options]) == 1
        assert "is not replaced" in capsys.readouterr().err
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before


@pytest.mark.parametrize("days", ["0", "3651", "-1", "x"])
def test_it_is_valid_for_days(tmp_path: Path, days: str) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["certificate", str(tmp_path), "--days", days])
    assert ended.value.code == 2


def test_there_is_nothing_to_renew(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["certificate", str(tmp_path), "--renew"]) == 1
    assert "panel.key" in capsys.readouterr().err

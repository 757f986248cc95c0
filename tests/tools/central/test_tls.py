"""The central database over TLS: without a certificate of the named authority for its name, nothing is
sent."""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

from app.cell.forward.config import ConnectionConfig, ForwardConfig, read_forward
from app.cell.forward.forwarder import send_all
from tests.support.cell_data import CellData
from tests.support.certificates import Certificates, make_certificates
from tests.support.postgres import ROOT_USES, Cluster
from tests.tools.central.test_forwarding import code, config, counts

pytestmark = pytest.mark.promise("security")

STRANGER: Final = "127.0.0.2"  # the certificate's address is another one


def with_certificate(server: Cluster, files: Certificates) -> None:
    """Starts the cluster again with this certificate."""
    for name in ("server", "key"):
        copy = server.folder / f"tls-{name}"
        copy.unlink(missing_ok=True)
        shutil.copy(getattr(files, name), copy)
        copy.chmod(0o600)
        if os.geteuid() == 0:
            shutil.chown(copy, ROOT_USES)
    server.stop()
    about = {"ssl_cert_file": "tls-server", "ssl_key_file": "tls-key"}
    server.start("ssl=on", *(f"{name}={server.folder}/{file}" for name, file in about.items()))


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Certificates:
    return make_certificates(tmp_path_factory.mktemp("ca"))


@pytest.fixture
def encrypted(centre: Cluster, authority: Certificates) -> Iterator[Cluster]:
    with_certificate(centre, authority)
    yield centre
    centre.stop()
    centre.start()


def by_name(server: Cluster, ca: Path | None) -> ForwardConfig:
    """A connection as the shortest settings make it."""
    file = server.folder / "forward.toml"
    text = f"host=127.0.0.1 port={server.port} user=cell1 dbname=plant"
    file.write_text(
        f'[forward]\npanel = "cell 1"\npassword_file = "cell-password"\nstreams = ["log"]\n'
        f'connection = "{text}{f" sslrootcert={ca}" if ca else ""}"\n'
    )
    return read_forward(file)


def test_entries_go_to_a_server_with_its_certificate(
    encrypted: Cluster, authority: Certificates, tmp_path: Path
) -> None:
    CellData(tmp_path).press(5)
    settings = by_name(encrypted, authority.ca)
    assert settings.connection.is_encrypted
    assert send_all(settings, tmp_path).fault == ""
    assert counts(encrypted) == (5, 5)


@pytest.mark.parametrize("trusted", ["system", "another authority"])
def test_a_server_of_another_authority_gets_nothing(
    encrypted: Cluster, tmp_path: Path, trusted: str
) -> None:
    CellData(tmp_path).press(5)
    ca = make_certificates(tmp_path).ca if trusted != "system" else None
    status = send_all(by_name(encrypted, ca), tmp_path)
    assert code(status) == "forward_unreachable"
    assert "SSL error: " in str(status.fault)
    assert counts(encrypted) == (0, 0)


def test_a_server_with_the_certificate_of_another_address_gets_nothing(
    encrypted: Cluster, tmp_path: Path
) -> None:
    files = make_certificates(tmp_path, STRANGER)
    with_certificate(encrypted, files)
    CellData(tmp_path / "data").press(5)
    status = send_all(by_name(encrypted, files.ca), tmp_path / "data")
    assert code(status) == "forward_unreachable"
    assert "does not match host name" in str(status.fault)
    assert counts(encrypted) == (0, 0)


def test_a_server_without_tls_gets_nothing(
    centre: Cluster, authority: Certificates, tmp_path: Path
) -> None:
    CellData(tmp_path).press(5)
    status = send_all(by_name(centre, authority.ca), tmp_path)
    assert code(status) == "forward_unreachable"
    assert "does not support SSL" in str(status.fault)


def test_a_password_that_everyone_can_read_is_refused(centre: Cluster, tmp_path: Path) -> None:
    CellData(tmp_path).press(5)
    secret = tmp_path / "secret"
    secret.write_text("x")
    secret.chmod(0o644)
    for file, sentence in (
        (secret, "forward_password_open"),
        (tmp_path / "none", "forward_password_file"),
    ):
        keys = centre.config("cell1").keys
        own = config(centre, connection=ConnectionConfig(keys=keys, password_file=file))
        assert code(send_all(own, tmp_path)) == sentence

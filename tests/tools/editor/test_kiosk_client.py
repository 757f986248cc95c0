"""A kiosk is asked over HTTP: the token goes only where it may, and each failure has its sentence."""

import hashlib
import json
import ssl
import threading
import zipfile
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from io import BytesIO
from pathlib import Path
from typing import Final

import pytest

from app.system.texts import Text
from app.tools.editor.kiosk_client import KioskClient, KioskRefused, packed
from tests.support.certificates import Certificates, make_certificates

TOKEN: Final = "opt_secret"


class Answers(BaseHTTPRequestHandler):
    """Answers each path by the table; keeps the tokens that it got."""

    tokens: Final[list[str]] = []
    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:
        self.tokens.append(self.headers.get("authorization", ""))
        status, body = {
            "/panel": (200, b'{"title": "Cell", "version": "1"}'),
            "/moved/panel": (302, b""),
            "/page/panel": (200, b"<html>"),
            "/denied/panel": (403, b'{"error": "Needs the role engineer."}'),
            "/cut/panel": (200, None),
        }[self.path]
        if body is None:
            self.wfile.write(b"HTTP/1.1 200 OK\r\nContent-Length: 100\r\n\r\n{")
            self.close_connection = True
            return
        self.send_response(status)
        self.send_header("location", "https://192.0.2.1/panel")
        self.send_header("content-length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *arguments: object) -> None:
        """Nothing."""


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Certificates:
    return make_certificates(tmp_path_factory.mktemp("tls"))


@pytest.fixture
def address(certificates: Certificates) -> Iterator[str]:
    Answers.tokens.clear()
    server = ThreadingHTTPServer(("127.0.0.1", 0), Answers)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificates.server, certificates.key)
    server.socket = context.wrap_socket(server.socket, server_side=True)
    thread = threading.Thread(target=server.serve_forever, args=(0.05,))
    thread.start()
    yield f"https://127.0.0.1:{server.server_address[1]}"
    server.shutdown()
    thread.join()
    server.server_close()


def pin(certificates: Certificates) -> str:
    der = ssl.PEM_cert_to_DER_cert(certificates.server.read_text())
    digest = hashlib.sha256(der).hexdigest().upper()
    return ":".join(digest[at : at + 2] for at in range(0, 64, 2))


# What the certificate is compared with, and the code of the refusal.
TRUST: Final[dict[str, tuple[Callable[[Certificates], str], str]]] = {
    "the authority": (lambda files: str(files.ca), ""),
    "the certificate": (pin, ""),
    "another certificate": (lambda _: "0" * 64, "send_other_certificate"),
    "this system": (lambda _: "", "send_certificate"),
    "a file that is not there": (lambda files: f"{files.ca}.old", "send_trust"),
    "a key": (lambda files: str(files.key), "send_trust"),
}


@pytest.mark.parametrize(("trust", "code"), TRUST.values(), ids=TRUST)
def test_token_goes_to_a_trusted_kiosk_only(
    address: str, certificates: Certificates, trust: Callable[[Certificates], str], code: str
) -> None:
    if not code:
        answer = KioskClient(address, TOKEN, trust(certificates)).panel()
        assert answer["title"] == "Cell"
        assert Answers.tokens == [f"Bearer {TOKEN}"]
        return
    with pytest.raises(KioskRefused) as refused:
        KioskClient(address, TOKEN, trust(certificates)).panel()
    assert isinstance(refused.value.text, Text)
    assert refused.value.text.code == code
    assert Answers.tokens == []


ANSWERS: Final = {
    "moved": ("send_status", False),
    "page": ("send_status", False),
    "denied": ("Needs the role engineer.", False),
    "cut": ("send_lost", True),
}


@pytest.mark.parametrize(("path", "expected"), ANSWERS.items(), ids=ANSWERS)
def test_answers_of_what_is_no_kiosk(
    address: str, certificates: Certificates, path: str, expected: tuple[str, bool]
) -> None:
    client = KioskClient(f"{address}/{path}/", TOKEN, str(certificates.ca))
    with pytest.raises(KioskRefused) as refused:
        client.panel()
    text = refused.value.text
    assert (text.code if isinstance(text, Text) else text, refused.value.is_lost) == expected
    assert len(Answers.tokens) == 1


# Address and token, and the code of the refusal.
ADDRESSES: Final = {
    "http://192.0.2.7:8000": (TOKEN, "send_without_tls"),
    "http://panel1.local": (TOKEN, "send_without_tls"),
    "panel1.local:8000": (TOKEN, "send_address"),
    "ftp://panel1.local": (TOKEN, "send_address"),
    "https://anna:pw@panel1.local": (TOKEN, "send_address"),
    "https://panel1.local/?token=1": (TOKEN, "send_address"),
    "https://panel1.local:99999": (TOKEN, "send_address"),
    "https://panel1.local": ("", "send_token"),
    "https://panel2.local": ("a b", "send_token"),
    "https://panel3.local": ("a\r\nx: y", "send_token"),
    "http://127.0.0.1:1": (TOKEN, "send_unreachable"),
}


@pytest.mark.parametrize(("address", "expected"), ADDRESSES.items(), ids=ADDRESSES)
def test_addresses_and_tokens_that_are_refused(address: str, expected: tuple[str, str]) -> None:
    token, code = expected
    with pytest.raises(KioskRefused) as refused:
        KioskClient(address, token).panel()
    assert isinstance(refused.value.text, Text)
    assert refused.value.text.code == code
    assert "opt_" not in json.dumps(refused.value.text.as_json())


def test_archive_has_what_the_panel_names(tmp_path: Path) -> None:
    panel = tmp_path / "cell1.toml"
    panel.write_text('title = "Cell"\npictures = "pictures"\n')
    (tmp_path / "pictures").mkdir()
    picture = '<svg xmlns="http://www.w3.org/2000/svg"/>'
    (tmp_path / "pictures/press.svg").write_text(picture)
    (tmp_path / "secret.txt").write_text("not named")
    with zipfile.ZipFile(BytesIO(packed(panel))) as archive:
        assert sorted(archive.namelist()) == ["panel.toml", "pictures/press.svg"]
        assert archive.read("panel.toml").decode() == panel.read_text()
    panel.write_text('title = "Cell"\npictures = "../outside"\n')
    with pytest.raises(KioskRefused, match="is not below its own folder"):
        packed(panel)

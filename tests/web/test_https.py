"""A panel over HTTPS: its cookies, and its certificate, which is renewed while it runs."""

import socket
import ssl
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import httpx
import pytest
from cryptography import x509

from app.tools.cli.command import main
from tests.support.parts import ROOT, Process, Stream, free_port, until
from tests.web.test_own_alarms import PAGE

pytestmark = pytest.mark.promise("neighbours")

KEPT_S: Final = 60.0


class Https:
    """A panel with a certificate of its own, in a demo."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.port = folder / "tls", free_port()
        assert main(["certificate", str(self.folder)]) == 0
        (folder / "cell.toml").write_text(PAGE)
        self.certificate = self.folder / "panel.pem"
        words = [sys.executable, "-m", "app.cli", "run", str(folder / "cell.toml"), "--mode", "demo"]
        words += ["--port", str(self.port), "--data", str(folder / "data")]
        words += ["--ssl-certfile", str(self.certificate)]
        words += ["--ssl-keyfile", str(self.folder / "panel.key")]
        self.process = Process(words, {}, cwd=str(ROOT))
        self.url = f"https://127.0.0.1:{self.port}"
        self.http = httpx.Client(base_url=self.url, verify=False, timeout=KEPT_S)

    def serial(self) -> int:
        """That of the certificate that a new connection gets."""
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        with (
            socket.create_connection(("127.0.0.1", self.port), timeout=KEPT_S) as plain,
            context.wrap_socket(plain) as wrapped,
        ):
            return x509.load_der_x509_certificate(wrapped.getpeercert(True) or b"").serial_number

    def alarms(self) -> dict[str, dict[str, Any]]:
        return {alarm["id"]: alarm for alarm in self.http.get("/alarms").json()["alarms"]}


@pytest.fixture
def panel(tmp_path: Path) -> Iterator[Https]:
    mine = Https(tmp_path)
    try:
        until(lambda: "the panel is at" in mine.process.text or not mine.process.running, "it listens")
        assert mine.process.running, mine.process.text
        yield mine
    finally:
        mine.http.close()
        mine.process.end()


def test_a_renewed_certificate_is_served_without_a_restart(panel: Https) -> None:
    """A stream of events that began before goes on."""
    before = panel.serial()
    with panel.http.stream("GET", "/events") as response:
        stream = Stream(response)
        stream.next("beat")
        assert main(["certificate", str(panel.folder), "--renew"]) == 0
        renewed = x509.load_pem_x509_certificate(panel.certificate.read_bytes()).serial_number
        assert renewed != before
        until(lambda: panel.serial() == renewed, "new connections get the new one")
        for _ in range(3):
            stream.next("beat")
    assert "panel.pem was loaded again, valid until " in panel.process.text
    assert panel.alarms() == {}


@pytest.mark.long("detail")
def test_a_broken_certificate_leaves_the_old_one(panel: Https) -> None:
    """A key that is another's, too: the server says so, in its log and by an alarm, and goes on."""
    before, key = panel.serial(), panel.folder / "panel.key"
    whole, own_key = panel.certificate.read_bytes(), key.read_bytes()
    panel.certificate.write_bytes(whole[: len(whole) // 2])
    alarm = until(lambda: panel.alarms().get("panel_certificate"), "the alarm is raised")
    assert (alarm["state"], alarm["priority"]) == ("active", 2)
    assert str(panel.certificate) in alarm["cause"]
    assert "cut or damaged" in panel.process.text
    assert panel.serial() == before
    other = panel.folder.parent / "other"
    assert main(["certificate", str(other)]) == 0
    panel.certificate.write_bytes((other / "panel.pem").read_bytes())
    until(lambda: "is not the key of the certificate in" in panel.process.text, "the pair does not fit")
    assert panel.serial() == before
    key.write_bytes((other / "panel.key").read_bytes())
    until(lambda: panel.serial() != before, "the whole pair is taken")
    until(lambda: panel.alarms()["panel_certificate"]["state"] == "returned", "the alarm returns")
    assert own_key != key.read_bytes()


def test_the_browsers_cookie_is_bound_to_the_host(panel: Https) -> None:
    """One of a version before, without the prefix, is the same browser."""
    opened = {"sec-fetch-dest": "document", "sec-fetch-site": "none", "accept": "text/html"}
    first = panel.http.get("/", headers=opened)
    (header,) = (each for each in first.headers.get_list("set-cookie") if "browser" in each)
    assert header.startswith("__Host-panel_browser=")
    assert {"Secure", "HttpOnly", "Path=/"} <= {part.strip() for part in header.split(";")}
    assert "domain" not in header.lower()
    token = first.cookies["__Host-panel_browser"]

    with httpx.Client(base_url=panel.url, verify=False, timeout=KEPT_S) as old:
        moved = old.get("/", headers={**opened, "cookie": f"panel_browser={token}"})
        assert moved.cookies["__Host-panel_browser"] == token
        both = {**opened, "cookie": f"panel_browser={'0' * 32}; __Host-panel_browser={token}"}
        old.cookies.clear()
        assert "set-cookie" not in old.get("/", headers=both).headers

"""A kiosk over HTTP: reads what it shows and its panel file, has another one checked, and sends that.

A token is sent only over TLS whose certificate is trusted, or to this machine. It is in no address and
in no file.
"""

import hashlib
import hmac
import io
import json
import re
import secrets
import ssl
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from http.client import (
    HTTPConnection,
    HTTPException,
    HTTPResponse,
    HTTPSConnection,
    IncompleteRead,
)
from ipaddress import ip_address
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

from app.records.sent_panel import SENT_NAME
from app.system.errors import InputError, SettingsError, os_error_text
from app.system.texts import TextLike, say
from app.tools.install.panel_files import copies_for

PIN: Final = re.compile(r"[0-9a-f]{64}")
WITHIN_S: Final = 15.0
CHECK_WITHIN_S: Final = 90.0
MOST_ANSWER: Final = 8_000_000  # bytes
LONGEST_TOKEN: Final = 200
TOKEN: Final = re.compile(r"[\x21-\x7e]+")


class KioskRefused(InputError):
    """The kiosk has refused, with its sentence, or can't be reached. `is_lost`: whether it got the
    request is not known. `status` is that of its answer, 0 without one."""

    def __init__(self, message: TextLike, *, is_lost: bool = False, status: int = 0) -> None:
        super().__init__(message)
        self.is_lost = is_lost
        self.status = status


class KioskClient:
    """Each request has a connection of its own. Blocks."""

    def __init__(self, address: str, token: str | None, trust: str = "", language: str = "en") -> None:
        """`trust` is the file of a certificate authority, or the SHA-256 of the kiosk's certificate; ""
        for the system's authorities. Without a token (None) it is a client that is not signed in.
        KioskRefused for an address or a token that can't be used."""
        self._headers = {"accept": "application/json", "accept-language": language}
        self._token = None if token is None else token.strip()
        try:
            parsed = urlsplit(address.strip())
            self._host, self._port = parsed.hostname or "", parsed.port
        except ValueError:
            raise KioskRefused(say("send_address", address=address[:80])) from None
        has_more = parsed.username or parsed.password or parsed.query or parsed.fragment
        if parsed.scheme not in ("http", "https") or not self._host or has_more:
            raise KioskRefused(say("send_address", address=address[:80]))
        if parsed.scheme == "http" and not is_loopback(self._host):
            raise KioskRefused(say("send_without_tls", host=self._host))
        if self._token is not None and (
            not TOKEN.fullmatch(self._token) or len(self._token) > LONGEST_TOKEN
        ):
            raise KioskRefused(say("send_token"))
        self._root = parsed.path.rstrip("/")
        self._is_tls = parsed.scheme == "https"
        self._pin = trust.replace(":", "").replace(" ", "").lower()
        self._context = self._tls_context(trust.strip()) if self._is_tls else None

    def _tls_context(self, trust: str) -> ssl.SSLContext:
        if PIN.fullmatch(self._pin):  # the certificate itself is compared, before anything is sent
            context = ssl.create_default_context()
            context.check_hostname = False
            context.verify_mode = ssl.CERT_NONE
            return context
        self._pin = ""
        try:
            return ssl.create_default_context(cafile=str(Path(trust).expanduser()) if trust else None)
        except (OSError, ValueError) as error:
            raise KioskRefused(say("send_trust", file=trust[:200], why=str(error))) from error

    def panel(self) -> dict[str, Any]:
        """What the kiosk shows, and the last panel that was sent to it."""
        return self._json("GET", "/panel")

    def check(self, archive: bytes) -> dict[str, Any]:
        """What the kiosk says of a zip file with a panel and its files."""
        headers = {"content-type": "application/zip"}
        return self._json("POST", "/panel/check", archive, headers, CHECK_WITHIN_S)

    def take(self, sent: str, compared: str, act_id: str) -> dict[str, Any]:
        """The receipt of the take of what was checked: the same id again is the same take."""
        body = json.dumps({"sent": sent, "compared": compared, "id": act_id}).encode()
        headers = {"content-type": "application/json"}
        return self._json("POST", "/panel/take", body, headers, CHECK_WITHIN_S)

    def readiness(self) -> str:
        """Why commands can't reach the robot; "" if they can."""
        status, content = self._request("GET", "/readyz", None, {}, WITHIN_S)
        return "" if status == 200 else str(content.get("reason", status))

    def session(self) -> dict[str, Any]:
        """Who this client is, and whether the panel has users."""
        return self._json("GET", "/session")

    def text(self, path: str, within_s: float = WITHIN_S) -> str:
        """An answer that is text, such as the operator's log as CSV."""
        with self._answer(path, within_s) as response:
            return response.read(MOST_ANSWER).decode(errors="replace")

    @contextmanager
    def lines(self, path: str, within_s: float) -> Iterator[Iterator[bytes]]:
        """The lines of a stream, until it ends. KioskRefused if it is refused, is lost, or has no line
        for `within_s`."""
        with self._answer(path, within_s) as response:
            yield iter(response.readline, b"")

    @contextmanager
    def _answer(self, path: str, within_s: float) -> Iterator[HTTPResponse]:
        connection = self._connected(within_s)
        try:
            connection.request("GET", self._root + path, None, self._headers | self._bearer)
            response = connection.getresponse()
            if response.status != 200:
                raise _refusal(response.status, _content(response))
            yield response
        except (OSError, HTTPException) as error:
            raise self._lost(error) from error
        finally:
            connection.close()

    @property
    def _bearer(self) -> dict[str, str]:
        return {} if self._token is None else {"authorization": f"Bearer {self._token}"}

    def _json(
        self,
        method: str,
        path: str,
        body: bytes | None = None,
        headers: dict[str, str] | None = None,
        within_s: float = WITHIN_S,
    ) -> dict[str, Any]:
        status, content = self._request(method, path, body, self._bearer | (headers or {}), within_s)
        if "outcome" in content and "act" in content:  # a receipt, also of what was refused
            return content
        if status != 200 or not content:
            raise _refusal(status, content)
        return content

    def _request(
        self, method: str, path: str, body: bytes | None, headers: dict[str, str], within_s: float
    ) -> tuple[int, dict[str, Any]]:
        connection = self._connected(within_s)
        try:
            connection.request(method, self._root + path, body, self._headers | headers)
            response = connection.getresponse()
            return response.status, _content(response)
        except (OSError, HTTPException) as error:
            raise self._lost(error) from error
        finally:
            connection.close()

    def _lost(self, error: OSError | HTTPException) -> KioskRefused:
        why = os_error_text(error) if isinstance(error, OSError) else str(error)
        return KioskRefused(say("send_lost", host=self._host, why=why), is_lost=True)

    def _connected(self, within_s: float) -> HTTPConnection:
        """A connection to the kiosk itself; nothing was sent yet."""
        connection: HTTPConnection = HTTPConnection(self._host, self._port, timeout=within_s)
        if self._is_tls:
            connection = HTTPSConnection(
                self._host, self._port, timeout=within_s, context=self._context
            )
        try:
            connection.connect()
        except ssl.SSLCertVerificationError as error:
            why = error.verify_message or str(error)
            raise KioskRefused(say("send_certificate", host=self._host, why=why)) from error
        except OSError as error:
            connection.close()
            raise KioskRefused(
                say("send_unreachable", host=self._host, why=os_error_text(error)), is_lost=True
            ) from error
        if self._pin and isinstance(connection.sock, ssl.SSLSocket):
            shown = hashlib.sha256(connection.sock.getpeercert(True) or b"").hexdigest()
            if not hmac.compare_digest(shown, self._pin):
                connection.close()
                raise KioskRefused(say("send_other_certificate", host=self._host, shown=shown))
        return connection


def is_loopback(host: str) -> bool:
    """Whether a host is this machine, by its name alone."""
    try:
        return host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False


def _refusal(status: int, content: Mapping[str, Any]) -> KioskRefused:
    reason = content.get("error") or content.get("reason")
    said = str(reason) if reason else say("send_status", status=str(status))
    return KioskRefused(said, status=status)


def _content(response: HTTPResponse) -> dict[str, Any]:
    data = response.read(MOST_ANSWER)
    if response.length:
        raise IncompleteRead(data, response.length)
    try:
        content = json.loads(data)
    except ValueError:
        return {}
    return content if isinstance(content, dict) else {}


def packed(panel: Path) -> bytes:
    """A panel file with what it names beside itself, as a zip file. KioskRefused for what can't go
    with it."""
    data = io.BytesIO()
    try:
        with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr(SENT_NAME, panel.read_bytes())
            names: set[str] = set()
            for copy in copies_for(panel, ""):
                for name in copy.files:
                    if name not in names:
                        archive.writestr(name, copy.source.read(name))
                    names.add(name)
    except SettingsError as error:
        raise KioskRefused(str(error)) from error
    except OSError as error:
        raise KioskRefused(os_error_text(error)) from error
    return data.getvalue()


def new_act_id() -> str:
    return secrets.token_hex(16)

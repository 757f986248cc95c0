"""Secrets that are entered everywhere are in no answer, log, recording, support bundle, fault parcel or
file."""

import gzip
import io
import secrets as random_secrets
import zipfile
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

import httpx
import pytest
from mcap.reader import make_reader

from app.tools.cli.command import main
from tests.support.confirmed import PANEL
from tests.support.parts import until
from tests.support.servers import demo_server
from tests.support.users import Browsers, add_user, token_of

pytestmark = pytest.mark.promise("security")

PIN_CANARY = "830461957"
PASSWORD_CANARY = "canary-password-7f3a"
BADGE_CANARY = "CANARYBADGE04A2"
SECOND_CANARY = "640281937"
WRONG = ("770461953", "canary-wrong-91bc", "CANARYWRONG77")
NEW = ("6140283957", "canary-changed-5d20", "CANARYNEWBADGE3")
PAGES = (
    "/users",
    "/users?name=K.+Novak",
    "/",
    "/signin",
    "/signin?user=M.+Sato",
    "/log",
    "/log.csv",
    "/metrics",
    "/help",
    "/openapi.json",
)


def confirmed_presses(browser: httpx.Client) -> Iterator[httpx.Response]:
    """The answers to confirmations with each secret, right and wrong, and to their presses."""
    inputs = {"heat": 300}
    for way, secret in (
        *(("pin", pin) for pin in (PIN_CANARY, WRONG[0])),
        *(("password", password) for password in (PASSWORD_CANARY, WRONG[1])),
        *(("badge", badge) for badge in (BADGE_CANARY, WRONG[2])),
    ):
        body = {"inputs": inputs, way: secret}
        answer = browser.post("/widgets/start/confirm", json=body)
        yield answer
        yield browser.post("/widgets/start/confirm", json={**body, "more": secret})
        token = answer.json().get("confirmation", "")
        yield browser.post("/widgets/start", json={"inputs": inputs, "confirmation": token})
        yield browser.post("/widgets/start", json={"inputs": inputs, "confirmation": secret})
        yield browser.post("/widgets/start", json={"inputs": inputs, way: secret})
        page = {"heat": "300", "_page": "main", "_id": random_secrets.token_hex(8)}
        yield browser.post("/widgets/start", data={**page, f"_{way}": secret, "_enter": "yes"})
    second = {"user": "K. Novak", "pin": SECOND_CANARY}
    token = browser.post("/widgets/bypass/confirm", json=second).json()["confirmation"]
    yield browser.post("/widgets/bypass", json={"inputs": {}, "confirmation": token})


def unpacked(content: bytes) -> bytes:
    """What a file has, with what is packed in it."""
    if content[:2] == b"\x1f\x8b":
        return gzip.decompress(content)
    if content[:2] == b"PK":
        with zipfile.ZipFile(io.BytesIO(content)) as bundle:
            return b"\n".join(unpacked(bundle.read(name)) for name in bundle.namelist())
    if content[:5] == b"\x89MCAP":
        with io.BytesIO(content) as file:
            reader = make_reader(file)
            messages = (message.data for _, _, message in reader.iter_messages())
            return b"\n".join((content, *messages))
    return content


def test_no_secret_is_anywhere(browsers: Browsers, tmp_path: Path) -> None:
    data = tmp_path / "data"
    data.mkdir(mode=0o700)
    add_user(data, "M. Sato", "engineer", pin=PIN_CANARY, password=PASSWORD_CANARY, badge=BADGE_CANARY)
    add_user(data, "K. Novak", "engineer", pin=SECOND_CANARY)
    token = token_of(data, "line", "engineer")
    secrets = (PIN_CANARY, PASSWORD_CANARY, BADGE_CANARY, SECOND_CANARY, token, *WRONG, *NEW)
    shown = []
    panel = f"{PANEL}\n[record]\n"
    with demo_server(tmp_path, panel, KIOSK_DATA=str(data), KIOSK_LOG_LEVEL="debug") as server:
        browser = browsers.opened(server.url)
        for way, right, wrong in zip(("pin", "password", "badge"), secrets, WRONG, strict=False):
            for secret in (wrong, right):
                body = {"user": "M. Sato", way: secret} if way != "badge" else {way: secret}
                for sent in ({"json": body}, {"data": body}, {"json": {**body, "more": secret}}):
                    answer = browser.post("/session", **sent)  # type: ignore[arg-type]
                    shown.append(f"{answer.text} {answer.headers}")
        browser.post("/session", json={"user": "M. Sato", "pin": PIN_CANARY}).raise_for_status()
        for answer in confirmed_presses(browser):
            shown.append(f"{answer.text} {answer.headers} {answer.url}")
        recorded = unpacked(browser.get("/recordings/last.mcap").raise_for_status().content)
        answer = browser.post("/diagnostics/bundle", json={})
        bundle = unpacked(answer.raise_for_status().content)
        assert b"confirm" in bundle
        shown += [recorded.decode("latin-1"), bundle.decode("latin-1")]
        shown += [browser.get(path).text for path in PAGES]
        for way, secret in zip(("pin", "password", "badge"), NEW, strict=True):
            for name in ("K. Novak", "Nobody"):
                body = {"name": name, "role": "operator", way: secret}
                form = {"name": name, "role": "operator", "way": way, "secret": secret}
                for act in ("add", way):
                    for sent in ({"json": body}, {"data": form}, {"json": {**body, "more": secret}}):
                        answer = browser.post(f"/users/{act}", **sent)  # type: ignore[arg-type]
                        shown.append(f"{answer.text} {answer.headers}")
        shown += [browser.get(path, headers={"accept": "text/html"}).text for path in PAGES]
        program = browsers.new(server.url)
        for bearer in (token, token + "x"):
            headers = {"authorization": f"Bearer {bearer}"}
            shown += [program.get(path, headers=headers).text for path in PAGES]
        until(lambda: "sign_in" in browser.get("/log.csv").text, "logged")
        session = browser.cookies.get("panel_session") or ""
        assert session
        output = server.process.text
        shown.append(output)
    parcel = tmp_path / "fault.zip"
    at = datetime.now().isoformat()
    command = [
        "parcel",
        str(tmp_path / "cell.toml"),
        "--data",
        str(data),
        "--at",
        at,
        "-o",
        str(parcel),
    ]
    assert main(command) == 0
    shown.append(unpacked(parcel.read_bytes()).decode("latin-1"))
    kept = b"".join(unpacked(path.read_bytes()) for path in data.rglob("*.mcap"))
    assert b"Confirmed by M. Sato and K. Novak" in kept
    for secret in secrets:
        assert [text[:200] for text in shown if secret in text] == []
    for secret in (*secrets, session):
        assert secret not in output
        for path in data.rglob("*"):
            if path.is_file():
                assert secret.encode() not in unpacked(path.read_bytes()), path

"""Secrets that are entered everywhere are in no answer, log, recording or file."""

import gzip
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.parts import ROOT, Server, until
from tests.support.servers import ready
from tests.support.users import Browsers, add_user, token_of

PIN_CANARY = "830461957"
PASSWORD_CANARY = "canary-password-7f3a"
BADGE_CANARY = "CANARYBADGE04A2"
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


@pytest.fixture
def browsers() -> Iterator[Browsers]:
    every = Browsers()
    yield every
    every.close()


def test_no_secret_is_anywhere(browsers: Browsers, tmp_path: Path) -> None:
    data = tmp_path / "data"
    data.mkdir(mode=0o700)
    add_user(data, "M. Sato", "engineer", pin=PIN_CANARY, password=PASSWORD_CANARY, badge=BADGE_CANARY)
    token = token_of(data, "line", "engineer")
    secrets = (PIN_CANARY, PASSWORD_CANARY, BADGE_CANARY, token, *WRONG, *NEW)
    shown = []
    with ready(
        Server(ROOT, KIOSK_DATA=str(data), KIOSK_MODE="demo", KIOSK_LOG_LEVEL="debug")
    ) as server:
        browser = browsers.opened(server.url)
        for way, right, wrong in zip(("pin", "password", "badge"), secrets, WRONG, strict=False):
            for secret in (wrong, right):
                body = {"user": "M. Sato", way: secret} if way != "badge" else {way: secret}
                for sent in ({"json": body}, {"data": body}, {"json": {**body, "more": secret}}):
                    answer = browser.post("/session", **sent)  # type: ignore[arg-type]
                    shown.append(f"{answer.text} {answer.headers}")
        for digit in PIN_CANARY:
            answer = browser.post("/session/pad", data={"user": "M. Sato", "digit": digit})
            shown.append(f"{answer.text} {answer.headers}")
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
    for secret in secrets:
        assert [text[:200] for text in shown if secret in text] == []
    for secret in (*secrets, session):
        assert secret not in output
        for path in data.rglob("*"):
            if path.is_file():
                content = path.read_bytes()
                packed = gzip.decompress(content) if content[:2] == b"\x1f\x8b" else content
                assert secret.encode() not in packed, path

"""What the panel says of its own PC: a VEX file and a newer release beside the panel file, and
the room of the operator's log."""

import json
import re
import time
from collections.abc import Iterator
from html import unescape
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import httpx
import pytest

from tests.records.test_room import fill
from tests.support.parts import ROOT, Server, until
from tests.support.servers import ready
from tests.support.signed import Signer
from tests.support.users import Browsers, add_user, log_rows
from tests.system.test_vex import document, product, statement
from tests.tools.install.test_plan import make_wheel

PANEL: Final = 'title = "Cell"\nmode = "demo"\n[[page]]\nid = "a"\ntitle = "A"\n'
PASSWORD: Final = "long enough"
FORM: Final = {"accept": "text/html"}
FASTAPI: Final = f"pkg:pypi/fastapi@{version('fastapi')}"


class Cell:
    """A server with an engineer, and what lies beside its panel file."""

    def __init__(self, folder: Path, more: str = "") -> None:
        self.folder = folder
        self.signer = Signer(folder / "keys")
        data = folder / "data"
        data.mkdir(mode=0o700, exist_ok=True)
        (folder / "cell.toml").write_text(PANEL.replace("[[page]]", f"{more}[[page]]"))
        add_user(data, "J. Brandt", "engineer", password=PASSWORD)
        add_user(data, "M. Sato", "operator", pin="2580")
        self.server = self.started()

    def started(self) -> Server:
        environment: dict[str, Any] = {
            "KIOSK_DATA": str(self.folder / "data"),
            "KIOSK_PANEL": str(self.folder / "cell.toml"),
            "TEST_RELEASE_KEYS": str(self.signer.public),
        }
        return ready(Server(ROOT, app="tests.support.apps.pinned:app", **environment))

    def vex(self, status: str, **more: Any) -> Path:
        """Beside the panel file, not signed yet."""
        file = self.folder / "vex.json"
        meant = product("pkg:pypi/operator-panel", FASTAPI)
        file.write_text(json.dumps(document(statement(status, meant, **more))))
        return file


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[Cell]:
    mine = Cell(tmp_path)
    with mine.server:
        yield mine


@pytest.fixture
def engineer(cell: Cell, browsers: Browsers) -> httpx.Client:
    return browsers.signed_in(cell.server.url, "J. Brandt", password=PASSWORD)


def row(client: httpx.Client, name: str) -> dict[str, Any]:
    """A row of the page of diagnostics; empty without it."""
    rows = client.get("/diagnostics").raise_for_status().json()["machine"]
    return next((each for each in rows if each["id"] == name), {})


def test_a_weakness_of_what_is_installed_is_told_to_those_who_maintain_the_panel(
    cell: Cell, engineer: httpx.Client, browsers: Browsers
) -> None:
    until(lambda: row(engineer, "time"), "the machine was read")
    assert row(engineer, "weaknesses") == {}
    cell.signer.sign(cell.vex("affected", action_statement="Update to 0.2.1."))
    until(lambda: row(engineer, "weaknesses").get("state") == "problem", "the weakness is told")
    told = row(engineer, "weaknesses")
    assert told["text"] == "1"
    for words in (f"CVE-2026-1 (fastapi {version('fastapi')})", "Update to 0.2.1.", "sbom --check"):
        assert words in told["reason"]
    assert "machine-notes" in engineer.get("/", headers=FORM, follow_redirects=True).text
    assert "CVE-2026-1" in unescape(engineer.get("/diagnostics", headers=FORM).text)
    operator = browsers.signed_in(cell.server.url, "M. Sato", pin="2580")
    page = operator.get("/", headers=FORM, follow_redirects=True)
    assert page.status_code == 200
    assert "machine-notes" not in page.text
    assert "kiosk_weaknesses 1.0" in cell.server.http.get("/metrics").text
    logged = [each for each in log_rows(engineer) if each["action"] == "diagnostics_vex"]
    assert [each["kind"] for each in logged] == ["diagnostics"]
    assert "CVE-2026-1" in logged[0]["reason"]


def test_what_is_not_affected_is_told_too(cell: Cell, engineer: httpx.Client) -> None:
    cell.signer.sign(cell.vex("under_investigation"))
    until(lambda: row(engineer, "weaknesses"), "the file is read")
    told = row(engineer, "weaknesses")
    assert (told["state"], told["text"], told["about"]) == ("ok", "0", "Still examined: 1.")
    assert "machine-notes" not in engineer.get("/", headers=FORM, follow_redirects=True).text


def test_a_file_without_a_signature_that_fits_is_not_believed(
    cell: Cell, engineer: httpx.Client
) -> None:
    file = cell.vex("affected", action_statement="Give me your password.")
    until(lambda: row(engineer, "weaknesses"), "the file is seen")
    assert row(engineer, "weaknesses")["state"] == "unknown"
    assert "is not signed" in row(engineer, "weaknesses")["reason"]
    Signer(cell.folder / "others").sign(file)
    until(lambda: "trusted is" in row(engineer, "weaknesses")["reason"], "the other key is told")
    assert "password" not in row(engineer, "weaknesses")["reason"]
    cell.signer.sign(file)
    until(lambda: row(engineer, "weaknesses")["state"] == "problem", "the signature fits")


def postponed(client: httpx.Client, status: int = 200, **body: Any) -> dict[str, Any]:
    answer = client.post("/diagnostics/postpone", json=body)
    assert answer.status_code == status, answer.text
    receipt: dict[str, Any] = answer.json()
    return receipt


def notes(client: httpx.Client) -> bool:
    return "machine-notes" in client.get("/", headers=FORM, follow_redirects=True).text


def test_a_newer_release_is_told_and_an_engineer_postpones_it(
    cell: Cell, engineer: httpx.Client, browsers: Browsers
) -> None:
    wheel = make_wheel(cell.folder / "updates", "99.2.0")
    until(lambda: row(engineer, "release"), "the wheel is seen")
    assert row(engineer, "release")["state"] == "unknown"
    assert not notes(engineer)
    cell.signer.sign(wheel)
    until(lambda: row(engineer, "release")["state"] == "note", "the signature is seen")
    told = row(engineer, "release")
    assert told["text"] == "99.2.0"
    assert f"sudo operator-panel update {wheel}" in told["reason"]
    assert notes(engineer)
    operator = browsers.signed_in(cell.server.url, "M. Sato", pin="2580")
    assert not notes(operator)
    assert operator.post("/diagnostics/postpone", json={"version": "99.2.0"}).status_code == 403
    assert postponed(engineer, 409, version="99.1.0")["code"] == "release_gone"
    assert postponed(engineer, 422, version="99.2.0", days=31)
    form = {"id": "a" * 16, "page": "view=links", "version": "99.2.0", "days": "7"}
    assert engineer.post("/diagnostics/postpone", data=form, headers=FORM).status_code == 303
    assert not notes(engineer)
    assert row(engineer, "release")["about"].endswith("by J. Brandt.")
    logged = [each for each in log_rows(engineer) if each["action"] == "diagnostics_postpone"]
    assert [(each["who"], each["outcome"]) for each in logged] == [
        ("M. Sato", "refused"),
        ("J. Brandt", "refused"),
        ("J. Brandt", "succeeded"),
    ]
    releases = [each for each in log_rows(engineer) if each["action"] == "diagnostics_release"]
    assert "Version 99.2.0" in releases[-1]["reason"]


def test_what_is_postponed_stays_so_over_a_restart_and_ends_with_another_release(
    cell: Cell, engineer: httpx.Client, browsers: Browsers
) -> None:
    cell.signer.sign(make_wheel(cell.folder / "updates", "99.2.0"))
    until(lambda: row(engineer, "release"), "the release is seen")
    postponed(engineer, version="99.2.0", days=30)
    cell.server.end()
    with cell.started() as again:
        engineer = browsers.signed_in(again.url, "J. Brandt", password=PASSWORD)
        until(lambda: row(engineer, "release"), "the release is seen")
        assert row(engineer, "release")["about"].startswith("Postponed until ")
        assert not notes(engineer)
        cell.signer.sign(make_wheel(cell.folder / "updates", "99.3.0"))
        until(lambda: row(engineer, "release")["text"] == "99.3.0", "the other one is seen")
        assert row(engineer, "release")["about"] == ""
        assert notes(engineer)


def test_a_log_without_room_for_its_days_is_told_with_its_figures(
    tmp_path: Path, browsers: Browsers
) -> None:
    (tmp_path / "data").mkdir(mode=0o700)
    fill(tmp_path / "data", time.time() - 8 * 86_400, 4000)
    cell = Cell(tmp_path, "[log]\ndays = 36500\nsize_mb = 8\n")
    with cell.server as server:
        engineer = browsers.signed_in(server.url, "J. Brandt", password=PASSWORD)
        until(lambda: row(engineer, "log-room"), "the log is measured")
        told = row(engineer, "log-room")
        assert told["state"] == "problem"
        assert "for 36500 days" in told["reason"]
        assert re.search(r"\b50\d entries a day", told["about"]), told
        assert notes(engineer)
        logged = [each for each in log_rows(engineer) if each["action"] == "diagnostics_log_room"]
        assert len(logged) == 1

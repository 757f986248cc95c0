"""What the panel says of its own PC: a VEX file beside the panel file, signed by the real minisign."""

import json
from collections.abc import Iterator
from html import unescape
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import httpx
import pytest

from tests.support.parts import ROOT, Server, until
from tests.support.servers import ready
from tests.support.users import Browsers, add_user, log_rows
from tests.system.test_vex import document, product, statement
from tests.tools.install.test_minisign import Signer

pytestmark = pytest.mark.usefixtures("minisign")

PANEL: Final = 'title = "Cell"\nmode = "demo"\n[[page]]\nid = "a"\ntitle = "A"\n'
PASSWORD: Final = "long enough"
FORM: Final = {"accept": "text/html"}
FASTAPI: Final = f"pkg:pypi/fastapi@{version('fastapi')}"


class Cell:
    """A server with an engineer, and what lies beside its panel file."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.signer = Signer(folder / "keys")
        data = folder / "data"
        data.mkdir(mode=0o700)
        (folder / "cell.toml").write_text(PANEL)
        add_user(data, "J. Brandt", "engineer", password=PASSWORD)
        add_user(data, "M. Sato", "operator", pin="2580")
        environment: dict[str, Any] = {
            "KIOSK_DATA": str(data),
            "KIOSK_PANEL": str(folder / "cell.toml"),
            "KIOSK_TEST_KEYS": str(self.signer.public),
        }
        self.server = ready(Server(ROOT, app="tests.support.apps.pinned:app", **environment))

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

"""`make dev`: the server starts again with what is saved; a fault in the panel file is a page."""

import os
import shlex
import shutil
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.support.parts import ROOT, Server

FOLDERS = ("app", "templates", "static")
PATTERNS = ("*.toml", "*.json5", "*.html", "*.css", "*.js", "*.po", "*.msg", "*.srv", "*.action")
RELOAD = ["--reload", *(f"--reload-dir={name}" for name in FOLDERS)]
RELOAD += [f"--reload-include={pattern}" for pattern in PATTERNS]
STARTED_MS = 30_000  # on a busy machine


class Checkout:
    """A copy of the project's sources, served as `make dev` serves them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in FOLDERS:
            shutil.copytree(ROOT / name, folder / name)
        shutil.copy(ROOT / "zenoh.json5", folder)
        self.server = Server(
            folder,
            KIOSK_DEV="1",
            options=RELOAD,
        )

    def edit(self, name: str, old: str, new: str) -> None:
        path = self.folder / name
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))


def made(**environment: str) -> str:
    """What `make dev` runs."""
    env = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MAKELEVEL")}
    command = ["make", "--dry-run", "--no-print-directory", "dev"]
    return subprocess.run(
        command, cwd=ROOT, env=env | environment, capture_output=True, text=True, check=True
    ).stdout


def test_make_dev_serves_as_these_tests_do() -> None:
    last = made().strip().splitlines()[-1]
    assert "KIOSK_DEV=1" in last
    assert shlex.split(last.partition("uvicorn ")[2]) == ["app.main:app", *RELOAD]


def test_make_dev_watches_the_folder_of_another_panel(tmp_path: Path) -> None:
    assert f"--reload-dir={tmp_path} " in made(KIOSK_PANEL=str(tmp_path / "cell1.toml"))


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Checkout]:
    """One for all: each test takes its changes back, but the last."""
    mine = Checkout(tmp_path_factory.mktemp("checkout"))
    yield mine
    mine.server.end(signal.SIGINT)


def test_a_panel_with_a_fault_is_a_page_that_says_where_until_it_is_mended(
    checkout: Checkout, page: Page
) -> None:
    page.goto(checkout.server.url)
    expect(page.get_by_role("button", name="Publish1")).to_be_visible()
    checkout.edit("app/panel.toml", 'kind = "readout"', 'kind = "readuot" # <b>')
    fault = 'page[0].group[0].widget[1].kind "last_heard", line 43: unknown kind "readuot"'
    expect(page.locator("li").first).to_contain_text(fault, timeout=STARTED_MS)
    expect(page.locator("h1")).to_contain_text("app/panel.toml can't be used:")
    answer = checkout.server.http.get("/pages/operation")
    assert (answer.status_code, answer.headers["refresh"]) == (503, "1")
    assert checkout.server.http.get("/", headers={"host": "elsewhere"}).status_code == 403
    checkout.edit("app/panel.toml", 'kind = "readuot" # <b>', 'kind = "readout"')
    expect(page.get_by_role("button", name="Publish1")).to_be_visible(timeout=STARTED_MS)


@pytest.mark.parametrize("fault", ["{% endblok %}", "{{ page.titel }}", "{{ 1 + words }}"])
def test_a_template_with_a_fault_is_reported_and_the_page_comes_back_by_itself(
    checkout: Checkout, page: Page, fault: str
) -> None:
    page.goto(checkout.server.url)
    checkout.edit("templates/screen.html", "<main>", f"<main>{fault}")
    expect(page.locator("body")).to_contain_text("templates/screen.html", timeout=STARTED_MS)
    checkout.edit("templates/screen.html", f"<main>{fault}", "<main>")
    expect(page.get_by_role("button", name="Publish1")).to_be_visible(timeout=STARTED_MS)


def test_every_kind_of_change_reaches_an_open_browser(checkout: Checkout, page: Page) -> None:
    page.goto(checkout.server.url)
    expect(page.get_by_role("button", name="Publish1")).to_be_visible()
    checkout.edit("app/panel.toml", 'label = "Publish1"', 'label = "Pick up"')
    expect(page.get_by_role("button", name="Pick up")).to_be_visible(timeout=STARTED_MS)
    checkout.edit("templates/screen.html", ">{{ page.title }}</h2>", ">A new heading</h2>")
    expect(page.get_by_role("heading", name="A new heading")).to_be_visible(timeout=STARTED_MS)
    checkout.edit("static/css/tokens.css", "--ground: #bbc2c8", "--ground: #123456")
    expect(page.locator("body")).to_have_css("background-color", "rgb(18, 52, 86)", timeout=STARTED_MS)
    checkout.edit("app/i18n/en.po", 'msgstr "Server"', 'msgstr "Changed server"')
    expect(page.locator('[data-lamp="server"]')).to_contain_text("Changed server", timeout=STARTED_MS)


def test_it_starts_with_a_faulty_panel_and_shows_the_fault(tmp_path: Path, page: Page) -> None:
    panel = tmp_path / "panel.toml"
    panel.write_text('title = "Half a panel"\n')
    options = [*RELOAD, f"--reload-dir={tmp_path}"]
    mine = Server(ROOT, options=options, KIOSK_DEV="1", KIOSK_PANEL=str(panel))
    try:
        page.goto(mine.url)
        expect(page.locator("li")).to_contain_text("page: is missing")
        panel.write_text((ROOT / "app/panel.toml").read_text())
        expect(page.get_by_role("button", name="Publish1")).to_be_visible(timeout=STARTED_MS)
    finally:
        mine.end(signal.SIGINT)


def test_in_production_nothing_is_watched(tmp_path: Path) -> None:
    panel = tmp_path / "panel.toml"
    shutil.copy(ROOT / "app/panel.toml", panel)
    mine = Server(ROOT, KIOSK_PANEL=str(panel))
    try:
        opened = Path(f"/proc/{mine.process.pid}/fd").iterdir()
        assert not [fd for fd in opened if fd.is_symlink() and "inotify" in str(fd.readlink())]
    finally:
        mine.end()

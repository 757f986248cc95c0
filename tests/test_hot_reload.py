"""`make dev`: what is saved takes effect, and a fault in the panel file keeps the old panel."""

import os
import shutil
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.support.parts import ROOT, Server

RELOAD = ["--reload", "--reload-dir", "app"]


class Checkout:
    """A copy of the project's sources, served as `make dev` serves them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in ("app", "templates", "static"):
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


def test_make_dev_serves_as_these_tests_do() -> None:
    made = subprocess.run(
        ["make", "--dry-run", "--no-print-directory", "dev"],
        cwd=ROOT,
        env={
            name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MAKELEVEL")
        },
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert "KIOSK_DEV=1" in made
    assert "uvicorn app.main:app --ws-max-size" in made
    assert made.rstrip().endswith(f" {' '.join(RELOAD)}")


@pytest.fixture
def checkout(tmp_path: Path) -> Iterator[Checkout]:
    mine = Checkout(tmp_path)
    yield mine
    mine.server.end(signal.SIGINT)


def test_every_kind_of_change_reaches_an_open_browser(checkout: Checkout, page: Page) -> None:
    page.goto(checkout.server.url)
    expect(page.get_by_role("button", name="Publish1")).to_be_visible()
    checkout.edit("app/panel.toml", 'label = "Publish1"', 'label = "Pick up"')
    expect(page.get_by_role("button", name="Pick up")).to_be_visible()
    checkout.edit("templates/screen.html", "<h2>{{ page.title }}</h2>", "<h2>A new heading</h2>")
    expect(page.get_by_role("heading", name="A new heading")).to_be_visible()
    checkout.edit("static/css/tokens.css", "--ground: #d8dbde", "--ground: #123456")
    expect(page.locator("body")).to_have_css("background-color", "rgb(18, 52, 86)")
    checkout.edit("app/i18n/en.py", '"server": "Server"', '"server": "Changed server"')
    expect(page.locator('[data-lamp="server"]')).to_contain_text("Changed server", timeout=15_000)


def test_a_panel_with_a_fault_keeps_the_old_one_and_shows_the_fault(
    checkout: Checkout, page: Page
) -> None:
    page.goto(checkout.server.url)
    fault = page.locator("#fault")
    expect(fault).to_be_hidden()
    checkout.edit("app/panel.toml", 'kind = "readout"', 'kind = "readuot"')
    expect(fault).to_contain_text(
        'page[0].widget[4].kind "last_heard", line 54: unknown kind "readuot"'
    )
    expect(page.get_by_role("button", name="Publish1")).to_be_visible()
    assert checkout.server.press("operation", "still works").status_code == 200
    checkout.edit("app/panel.toml", 'kind = "readuot"', 'kind = "readout"')
    expect(fault).to_be_hidden()


@pytest.mark.parametrize("fault", ["{% endblok %}", "{{ page.titel }}", "{{ 1 + words }}"])
def test_a_template_with_a_fault_is_told_and_the_page_comes_back_by_itself(
    checkout: Checkout, page: Page, fault: str
) -> None:
    page.goto(checkout.server.url)
    checkout.edit("templates/screen.html", "<main>", f"<main>{fault}")
    expect(page.locator("body")).to_contain_text("templates/screen.html")
    checkout.edit("templates/screen.html", f"<main>{fault}", "<main>")
    expect(page.get_by_role("button", name="Publish1")).to_be_visible()


def test_it_starts_with_a_faulty_panel_and_shows_the_fault(tmp_path: Path, page: Page) -> None:
    panel = tmp_path / "panel.toml"
    panel.write_text('title = "Half a panel"\n')
    mine = Server(ROOT, KIOSK_DEV="1", KIOSK_PANEL=str(panel))
    try:
        page.goto(mine.url)
        expect(page.locator("#fault")).to_contain_text("page: is missing")
        panel.write_text((ROOT / "app/panel.toml").read_text())
        expect(page.get_by_role("button", name="Publish1")).to_be_visible()
    finally:
        mine.end()


def test_in_production_nothing_is_watched(tmp_path: Path) -> None:
    panel = tmp_path / "panel.toml"
    shutil.copy(ROOT / "app/panel.toml", panel)
    mine = Server(ROOT, KIOSK_PANEL=str(panel))
    try:
        opened = Path(f"/proc/{mine.process.pid}/fd").iterdir()
        assert not [fd for fd in opened if fd.is_symlink() and "inotify" in str(fd.readlink())]
    finally:
        mine.end()

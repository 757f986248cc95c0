"""`make dev`: the server starts again with what is saved; a fault in the panel file is a page."""

import os
import shlex
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect
from uvicorn import Config
from uvicorn.supervisors.watchfilesreload import FileFilter

from tests.support.parts import ENOUGH_S, REFERENCE, ROOT, Server

FOLDERS = ("app", "templates", "static")
PATTERNS = (
    "*.toml",
    "*.json",
    "*.json5",
    "*.html",
    "*.css",
    "*.js",
    "*.po",
    "*.msg",
    "*.srv",
    "*.action",
    "*.sql",
)
RELOAD = ["--reload", *(f"--reload-dir={name}" for name in FOLDERS)]
RELOAD += [f"--reload-include={pattern}" for pattern in PATTERNS]
NO_SOURCES = {"", ".pyc", ".svg", ".woff2", ".LICENSE"}
PANEL = "cell/panel.toml"
FAULT = ('kind = "readout"', 'kind = "readuot" # <b>')
SCREEN = "templates/screen.html"
# What is said of each.
TEMPLATE_FAULTS = {
    "{% endblok %}": "unknown tag 'endblok'",
    "{{ page.titel }}": "no attribute 'titel'",
    "{{ 1 + words }}": "unsupported operand",
}
STARTED_MS = 2000 * ENOUGH_S
# Its scripts run and have an event of the server. A page whose scripts did not load never reloads.
FOLLOWS = """() => {
    const [{ responseEnd }] = performance.getEntriesByType("navigation");
    return window.operatorPanel && operatorPanel.eventAgeMs() < performance.now() - responseEnd;
}"""


class Checkout:
    """A copy of the project's sources, served as `make dev` serves them, with a panel of another folder
    that has a fault at first."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in FOLDERS:
            shutil.copytree(ROOT / name, folder / name)
        shutil.copy(ROOT / "zenoh.json5", folder)
        cell = folder / "cell"
        cell.mkdir()
        shutil.copy(REFERENCE, cell / "panel.toml")
        self.edit("cell/panel.toml", *FAULT)
        options = [*RELOAD, f"--reload-dir={cell}"]
        self.server = Server(
            folder, KIOSK_DEV="1", KIOSK_PANEL=str(cell / "panel.toml"), options=options
        )

    def edit(self, name: str, old: str, new: str) -> None:
        path = self.folder / name
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))

    @contextmanager
    def one_change(self) -> Iterator[None]:
        """The watcher, which runs in the server's first process, finds all edits at once."""
        self.server.process.send(signal.SIGSTOP)
        try:
            yield
        finally:
            self.server.process.send(signal.SIGCONT)


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


def test_each_kind_of_file_is_watched() -> None:
    config = Config("app.main:app", reload=True, reload_dirs=[*FOLDERS], reload_includes=[*PATTERNS])
    accepts = FileFilter(config)
    files = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*") if path.is_file()]
    sources = {path for path in files if path.suffix not in NO_SOURCES}
    assert len(sources) > 400
    assert {path for path in sources if not accepts(path)} == set()


@pytest.fixture
def checkout(tmp_path: Path) -> Iterator[Checkout]:
    mine = Checkout(tmp_path)
    yield mine
    mine.server.end(signal.SIGINT)


@pytest.mark.long("detail")
def test_open_browser_shows_the_saved_panel_or_its_fault(checkout: Checkout, page: Page) -> None:
    page.goto(checkout.server.url)
    check_panels_fault(checkout, page)
    checkout.edit(PANEL, *reversed(FAULT))
    expect(page.get_by_role("button", name="Publish1")).to_be_visible(timeout=STARTED_MS)
    page.wait_for_function(FOLLOWS, timeout=STARTED_MS)
    good = "<main>"
    for fault, words in TEMPLATE_FAULTS.items():
        checkout.edit(SCREEN, good, good := f"<main>{fault}")
        expect(page.locator("body")).to_contain_text(words, timeout=STARTED_MS)
        expect(page.locator("body")).to_contain_text(SCREEN)
    with checkout.one_change():
        checkout.edit(SCREEN, good, "<main>")
        checkout.edit(SCREEN, ">{{ page.title }}</h2>", ">A new heading</h2>")
        checkout.edit(PANEL, 'label = "Publish1"', 'label = "Pick up"')
        checkout.edit("static/css/tokens.css", "--ground: #bbc2c8", "--ground: #123456")
        checkout.edit("app/system/texts/en.po", 'msgstr "Server"', 'msgstr "Changed server"')
    expect(page.get_by_role("button", name="Pick up")).to_be_visible(timeout=STARTED_MS)
    expect(page.get_by_role("heading", name="A new heading")).to_be_visible(timeout=STARTED_MS)
    expect(page.locator("body")).to_have_css("background-color", "rgb(18, 52, 86)", timeout=STARTED_MS)
    expect(page.locator('[data-lamp="server"]')).to_contain_text("Changed server", timeout=STARTED_MS)


def check_panels_fault(checkout: Checkout, page: Page) -> None:
    """The fault is a page that says where, and is asked for again until it is mended."""
    fault = 'page[0].group[0].widget[1].kind "last_heard", line 42: unknown kind "readuot"'
    expect(page.locator("li").first).to_contain_text(fault)
    expect(page.locator("h1")).to_contain_text("panel.toml can't be used:")
    answer = checkout.server.http.get("/pages/operation")
    assert (answer.status_code, answer.headers["refresh"]) == (503, "1")
    assert checkout.server.http.get("/", headers={"host": "elsewhere"}).status_code == 403


def test_in_production_nothing_is_watched(tmp_path: Path) -> None:
    panel = tmp_path / "panel.toml"
    shutil.copy(REFERENCE, panel)
    mine = Server(ROOT, KIOSK_PANEL=str(panel))
    try:
        opened = []
        for path in Path(f"/proc/{mine.process.pid}/fd").iterdir():
            with suppress(FileNotFoundError):  # closed by now
                opened.append(str(path.readlink()))
        assert opened
        assert not [name for name in opened if "inotify" in name]
    finally:
        mine.end()

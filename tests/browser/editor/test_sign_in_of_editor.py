"""The sign-in of the editor beyond this machine, in the browser."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.editor.test_shared_editor import enter
from tests.browser.test_accessibility import ALL, AXE, RUN
from tests.support.certificates import make_certificates
from tests.support.editor import PANEL, EditorServer, box_of, middle
from tests.support.users import add_user

PASSWORD: Final = "correct horse"


@pytest.fixture(scope="module")
def editor(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EditorServer]:
    folder = tmp_path_factory.mktemp("editor")
    certificates, users = make_certificates(folder), folder / "users"
    for name in ("Ada", "Ben"):
        add_user(users, name, "engineer", password=PASSWORD)
    file: Path = folder / "cell.toml"
    file.write_text(PANEL)
    tls = ("--ssl-certfile", str(certificates.server), "--ssl-keyfile", str(certificates.key))
    beyond = ("--host", "0.0.0.0", *tls, "--users", str(users))
    editor = EditorServer(file, *beyond, engineer=f"Ben:{PASSWORD}")
    yield editor
    editor.end()


def sign_in(page: Page, name: str, password: str) -> None:
    """Fills in the page by the keyboard; the name is focused, or the password where a name is there."""
    if not page.get_by_label("Name").input_value():
        expect(page.get_by_label("Name")).to_be_focused()
        page.keyboard.type(name)
        page.keyboard.press("Tab")
        page.keyboard.press("Tab")
    expect(page.get_by_label("Password or PIN")).to_be_focused()
    page.keyboard.type(password)
    page.keyboard.press("Enter")


def test_engineer_signs_in_by_keyboard_edits_and_signs_out(
    chromium: Browser, editor: EditorServer
) -> None:
    viewport: Any = {"width": 1440, "height": 900}
    with (
        chromium.new_context(viewport=viewport, locale="en", ignore_https_errors=True) as first,
        chromium.new_context(viewport=viewport, locale="en", ignore_https_errors=True) as second,
    ):
        page, other = first.new_page(), second.new_page()
        for each in (page, other):
            each.goto(editor.address)
            expect(each).to_have_title("Sign in to the editor: cell.toml")
        sign_in(page, "Ada", "wrong horse")
        expect(page.get_by_role("alert")).to_contain_text("The user or the password is wrong.")
        sign_in(page, "Ada", PASSWORD)
        expect(page.locator("#frames iframe:not(.coming)")).to_be_visible()
        sign_in(other, "Ben", PASSWORD)
        expect(other.locator("#frames iframe:not(.coming)")).to_be_visible()
        page.mouse.click(*middle(box_of(page, "#at-speed")))
        expect(other.locator(".ring.other .tag")).to_have_text("Ada: readout: speed")
        enter(page, "Label, English", "Belt")
        page.keyboard.press("Control+s")
        expect(page.locator("#status")).to_have_text("Saved")
        shared = page.context.new_page()
        shared.goto(editor.url)
        shared.get_by_role("button", name="Ada: sign out").focus()
        shared.keyboard.press("Enter")
        expect(shared).to_have_title("Sign in to the editor: cell.toml")
        # The other page of this browser signs in again too.
        expect(page).to_have_title("Sign in to the editor: cell.toml")
        expect(other.locator(".ring.other")).to_have_count(0)
    (log,) = (editor.file.parent / "state").rglob("editor.log")
    assert "Ada has saved the file. Backup of before: 0001.toml." in log.read_text()


@pytest.mark.parametrize("language", ["en", "ja", "de"])
def test_axe_finds_nothing_and_the_page_fits(
    chromium: Browser, editor: EditorServer, language: str
) -> None:
    viewport: Any = {"width": 800, "height": 480}
    with chromium.new_context(
        viewport=viewport, locale=language, ignore_https_errors=True, bypass_csp=True
    ) as context:
        page = context.new_page()
        page.goto(editor.address)
        page.locator("[name=name]").fill("Ada")
        page.locator("[name=secret]").fill("wrong horse")
        page.keyboard.press("Enter")
        expect(page.get_by_role("alert")).to_be_visible()
        page.evaluate(AXE)
        assert page.evaluate(RUN, {"values": ALL, "type": "tag"}) == []
        assert page.evaluate("document.documentElement.scrollWidth") <= 800

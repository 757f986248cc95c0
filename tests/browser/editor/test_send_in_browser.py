"""The saved file goes from the editor to a kiosk, by its keys alone."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.editor.test_shared_editor import choose, desk, enter
from tests.browser.test_accessibility import ALL, AXE, RUN
from tests.support.editor import EditorServer, editing
from tests.support.parts import until
from tests.support.sent_panels import OTHER, PANEL, Kiosk

FITS: Final = "(at) => [document.querySelector(at)].every((e) => e.scrollWidth <= e.clientWidth)"


@pytest.fixture
def kiosk(tmp_path: Path) -> Iterator[Kiosk]:
    own = Kiosk(tmp_path)
    yield own
    own.close()


def compare(page: Page, kiosk: Kiosk, token: str) -> None:
    """Opens the dialog and fills it in by the keyboard."""
    page.locator("#send-file").focus()
    page.keyboard.press("Enter")
    expect(page.get_by_label("Address of the kiosk")).to_be_focused()
    page.keyboard.type(kiosk.url)
    page.keyboard.press("Tab")
    page.keyboard.type(token)
    page.keyboard.press("Enter")


def test_label_goes_from_the_editor_to_the_kiosk(
    chromium: Browser, kiosk: Kiosk, tmp_path: Path
) -> None:
    token = kiosk.tokens["engineer"]
    with editing(tmp_path, PANEL) as editor, desk(chromium, editor) as page:
        shown = page.context.new_page()
        shown.goto(kiosk.url)
        expect(shown.locator("#at-start")).to_contain_text("Start")
        page.bring_to_front()
        choose(page, "start")
        enter(page, "Label", "Go")
        page.keyboard.press("Control+s")
        expect(page.locator("#status")).to_have_text("Saved")
        compare(page, kiosk, token)
        dialog = page.locator("#send")
        expect(dialog.locator("pre .added")).to_have_text('+label = "Go"  # the first one')
        expect(dialog.locator("dl")).to_contain_text("No one has it")
        expect(dialog.locator("[data-send]")).to_be_focused()
        page.keyboard.press("Enter")
        expect(dialog.locator("#send-status")).to_contain_text(
            "Shown by the kiosk since", timeout=60_000
        )
        expect(shown.locator("#at-start")).to_contain_text("Go", timeout=60_000)
        expect(dialog.locator("[data-send]")).to_be_disabled()
        assert kiosk.panel.read_text() == OTHER
        assert [entry[:2] for entry in kiosk.log] == [
            ("panel_take", "accepted"),
            ("panel_kept", "succeeded"),
        ]
        _keeps_no_token(editor, page, token)
        page.keyboard.press("Escape")
        expect(dialog).to_be_hidden()
        expect(page.locator("#send-file")).to_be_focused()


def _keeps_no_token(editor: EditorServer, page: Page, token: str) -> None:
    """The token is in no file of the editor, in no page and in no address."""
    assert token not in page.content()
    assert token not in editor.part("send")
    assert page.get_by_label("Engineer's token").input_value() == ""
    for path in editor.file.parent.rglob("*"):
        if path.is_file() and "data" not in path.parts:
            assert token.encode() not in path.read_bytes(), path


@pytest.mark.parametrize("language", ["en", "ja", "de"])
def test_axe_finds_nothing_in_the_dialog(
    chromium: Browser, kiosk: Kiosk, tmp_path: Path, language: str
) -> None:
    viewport: Any = {"width": 1280, "height": 800}
    with (
        editing(tmp_path, OTHER, "--language", language) as editor,
        chromium.new_context(viewport=viewport, bypass_csp=True) as context,
    ):
        page = context.new_page()
        page.goto(editor.address)
        page.locator("#send-file").click()
        page.locator("#send [name=address]").fill(kiosk.url)
        page.locator("#send [name=token]").fill(kiosk.tokens["engineer"])
        page.keyboard.press("Enter")
        expect(page.locator("#send pre .added")).to_be_visible()
        page.evaluate(AXE)
        run = RUN.replace("document,", "{exclude: ['iframe']},")
        assert page.evaluate(run, {"values": ALL, "type": "tag"}) == []
        for inner in ("#send", "#send pre"):
            assert page.evaluate(
                FITS,
                inner,
            )
        assert page.evaluate("document.documentElement.scrollWidth") <= 1280


def test_kiosk_that_refuses_says_why_in_the_dialog(
    chromium: Browser, kiosk: Kiosk, tmp_path: Path
) -> None:
    with editing(tmp_path, OTHER) as editor, desk(chromium, editor) as page:
        compare(page, kiosk, "opt_wrong")
        status = page.locator("#send-status")
        expect(status).to_contain_text("token")
        expect(page.locator("#send [data-send]")).to_have_count(0)
        page.get_by_label("Engineer's token").fill(kiosk.tokens["engineer"])
        page.keyboard.press("Enter")
        expect(page.locator("#send [data-send]")).to_be_focused()
        kiosk.panel.write_text(PANEL.replace("Start", "By hand"))
        page.keyboard.press("Enter")
        expect(status).to_contain_text("has changed since it was compared")
        expect(page.locator("#send [data-send]")).to_be_disabled()
        assert "By hand" in kiosk.panel.read_text()
        kiosk.server.end()
        page.get_by_role("button", name="Check and compare").click()
        expect(status).to_contain_text("can't be reached")
        until(lambda: editor.state()["sending"] > 0, "the editor says so")

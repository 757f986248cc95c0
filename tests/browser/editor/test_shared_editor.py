"""An editor that several browsers share, that is killed, or that has a long file."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from playwright.sync_api import Browser, Page, expect

from tests.support.browser.browsers import opened
from tests.support.editor import PANEL, EditorServer, box_of, editing, middle, preview
from tests.support.parts import until

WIDGETS: Final = 40
# Nine lines for each widget, with comments in each place where TOML permits one.
LONG: Final = (
    PANEL.partition("\n[[page]]")[0]
    + '\n[[page]]\nid = "long"\ntitle = "Long"\n'
    + "".join(
        f"""
# The pump {number}, from the left.
[[page.widget]]   # pump {number}
id = "pump_{number}"
kind = "readout"
label = "Pump {number}"   # as on its plate
topic = "/pump_{number}"
type = "std_msgs/msg/Float64"
field = "data"
unit = "bar"  # at the outlet
"""
        for number in range(WIDGETS)
    )
)


@contextmanager
def desk(chromium: Browser, editor: EditorServer) -> Iterator[Page]:
    """A browser of its own with the editor's page, which shows the panel."""
    with opened(chromium, viewport={"width": 1440, "height": 900}, locale="en") as context:
        page = context.new_page()
        page.goto(editor.address)
        expect(page.locator("#frames iframe:not(.coming)")).to_be_visible()
        yield page


def choose(page: Page, name: str) -> None:
    """Selects a widget where it stands in the preview."""
    page.mouse.click(*middle(box_of(page, f"#at-{name}")))
    expect(page.locator(".ring.chosen .tag")).to_contain_text(name)


def enter(page: Page, label: str, text: str) -> None:
    """Types a text into a field of the form, and leaves it."""
    field = page.locator("#form").get_by_label(label, exact=True)
    field.click()
    page.keyboard.press("Control+a")
    page.keyboard.type(text)
    page.keyboard.press("Enter")


def test_two_browsers_see_one_document_and_each_others_selection(
    chromium: Browser, tmp_path: Path
) -> None:
    with editing(tmp_path) as editor:
        with desk(chromium, editor) as first:
            with desk(chromium, editor) as second:
                choose(first, "speed")
                expect(second.locator(".ring.other .tag")).to_have_text("readout: speed")
                choose(second, "ready")
                expect(first.locator(".ring.other .tag")).to_have_text("indicator: ready")
                enter(first, "Label, English", "Belt")
                expect(preview(second).locator("#at-speed")).to_contain_text("Belt")
                expect(second.locator("#diff .added")).to_contain_text('label = "Belt"')
                # Each has its own field while both type.
                enter(second, "Label, English", "Robot ready")
                expect(preview(first).locator("#at-ready")).to_contain_text("Robot ready")
                expect(first.locator("#form").get_by_label("Label, English", exact=True)).to_have_value(
                    "Belt"
                )
                expect(first.locator("#status")).to_have_text("2 changes, not saved")
            expect(first.locator(".ring.other")).to_have_count(0)
        # Nobody is there: nothing is lost, and nothing was written.
        assert editor.file.read_text() == PANEL
        with desk(chromium, editor) as third:
            expect(third.locator("#status")).to_have_text("2 changes, not saved")
            expect(preview(third).locator("#at-speed")).to_contain_text("Belt")
            third.locator("#undo").click()
            expect(preview(third).locator("#at-ready")).not_to_contain_text("Robot ready")
            third.locator("#redo").click()
            third.locator("#save").click()
            expect(third.locator("#status")).to_have_text("Saved")
        changed = [
            line for line in editor.file.read_text().splitlines() if line not in PANEL.splitlines()
        ]
        assert changed == ['label = "Belt"      # shown large', 'label = "Robot ready"']


def test_after_a_kill_the_unsaved_work_is_offered_again(chromium: Browser, tmp_path: Path) -> None:
    with editing(tmp_path) as editor, desk(chromium, editor) as page:
        choose(page, "speed")
        enter(page, "Label, English", "Belt")
        expect(page.locator("#diff .added")).to_contain_text('label = "Belt"')
        editor.kill()
        expect(page.locator("#message")).to_contain_text("No connection to the editor.")
        assert editor.file.read_text() == PANEL
    again = EditorServer(tmp_path / "cell.toml")
    try:
        with desk(chromium, again) as page:
            offered = page.locator("#recovered")
            expect(offered.locator(".added")).to_contain_text('label = "Belt"')
            page.keyboard.press("Enter")  # the focus is on the button that takes it
            expect(offered).to_be_hidden()
            expect(preview(page).locator("#at-speed")).to_contain_text("Belt")
            expect(page.locator("#status")).to_have_text("1 change, not saved")
            page.keyboard.press("Control+s")
            expect(page.locator("#status")).to_have_text("Saved")
    finally:
        again.end()
    assert 'label = "Belt"      # shown large' in again.file.read_text()


def test_a_label_of_a_long_file_changes_one_line(chromium: Browser, tmp_path: Path) -> None:
    assert LONG.count("\n") > 400
    with editing(tmp_path, LONG) as editor, desk(chromium, editor) as page:
        page.locator(".find input").fill("pump_27")
        page.get_by_role("treeitem", name=re.compile("pump_27")).click()
        enter(page, "Label, English", "Coolant pump")
        label = 'label = "{}"   # as on its plate'
        for kind, name in (("removed", "Pump 27"), ("added", "Coolant pump")):
            expect(page.locator(f"#diff .{kind}")).to_have_count(1)
            expect(page.locator(f"#diff .{kind}")).to_contain_text(label.format(name))
        page.locator("#save").click()
        expect(page.locator("#status")).to_have_text("Saved")
        assert changed_lines(LONG, editor.file.read_text()) == [
            (label.format("Pump 27"), label.format("Coolant pump"))
        ]
        # What is being typed is saved without leaving the field.
        page.locator("#form").get_by_label("Label, English", exact=True).click()
        page.keyboard.press("Control+a")
        page.keyboard.type("Water pump")
        page.keyboard.press("Control+s")
        until(lambda: "Water pump" in editor.file.read_text(), "it is saved")
        expect(page.locator("#status")).to_have_text("Saved")
        page.locator("#undo").click()  # goes on over Save
        expect(page.locator("#diff .added")).to_contain_text(label.format("Coolant pump"))
        page.locator("#undo").click()
        page.locator("#save").click()
        until(lambda: editor.file.read_text() == LONG, "the file is as it was")


def changed_lines(before: str, after: str) -> list[tuple[str, str]]:
    pairs = zip(before.splitlines(), after.splitlines(), strict=True)
    return [pair for pair in pairs if pair[0] != pair[1]]


def test_a_file_with_faults_is_opened_with_all_that_is_known(chromium: Browser, tmp_path: Path) -> None:
    text = PANEL.replace('kind = "readout"', 'kind = "redout"', 1)
    with editing(tmp_path, text) as editor, opened(chromium, locale="en") as context:
        page = context.new_page()
        page.goto(editor.address)
        expect(page.locator("#faults .is-fault")).to_have_count(1)
        expect(page.locator(".tr").first).to_be_visible()
        page.locator("#faults .is-fault").click()
        expect(page.locator("#form")).to_contain_text("redout")
        page.locator("#faults .repair").click()
        expect(preview(page).locator("#at-speed")).to_contain_text("Speed")

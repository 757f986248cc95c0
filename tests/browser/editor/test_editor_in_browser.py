"""The editor with a mouse and a keyboard: what is selected, moved, typed and saved."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest
from playwright.sync_api import Browser, FilePayload, Page, Route, expect

from app.tools.editor.forms import element_id
from tests.browser.test_accessibility import ALL, AXE, RUN
from tests.support.browser.browsers import ReusedPage
from tests.support.editor import PANEL, EditorServer, box_of, editing, middle, preview
from tests.support.parts import until

SPEED: Final[list[str | int]] = ["page", 0, "group", 0, "widget", 0]
READY: Final = ["page", 0, "group", 0, "widget", 1]
OPEN: Final = ["page", 0, "group", 1, "widget", 0]
CHOSEN: Final = ".tr[aria-selected='true']"


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EditorServer]:
    with editing(tmp_path_factory.mktemp("editor")) as mine:
        yield mine


@pytest.fixture(scope="module")
def reused_page(chromium: Browser) -> Iterator[ReusedPage]:
    """Axe may be added to its pages."""
    mine = ReusedPage(chromium, bypass_csp=True)
    yield mine
    mine.close()


@pytest.fixture
def editor(running: EditorServer) -> EditorServer:
    running.edit({"op": "text", "path": [], "text": PANEL}).raise_for_status()
    running.http.post("/save", json={}).raise_for_status()
    return running


@pytest.fixture
def desk(page: Page, editor: EditorServer) -> Page:
    """The editor's page on a desk screen."""
    page.set_viewport_size({"width": 1440, "height": 900})
    return opened(page, editor)


def opened(page: Page, editor: EditorServer) -> Page:
    """The editor's page, with the preview there: nothing moves under a click any more."""
    page.goto(editor.address)
    expect(preview(page).locator("#at-speed")).to_be_visible()
    expect(page.locator(".tr").first).to_be_visible()
    expect(page.locator("#frames")).to_have_attribute("data-live", str(editor.state()["drawn"]))
    return page


def chosen(page: Page) -> Any:
    """The path that the outline shows as selected; None for none."""
    line = page.locator(CHOSEN)
    return json.loads(line.get_attribute("data-path") or "null") if line.count() else None


def select(page: Page, selector: str, path: Any) -> None:
    page.mouse.click(*middle(box_of(page, selector)))
    until(lambda: chosen(page) == path, f"{selector} is selected")


def order(editor: EditorServer) -> list[str]:
    """The ids of the widgets, in the order of the file."""
    text = editor.http.get("/text").text
    return [line.split('"')[1] for line in text.splitlines() if line.startswith("id = ")]


@pytest.mark.parametrize(
    ("selector", "path", "tag"),
    [
        ("#at-speed", SPEED, "readout: speed"),
        ('.group[data-group="1"] h2', ["page", 0, "group", 1], "group: Gripper"),
        ("#at-open", OPEN, "call: open"),
    ],
)
def test_a_click_selects_the_table_of_what_is_there(
    desk: Page, selector: str, path: Any, tag: str
) -> None:
    select(desk, selector, path)
    expect(desk.locator(".ring.chosen .tag")).to_have_text(tag)
    shown = box_of(desk, selector)

    def surrounds() -> bool:
        ring = desk.locator(".ring.chosen").bounding_box()
        return ring is not None and ring["x"] <= shown["x"] + 1 and ring["y"] <= shown["y"] + 1

    until(surrounds, "the ring is around it")


def test_the_keyboard_alone_selects_and_opens_the_form(desk: Page) -> None:
    overlay = desk.locator("#overlay")
    overlay.focus()
    desk.keyboard.press("End")
    until(lambda: chosen(desk) is not None, "the last is selected")
    desk.keyboard.press("Home")
    desk.keyboard.press("ArrowRight")
    seen = []
    for _ in range(8):
        seen.append(chosen(desk))
        desk.keyboard.press("ArrowRight")
    assert SPEED in seen
    assert ["page", 0, "group", 1] in seen
    select(desk, "#at-speed", SPEED)
    desk.keyboard.press("Escape")
    until(lambda: chosen(desk) == SPEED[:-2], "the group around it is selected")
    desk.keyboard.press("Enter")
    assert desk.evaluate("document.activeElement.closest('#form') !== null")


def test_an_edit_is_drawn_and_follows_with_its_sessions(desk: Page, editor: EditorServer) -> None:
    editor.edit({"op": "set", "path": [*SPEED, "label"], "value": "Belt speed"}).raise_for_status()
    expect(preview(desk).locator("#at-speed")).to_contain_text("Belt speed")
    expect(desk.locator("#status")).to_have_text("1 change, not saved")
    expect(desk.locator("#diff .added")).to_contain_text('label = "Belt speed"      # shown large')
    drawn = editor.state()["drawn"]
    until(lambda: editor.state()["live"] == drawn, "its sessions run")
    expect(preview(desk).locator("#at-speed")).to_contain_text("Belt speed")
    expect(preview(desk).locator("#state")).not_to_have_attribute("data-state", "lost")


def test_a_page_that_is_being_loaded_may_get_another_id(desk: Page, editor: EditorServer) -> None:
    reads: list[Route] = []
    desk.route(
        re.compile("/preview/pages/cell"),
        lambda route: (
            reads.append(route) if route.request.resource_type == "fetch" else route.continue_()
        ),
    )
    desk.get_by_role("button", name="Deutsch", exact=True).click()
    until(lambda: desk.evaluate("0") or reads, "the loaded page is read")
    answer = editor.edit({"op": "rename", "path": ["page", 0], "id": "hall"}).raise_for_status()
    drawn = answer.json()["drawn"]
    until(lambda: desk.evaluate("0") or editor.state()["live"] == drawn, "its sessions run")
    until(lambda: desk.evaluate("0") or len(reads) > 1, "the page is drawn again")
    reads[0].continue_()
    until(lambda: desk.evaluate("0") or len(reads) > 2, "the loaded page is read again")
    reads[2].continue_()
    expect(desk.locator("#pages [aria-current]")).to_have_attribute("data-page", "hall")
    expect(preview(desk).locator("#at-speed")).to_be_visible()


def test_undo_redo_and_save_by_keys(desk: Page, editor: EditorServer) -> None:
    editor.edit({"op": "set", "path": [*SPEED, "label"], "value": "Belt speed"}).raise_for_status()
    expect(desk.locator("#undo")).to_be_enabled()
    desk.locator("#overlay").focus()
    desk.keyboard.press("Control+z")
    expect(desk.locator("#status")).to_have_text("Saved")
    desk.keyboard.press("Control+Shift+Z")
    expect(desk.locator("#status")).to_have_text("1 change, not saved")
    desk.keyboard.press("Control+s")
    expect(desk.locator("#status")).to_have_text("Saved")
    assert 'label = "Belt speed"      # shown large' in editor.file.read_text()


def test_closing_says_once_that_changes_are_not_saved(desk: Page, editor: EditorServer) -> None:
    editor.edit({"op": "set", "path": [*SPEED, "label"], "value": "Belt"}).raise_for_status()
    expect(desk.locator("#status")).to_have_text("1 change, not saved")
    desk.locator("#close").click()
    expect(desk.locator("#message")).to_contain_text("not saved")
    editor.edit({"op": "set", "path": [*SPEED, "label"], "value": "Belts"}).raise_for_status()
    expect(desk.locator("#status")).to_have_text("2 changes, not saved")
    expect(desk.locator("#message")).to_contain_text("not saved")  # whatever happens in the meantime
    desk.locator("#tab-robot").click()
    expect(desk.locator("#message")).to_be_hidden()
    desk.locator("#close").click()
    expect(desk.locator("#message")).to_contain_text("not saved")
    desk.locator("#close").click()
    desk.wait_for_url("about:blank")
    opened(desk, editor)
    expect(desk.locator("#status")).to_have_text("2 changes, not saved")  # the server has it


def test_move_and_resize_by_keys(desk: Page, editor: EditorServer) -> None:
    select(desk, "#at-speed", SPEED)
    desk.keyboard.press("Alt+ArrowRight")
    until(lambda: order(editor)[1:3] == ["ready", "speed"], "it comes after")
    until(lambda: chosen(desk) == READY, "it stays selected")
    desk.keyboard.press("Shift+ArrowLeft")
    until(lambda: "span = 5" in editor.http.get("/text").text, "it is narrower")
    desk.keyboard.press("Shift+ArrowDown")
    until(lambda: "rows = 2" in editor.http.get("/text").text, "it is higher")
    desk.keyboard.press("Alt+ArrowRight")
    until(lambda: order(editor)[1:4] == ["ready", "speed", "open"], "it is in the next group")
    until(lambda: chosen(desk) == OPEN, "there first")


def test_duplicate_and_delete(desk: Page, editor: EditorServer) -> None:
    select(desk, "#at-speed", SPEED)
    desk.keyboard.press("Control+d")
    until(lambda: order(editor)[1:4] == ["speed", "speed_2", "ready"], "a copy with a new id")
    until(lambda: chosen(desk) == READY, "the copy is selected")
    desk.keyboard.press("Delete")
    until(lambda: order(editor)[1:3] == ["speed", "ready"], "it is gone")


def test_copy_and_paste_the_text_of_a_table(desk: Page, editor: EditorServer) -> None:
    desk.context.grant_permissions(["clipboard-read", "clipboard-write"])
    select(desk, "#at-speed", SPEED)
    desk.keyboard.press("Control+c")
    copied = '[[page.group.widget]]\nid = "speed"'
    until(lambda: copied in desk.evaluate("navigator.clipboard.readText()"), "its text is there")
    select(desk, "#at-open", OPEN)
    desk.locator("#overlay").focus()
    desk.keyboard.press("Control+v")
    until(lambda: order(editor)[1:5] == ["speed", "ready", "open", "speed_2"], "after the other")
    text = editor.http.get("/text").text
    assert text.count('label = "Speed"      # shown large') == 2
    until(lambda: chosen(desk) == [*OPEN[:-1], 1], "it is selected")


def test_drag_moves_to_the_marked_place(desk: Page, editor: EditorServer) -> None:
    start, target = box_of(desk, "#at-speed"), box_of(desk, "#at-open")
    desk.mouse.move(*middle(start))
    desk.mouse.down()
    desk.mouse.move(target["x"] + target["width"] * 0.6, target["y"] + target["height"] / 2, steps=6)
    expect(desk.locator(".drop")).to_be_visible()
    desk.mouse.move(target["x"] + target["width"] * 0.9, target["y"] + target["height"] / 2, steps=3)
    desk.mouse.up()
    until(lambda: order(editor)[1:4] == ["ready", "open", "speed"], "it is after the other group's")
    expect(desk.locator(".drop")).to_have_count(0)


def test_a_handle_makes_wider(desk: Page, editor: EditorServer) -> None:
    select(desk, "#at-open", OPEN)
    handle = until(lambda: desk.locator(".ring.chosen i").last.bounding_box(), "its handle is shown")
    group = box_of(desk, '.group[data-group="1"]')
    desk.mouse.move(*middle(handle))
    desk.mouse.down()
    desk.mouse.move(group["x"] + group["width"] - 4, handle["y"] + 4, steps=6)
    desk.mouse.up()
    until(lambda: editor.http.get("/text").text.count("span = 12") == 1, "as wide as its group")


def test_try_presses_the_simulated_robot(desk: Page, editor: EditorServer) -> None:
    desk.get_by_role("button", name="Try").click()
    expect(desk.locator("#overlay")).to_be_hidden()
    preview(desk).locator("#at-open").get_by_role("button", name="Open").click()
    expect(preview(desk).locator("#at-open .result")).to_have_attribute("data-outcome", "succeeded")
    desk.get_by_role("button", name="Arrange").click()
    expect(desk.locator("#overlay")).to_be_visible()


def test_pages_sizes_languages_and_themes(desk: Page) -> None:
    desk.get_by_role("button", name="Watch", exact=True).click()
    expect(preview(desk).locator("#at-load")).to_be_visible()
    expect(desk.locator("#pages [aria-current]")).to_have_text("Watch")
    desk.get_by_role("button", name="Deutsch", exact=True).click()
    expect(preview(desk).locator("html[lang='de']")).to_be_attached()
    expect(desk.locator("#pages [data-page='cell']")).to_have_text("Zelle")
    desk.get_by_role("button", name="Dark", exact=True).click()
    expect(preview(desk).locator("html[data-theme='dark']")).to_be_attached()
    desk.get_by_role("button", name="1024 × 600").click()
    assert preview(desk).locator("html").evaluate("() => [innerWidth, innerHeight]") == [1024, 600]


def test_a_page_is_added_at_the_end(desk: Page, editor: EditorServer) -> None:
    desk.locator("#pages .add").click()
    desk.get_by_role("button", name="An empty page").click()
    expect(desk.locator("#pages [data-page='page_3']")).to_have_attribute("aria-current", "page")
    assert editor.http.get("/text").text.endswith('[[page]]\nid = "page_3"\ntitle = "Page 3"\n')
    expect(preview(desk).locator("nav.pages [aria-current]")).to_have_text("Page 3")


def test_a_size_says_whether_the_page_fits_it(desk: Page, editor: EditorServer) -> None:
    small = desk.locator("[data-size='1024x600']")
    expect(small).to_have_attribute("data-fits", "")
    editor.edit({"op": "set", "path": ["page", 0, "fit"], "value": True}).raise_for_status()
    expect(small).to_have_attribute("data-fits", "yes")
    wide = {"op": "set", "path": [*SPEED, "span"], "value": 12}
    more = [{"op": "duplicate", "path": SPEED, "to": [*SPEED[:-1], 1]}] * 14
    editor.edit(wide, *more).raise_for_status()
    expect(small).to_have_attribute("data-fits", "no")


def test_the_outline_by_keys(desk: Page) -> None:
    tree = desk.locator(".tree")
    tree.locator(".tr").nth(1).focus()
    desk.keyboard.press("ArrowDown")
    focused = tree.locator(".tr:focus")
    expect(focused).to_have_text("Cell2")
    desk.keyboard.press("ArrowRight")
    desk.keyboard.press("ArrowRight")
    expect(focused).to_have_text("Belt2")
    desk.keyboard.press("w")
    expect(focused).to_have_text("Watch1")
    desk.keyboard.press("Enter")
    expect(preview(desk).locator("#at-load")).to_be_visible()
    expect(desk.locator(CHOSEN)).to_have_text("Watch1")
    desk.keyboard.press("Home")
    expect(focused).to_have_text("PanelCell")
    desk.keyboard.press("Enter")
    expect(desk.locator("#form .form")).to_have_attribute("data-form", "[]")
    expect(desk.locator("#form-title")).to_have_value("Cell")
    desk.locator(".find input").fill("open")
    expect(tree.locator(".tr:visible")).to_have_text(["Pages2", "Cell2", "Gripper1", "opencall"])


def test_a_fault_selects_its_place_and_marks_it(desk: Page, editor: EditorServer) -> None:
    edit = {"op": "set", "path": [*SPEED, "field"], "value": "date"}
    editor.edit(edit).raise_for_status()
    fault = desk.locator(".fault.is-fault")
    expect(fault).to_contain_text("speed: field")
    expect(desk.locator(".ring.faulty")).to_be_visible()
    fault.click()
    until(lambda: chosen(desk) == SPEED, "it selects its place")
    expect(preview(desk).locator("#at-speed")).to_be_visible()
    field = element_id(("page", 0, "group", 0, "widget", 0, "field"))
    expect(desk.locator(f'[id="{field}"]')).to_be_focused()


def test_a_note_leads_to_the_key_that_it_asks_for(desk: Page, editor: EditorServer) -> None:
    lock = {"id": "ready", "topic": "/ready", "type": "std_msgs/msg/Bool", "label": "ready"}
    editor.edit(
        {"op": "insert", "path": ["interlock", 0], "value": lock},
        {"op": "set", "path": [*OPEN, "interlock"], "value": "ready"},
    ).raise_for_status()
    note = desk.locator(".fault").filter(has_text="give max_age_s")
    note.click()
    expect(desk.get_by_label("Old after", exact=True)).to_be_focused()
    expect(desk.locator(".form-help")).to_contain_text("max_age_s: ")


def test_the_only_repair_of_a_fault_is_a_press_away(desk: Page, editor: EditorServer) -> None:
    wrong = {"op": "set", "path": [*OPEN, "kind"], "value": "cal"}
    editor.edit(wrong).raise_for_status()
    desk.get_by_role("button", name="Write call").click()
    expect(desk.locator(".fault.is-fault")).to_have_count(0)
    assert editor.http.get("/text").text == PANEL


def test_a_conflict_with_the_disk_is_chosen_and_saved(desk: Page, editor: EditorServer) -> None:
    editor.edit({"op": "set", "path": [*SPEED, "label"], "value": "Belt speed"}).raise_for_status()
    editor.file.write_text(PANEL.replace('label = "Speed"', 'label = "Velocity"'))
    desk.locator("#save").click()
    expect(desk.locator("#merge .conflict")).to_be_visible()
    expect(desk.locator("#conflict")).to_be_visible()
    desk.evaluate(AXE)
    assert desk.evaluate(RUN, {"values": ALL, "type": "tag"}) == []
    desk.locator("#merge").get_by_role("button", name="Yours").click()
    expect(desk.locator("#status")).to_have_text("Saved")
    expect(desk.locator("#merge")).to_be_hidden()
    assert 'label = "Belt speed"' in editor.file.read_text()


def test_two_browsers_see_one_document(desk: Page, editor: EditorServer, chromium: Browser) -> None:
    with chromium.new_context(viewport={"width": 1280, "height": 800}, locale="ja") as context:
        other = opened(context.new_page(), editor)
        expect(other.locator("#status")).to_have_text("保存済み")
        select(other, "#at-open", OPEN)
        expect(desk.locator(".ring.other .tag")).to_have_text("call: open")
        editor.edit({"op": "set", "path": [*OPEN, "label"], "value": "Release"}).raise_for_status()
        for page in (desk, other):
            expect(preview(page).locator("#at-open")).to_contain_text("Release")
    expect(desk.locator(".ring.other")).to_have_count(0)


@pytest.mark.parametrize("language", ["en", "ja", "de"])
def test_axe_finds_nothing(chromium: Browser, editor: EditorServer, language: str) -> None:
    viewport: Any = {"width": 1280, "height": 800}
    with chromium.new_context(viewport=viewport, locale=language, bypass_csp=True) as context:
        page = context.new_page()
        editor.edit({"op": "insert", "path": ["alarm", 0], "value": LOAD_LOW}).raise_for_status()
        opened(page, editor)
        page.evaluate(AXE)

        def violations() -> Any:
            shown = RUN.replace("document,", "{exclude: ['iframe']},")
            return page.evaluate(shown, {"values": ALL, "type": "tag"})

        select(page, "#at-speed", SPEED)
        expect(page.locator("#form [data-form]")).to_be_visible()
        assert violations() == []
        main = box_of(page, "main")
        page.mouse.click(*middle(main | {"y": main["y"] + main["height"] * 0.9, "height": 0}))
        expect(page.locator("#form .offer").first).to_be_visible()
        assert violations() == []
        page.locator(".tr[data-path='[\"alarm\"]']").click()
        page.locator(".tr[data-path='[\"alarm\", 0]']").click()
        expect(page.locator("#curve .limit-flag").first).to_be_visible()
        assert violations() == []
        wide = page.evaluate("document.documentElement.scrollWidth")
        assert wide <= 1280


def test_a_typed_label_is_on_the_page_and_in_the_diff_and_undone(desk: Page) -> None:
    select(desk, "#at-speed", SPEED)
    label = desk.locator("#form input[lang=en]").first
    expect(label).to_have_value("Speed")
    label.fill("Pace")
    label.press("Enter")
    expect(preview(desk).locator("#at-speed")).to_contain_text("Pace")
    expect(desk.locator("#diff")).to_contain_text('label = "Pace"      # shown large')
    expect(label).to_be_focused()
    desk.locator("#undo").click()
    expect(label).to_have_value("Speed")
    expect(preview(desk).locator("#at-speed")).to_contain_text("Speed")


def test_a_wrong_value_is_named_at_its_field_and_in_the_list(desk: Page) -> None:
    select(desk, "#at-speed", SPEED)
    age = desk.get_by_label("Old after")
    age.fill("soon")
    age.press("Enter")
    expect(desk.locator("#form .why")).to_contain_text('must be a number, not "soon"')
    expect(desk.locator("#faults")).to_contain_text('must be a number, not "soon"')
    expect(age).to_have_value("soon")
    desk.locator("#undo").click()
    expect(desk.locator("#form .why")).to_have_count(0)


def test_a_picture_is_chosen_and_shown(desk: Page) -> None:
    select(desk, "#at-speed", SPEED)
    desk.locator("#form select[data-kinds]").select_option('"image"')
    desk.get_by_role("button", name="Apply").click()
    expect(desk.locator("#form")).to_contain_text("is missing")
    data = b'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 4 3"/>'
    desk.locator("#form input[data-upload]").set_input_files(
        FilePayload(name="plan.svg", mimeType="image/svg+xml", buffer=data)
    )
    expect(preview(desk).locator("#at-speed img")).to_be_attached()
    desk.locator("#undo").click()
    desk.locator("#undo").click()
    expect(preview(desk).locator("#at-speed img")).to_have_count(0)


def test_a_new_file_and_a_page_of_another_are_chosen_by_keys(page: Page, tmp_path: Path) -> None:
    (tmp_path / "other.toml").write_text(PANEL)
    editor = EditorServer(tmp_path / "new.toml")
    try:
        page.goto(editor.address)
        expect(page.locator("#start-from")).to_be_visible()
        expect(page.locator("#left .offer.part").first).to_be_visible()  # what can be added
        page.locator("#start-from").press("Enter")
        expect(page.get_by_role("button", name="The robot that is there")).to_be_focused()
        page.get_by_role("button", name="other.toml: Cell").press("Enter")
        expect(preview(page).locator("#at-speed")).to_be_visible()
        expect(page.locator("#start-from")).to_be_hidden()
        page.locator("#pages .add").click()
        page.get_by_role("button", name="other.toml: Watch").click()
        expect(preview(page).locator("#at-load")).to_be_visible()
        expect(page.locator("#pages [aria-current]")).to_have_text("Watch")
        page.keyboard.press("Control+s")
        expect(page.locator("#status")).to_have_text("Saved")
        assert 'id = "watch"' in editor.file.read_text()
    finally:
        editor.end()


def test_an_empty_place_offers_what_comes_there(desk: Page, editor: EditorServer) -> None:
    group, widget = box_of(desk, '.group[data-group="1"]'), box_of(desk, "#at-open")
    right = widget["x"] + widget["width"]
    desk.mouse.click((right + group["x"] + group["width"]) / 2, widget["y"] + widget["height"] / 2)
    expect(desk.locator("#form [data-form]")).to_have_attribute(
        "data-form", '["page", 0, "group", 1, "widget", 1, "+"]'
    )
    desk.locator("#overlay").press("Enter")
    expect(desk.locator("#form .offer").first).to_be_focused()
    desk.locator("#form [data-kind-of=label]").press("Enter")
    until(lambda: order(editor)[3:5] == ["open", "label"], "it comes behind the group's last")


def test_delete_in_the_outline_removes_a_table(desk: Page, editor: EditorServer) -> None:
    line = desk.locator(".tr", has_text="Watch")
    line.click()
    line.press("Delete")
    until(lambda: "Watch" not in editor.http.get("/text").text, "the page is gone")


def test_a_removed_file_is_written_again(desk: Page, editor: EditorServer) -> None:
    editor.file.unlink()
    again = desk.locator("#write-again")
    expect(again).to_be_visible()
    again.click()
    until(editor.file.exists, "the file is written")
    expect(again).to_be_hidden()


def test_a_renamed_page_stays_in_sight(desk: Page, editor: EditorServer) -> None:
    desk.locator('#pages [data-page="watch"]').click()
    expect(desk.locator('#pages [data-page="watch"]')).to_have_attribute("aria-current", "page")
    editor.edit({"op": "rename", "path": ["page", 1], "id": "look"})
    expect(desk.locator('#pages [data-page="look"]')).to_have_attribute("aria-current", "page")


LOAD_LOW: Final = {
    **{"id": "load_low", "topic": "/load", "type": "std_msgs/msg/Float64", "deadband": 0.5},
    **{"low": 5.0, "high": 50.0, "text": "Load low", "action": "Add load"},
}


@pytest.fixture
def curve(desk: Page, editor: EditorServer) -> Page:
    """The page with the curve of an alarm that has two limits."""
    editor.edit({"op": "insert", "path": ["alarm", 0], "value": LOAD_LOW}).raise_for_status()
    desk.locator(".tr[data-path='[\"alarm\"]']").click()
    desk.locator(".tr[data-path='[\"alarm\", 0]']").click()
    expect(desk.locator("#curve .value")).to_have_attribute("d", re.compile("L"))
    return desk


def test_a_limit_is_dragged_by_its_flag_and_stays_below_the_next(
    curve: Page, editor: EditorServer
) -> None:
    flag, area = curve.locator("[data-limit=low]"), curve.locator("#curve .area")
    (start, plot) = (until(each.bounding_box, "it is there") for each in (flag, area))
    curve.mouse.move(*middle(start))
    curve.mouse.down()
    curve.mouse.move(middle(start)[0], plot["y"] + 4, steps=5)
    expect(flag).not_to_have_attribute("aria-valuenow", "5.0")
    assert "low = 5.0" in editor.http.get("/text").text, "it is written when it is let go"
    curve.mouse.up()
    until(lambda: "low = 5.0" not in editor.http.get("/text").text, "the line is written")
    low = float(re.findall(r"^low = (\S+)", editor.http.get("/text").text, re.M)[0])
    assert 45 < low < 50
    curve.locator("#undo").click()
    until(lambda: "low = 5.0" in editor.http.get("/text").text, "one step of undo")


def test_a_limit_is_moved_by_keys(curve: Page, editor: EditorServer) -> None:
    flag = curve.locator("[data-limit=high]")
    flag.focus()
    for _ in range(3):
        flag.press("ArrowDown")
    until(lambda: "high = 50.0" not in editor.http.get("/text").text, "the line is written")
    expect(flag).to_be_focused()
    curve.locator("#undo").click()
    until(lambda: "high = 50.0" in editor.http.get("/text").text, "three keys are one step")


def test_the_curve_counts_and_shows_the_line_of_operators(curve: Page) -> None:
    expect(curve.locator("#curve .figures b").first).to_have_text(re.compile(r"^\d+$"))
    expect(curve.locator("#curve .alarm-line .newest b")).to_have_text("Load low")
    curve.get_by_role("button", name="Show the page").click()
    expect(curve.locator("#curve")).to_be_hidden()
    expect(preview(curve).locator("#at-speed")).to_be_visible()


NARROW: Final = [(1024, 600), (800, 480)]
BUTTONS: Final = ".bar :is(button, a), .left [role='tab'], #pages button, #form [role='tab']"
# Buttons that are partly outside of the window, or over one another.
UNREACHABLE: Final = """selector => {
  const buttons = [...document.querySelectorAll(selector)].filter((button) => button.checkVisibility());
  const boxes = buttons.map((button) => ({ button, box: button.getBoundingClientRect() }));
  const isOut = ({ button, box }) => box.top < 0 || box.bottom > innerHeight + 1
    || (!button.closest('#pages') && (box.left < 0 || box.right > innerWidth + 1));
  const isOver = ({ button, box }) => boxes.some(({ button: other, box: on }) => other !== button
    && box.left < on.right - 1 && on.left < box.right - 1
    && box.top < on.bottom - 1 && on.top < box.bottom - 1
    && !button.closest('#pages') && !other.closest('#pages'));
  return boxes.filter((each) => isOut(each) || isOver(each))
    .map(({ button }) => button.id || button.getAttribute('aria-label') || button.textContent.trim());
}"""


@pytest.mark.parametrize("language", ["en", "ja", "de"])
@pytest.mark.parametrize(("width", "height"), [*NARROW, (1280, 800), (1440, 900), (1280, 600)])
def test_every_button_can_be_reached_on_screens_of_any_size(
    page: Page, editor: EditorServer, width: int, height: int, language: str
) -> None:
    page.set_viewport_size({"width": width, "height": height})
    page.set_extra_http_headers({"accept-language": language})
    opened(page, editor)
    page.locator("#overlay").focus()
    page.keyboard.press("End")
    expect(page.locator("#form .form")).to_be_attached()
    assert page.evaluate(UNREACHABLE, BUTTONS) == []
    sizes = page.locator("[data-size]").first
    if (width, height) in NARROW:
        page.locator("#open-view").press("Enter")
        assert page.evaluate(UNREACHABLE, "#view-choices button") == []
        sizes.press("Escape")
        expect(sizes).to_be_hidden()
    else:
        expect(sizes).to_be_visible()


@pytest.mark.parametrize(("width", "height"), NARROW)
def test_on_a_narrow_screen_the_panes_share_one_place(
    desk: Page, editor: EditorServer, width: int, height: int
) -> None:
    desk.set_viewport_size({"width": width, "height": height})
    lists, form, foot = (desk.locator(f"[data-side-of='{name}']") for name in ("left", "form", "foot"))
    pane, table, faults = desk.locator("#left"), desk.locator("#form"), desk.locator("#faults")
    expect(pane).to_be_visible()
    expect(table).to_be_hidden()
    select(desk, "#at-speed", SPEED)
    expect(table).to_be_visible()  # in place of the lists
    expect(pane).to_be_hidden()
    form.press("Enter")
    expect(table).to_be_hidden()  # the page has the whole width
    select(desk, "#at-ready", READY)
    expect(table).to_be_hidden()
    desk.keyboard.press("Enter")
    expect(table.locator(":focus")).to_have_count(1)
    lists.press("Enter")
    expect(pane).to_be_visible()
    editor.edit({"op": "delete", "path": [*SPEED, "topic"]}).raise_for_status()
    expect(foot).to_have_text("1")
    expect(faults).to_be_hidden()
    foot.press("Enter")
    faults.locator(".fault").press("Enter")
    expect(desk.locator(f"[id='{element_id((*SPEED, 'topic'))}']")).to_be_focused()
    desk.evaluate(AXE)
    run = RUN.replace("document,", "{exclude: ['iframe']},")
    assert desk.evaluate(run, {"values": ALL, "type": "tag"}) == []

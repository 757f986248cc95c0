"""The form of a selected table in a browser: typed, chosen and ticked by keyboard; composed by an input
method; kept over refreshes."""

from collections.abc import Callable
from pathlib import Path
from typing import Final

import pytest
from playwright.sync_api import Page, expect

from app.tools.editor.forms import element_id
from tests.browser.editor.form_page import FormBrowser
from tests.browser.test_accessibility import violations
from tests.support.parts import TESTS, until

EVERYTHING: Final = (TESTS / "everything.toml").read_text()
TEXT: Final = """title = "Cell"
languages = ["en", "ja", "de"]

[[interlock]]
id = "power"
topic = "/power"
type = "std_msgs/msg/Bool"
[[interlock]]
id = "door"
topic = "/door"
type = "std_msgs/msg/Bool"

[[page]]
id = "cell"
title = "Cell"
[[page.widget]]
id = "boxes"  # of the pallet
kind = "figure"
label = { en = "Count", ja = "箱数" }
topic = "/boxes"
type = "std_msgs/msg/UInt32"
target = 140.0
[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/go"
type = "geometry_msgs/msg/Twist"
interlock = "power"
message = { linear = { x = 0.5 } }
[[page.widget]]
id = "lamp"
kind = "indicator"
label = "Lamp"
topic = "/lamp"
type = "std_msgs/msg/UInt8"
[[page.widget.states]]
value = 0
text = "Off"
shape = "circle"
[[page.widget.states]]
value = 1
text = "On"
shape = "square"

[[alarm]]
id = "boxes_full"
text = "Pallet full"
topic = "/boxes"
type = "std_msgs/msg/UInt32"
field = "data"
high = 144.0
"""
BOXES: Final = ("page", 0, "widget", 0)
GO: Final = ("page", 0, "widget", 1)
LAMP: Final = ("page", 0, "widget", 2)
Show = Callable[..., FormBrowser]


@pytest.fixture
def show(page: Page, tmp_path: Path) -> Show:
    """The form of a table, by its path."""
    return lambda *path, **more: FormBrowser(page, more.pop("text", TEXT), path, tmp_path, **more)


def test_a_typed_text_changes_one_line_and_keeps_the_focus(show: Show) -> None:
    form = show(*BOXES)
    label = form.field(*BOXES, "label")
    label.focus()
    label.press("Control+a")
    label.press_sequentially("Boxes")
    label.press("Enter")
    until(lambda: form.saved["page"][0]["widget"][0]["label"]["en"] == "Boxes", "the text is set")
    expect(label).to_be_focused()
    assert form.labels == ["boxes: label"]
    changed = [line for line in form.document.text.splitlines() if line not in TEXT.splitlines()]
    assert changed == ['label = { en = "Boxes", ja = "箱数" }']


def test_a_missing_language_is_named_typed_and_copied(show: Show) -> None:
    form = show(*BOXES)
    german = form.page.locator("input[lang=de]").first
    expect(german).to_have_attribute("placeholder", "missing")
    expect(form.page.get_by_text("Deutsch is a language of this panel.")).to_be_visible()
    form.page.get_by_role("button", name="copy", exact=True).click()
    until(lambda: form.saved["page"][0]["widget"][0]["label"].get("de") == "Count", "it is copied")
    expect(form.page.get_by_text("Deutsch is a language of this panel.")).to_have_count(0)
    german.fill("Kartons")
    german.press("Tab")
    until(lambda: form.saved["page"][0]["widget"][0]["label"]["de"] == "Kartons", "it is typed")


def test_a_plain_text_becomes_texts_by_language(show: Show) -> None:
    form = show(*GO)
    japanese = form.page.locator("[data-label='go: label'] input[lang=ja]")
    japanese.fill("開始")
    japanese.press("Enter")
    until(
        lambda: form.saved["page"][0]["widget"][1]["label"] == {"en": "Go", "ja": "開始"},
        "both languages are there",
    )


def test_a_composition_goes_on_while_the_pane_is_refreshed(show: Show) -> None:
    form = show(*BOXES)
    japanese = form.page.locator("input[lang=ja]").first
    japanese.focus()
    japanese.press("End")
    devtools = form.page.context.new_cdp_session(form.page)
    devtools.send("Input.imeSetComposition", {"text": "の", "selectionStart": 1, "selectionEnd": 1})
    expect(japanese).to_have_value("箱数の")
    form.change_elsewhere({"op": "set", "path": [*BOXES, "unit"], "value": "boxes"})
    expect(form.field(*BOXES, "unit")).to_have_value("boxes")
    devtools.send("Input.imeSetComposition", {"text": "の数", "selectionStart": 2, "selectionEnd": 2})
    expect(japanese).to_have_value("箱数の数")
    assert form.edits == []
    devtools.send("Input.insertText", {"text": "の数"})
    expect(japanese).to_be_focused()
    expect(japanese).to_have_value("箱数の数")
    japanese.press("Enter")
    until(lambda: form.saved["page"][0]["widget"][0]["label"]["ja"] == "箱数の数", "it is composed")


def test_what_is_being_typed_stays_with_its_caret_over_a_refresh(show: Show) -> None:
    form = show(*BOXES)
    topic = form.field(*BOXES, "topic")
    topic.fill("/boxes_now")
    topic.evaluate("(input) => input.setSelectionRange(3, 5)")
    form.change_elsewhere({"op": "set", "path": [*BOXES, "segments"], "value": 6})
    expect(form.field(*BOXES, "segments")).to_have_value("6")
    expect(topic).to_be_focused()
    assert topic.evaluate("(input) => [input.value, input.selectionStart, input.selectionEnd]") == [
        "/boxes_now",
        3,
        5,
    ]
    topic.press("Escape")
    expect(topic).to_have_value("/boxes")
    form.undo()
    expect(form.field(*BOXES, "segments")).to_have_value("")


@pytest.mark.parametrize(
    ("typed", "written"), [("142", "142.0"), ("142,5", "142.5"), (".5", "0.5"), ("1e3", "1e3")]
)
def test_a_number_is_written_as_the_file_writes_it(show: Show, typed: str, written: str) -> None:
    form = show(*BOXES)
    target = form.field(*BOXES, "target")
    target.fill(typed)
    target.press("Enter")
    until(
        lambda: form.edits == [[{"op": "set", "path": [*BOXES, "target"], "toml": written}]],
        "it is posted",
    )
    assert form.saved["page"][0]["widget"][0]["target"] == float(written)


def test_arrow_keys_step_a_number_within_its_limits(show: Show) -> None:
    form = show(*BOXES)
    rows = form.field(*BOXES, "rows")
    for _ in range(9):
        rows.press("ArrowUp")
    expect(rows).to_have_value("8")
    until(lambda: form.saved["page"][0]["widget"][0].get("rows") == 8, "it is set")
    assert len(form.edits) == 1


def test_a_wrong_value_stays_as_it_was_typed_with_the_models_sentence(show: Show) -> None:
    form = show(*BOXES)
    target = form.field(*BOXES, "segments")
    target.fill("six")
    target.press("Enter")
    expect(form.page.get_by_text('must be a whole number, not "six"')).to_be_visible()
    expect(target).to_have_value("six")
    expect(target).to_have_attribute("aria-invalid", "true")
    target.fill("6")
    target.press("Enter")
    expect(form.page.get_by_text("must be a whole number")).to_have_count(0)
    target.fill("")
    target.press("Enter")
    until(lambda: "segments" not in form.saved["page"][0]["widget"][0], "the key goes")


def test_text_that_is_not_toml_is_refused_and_stays(show: Show) -> None:
    form = show(*BOXES)
    form.page.get_by_role("button", name="As text").click()
    area = form.page.get_by_role("textbox", name="The table's text")
    expect(area).to_have_value(form.document.text_of(BOXES))
    area.fill('id = "boxes"\nkind =')
    form.page.get_by_role("button", name="Apply").click()
    refusal = form.page.get_by_role("alert")
    expect(refusal).to_be_visible()
    form.page.evaluate("globalThis.form.refresh()")
    expect(area).to_have_value('id = "boxes"\nkind =')
    area.fill(form.document.text_of(BOXES).replace("140.0", "150"))
    area.press("Control+Enter")
    until(lambda: form.saved["page"][0]["widget"][0]["target"] == 150, "the text is replaced")
    expect(refusal).to_have_count(0)
    assert "# of the pallet" in form.document.text


def test_interlocks_are_ticked_as_one_id_or_a_list(show: Show) -> None:
    form = show(*GO)
    door = form.page.get_by_role("checkbox", name="door")
    door.focus()
    door.press("Space")
    until(lambda: form.saved["page"][0]["widget"][1]["interlock"] == ["power", "door"], "both")
    form.page.get_by_role("checkbox", name="power").uncheck()
    until(lambda: form.saved["page"][0]["widget"][1]["interlock"] == "door", "the other alone")


def test_a_choice_is_set_and_taken_back(show: Show) -> None:
    form = show(*GO)
    role = form.field(*GO, "role")
    role.select_option(label="start")
    until(lambda: form.saved["page"][0]["widget"][1].get("role") == "start", "it is set")
    role.select_option("")
    until(lambda: "role" not in form.saved["page"][0]["widget"][1], "the default counts")


def test_a_message_has_its_fields_and_those_of_its_definition(show: Show) -> None:
    form = show(*GO)
    speed = form.field(*GO, "message", "linear", "x")
    expect(speed).to_have_value("0.5")
    speed.fill("{speed}")
    speed.press("Enter")
    until(lambda: form.saved["page"][0]["widget"][1]["message"]["linear"]["x"] == "{speed}", "an input")
    form.page.get_by_label("Add, Message").select_option(label="angular.z  float64")
    until(lambda: form.saved["page"][0]["widget"][1]["message"].get("angular") == {"z": 0.0}, "a field")
    assert "z = 0.0" in form.document.text


def test_rows_are_added_moved_and_removed_by_keyboard(show: Show) -> None:
    form = show(*LAMP)
    form.page.get_by_role("button", name="Add: States").press("Enter")
    text = form.field(*LAMP, "states", 2, "text")
    expect(text).to_be_focused()
    text.fill("Blinks")
    text.press("Enter")
    until(lambda: form.saved["page"][0]["widget"][2]["states"][2].get("text") == "Blinks", "a state")
    row = form.page.locator("details.inner").nth(2)
    row.get_by_role("button", name="Move up").press("Enter")
    until(
        lambda: (
            [s["text"] for s in form.saved["page"][0]["widget"][2]["states"]] == ["Off", "Blinks", "On"]
        ),
        "it is moved",
    )
    form.page.locator("details.inner").nth(1).get_by_role("button", name="Remove").press("Enter")
    until(lambda: len(form.saved["page"][0]["widget"][2]["states"]) == 2, "it is removed")
    assert form.page.evaluate("document.activeElement !== document.body")


def test_another_kind_says_what_goes_before_it_is_applied(show: Show) -> None:
    form = show(*BOXES)
    form.page.locator("select[data-kinds]").select_option('"gauge"')
    expect(form.page.get_by_text("These keys go: target")).to_be_visible()
    expect(form.page.get_by_text("These keys are needed then: min, max")).to_be_visible()
    assert form.edits == []
    form.page.get_by_role("button", name="Apply").click()
    until(lambda: form.saved["page"][0]["widget"][0]["kind"] == "gauge", "it is another kind")
    expect(form.page.get_by_text("These keys go")).to_have_count(0)
    assert len(form.labels) == 1  # one step


def test_an_id_is_renamed_everywhere(show: Show) -> None:
    form = show("interlock", 0)
    name = form.field("interlock", 0, "id")
    name.fill("energy")
    name.press("Enter")
    until(lambda: form.saved["page"][0]["widget"][1]["interlock"] == "energy", "the reference too")


def test_an_icon_is_chosen_from_pictures(show: Show) -> None:
    form = show("page", 0)
    form.page.get_by_role("button", name="Choose", exact=True).click()
    form.page.get_by_role("button", name="truck", exact=True).click()
    until(lambda: form.saved["page"][0].get("icon") == "truck", "it is set")
    expect(form.page.locator(".pick svg").first).to_be_visible()


def test_a_topic_brings_its_type(show: Show) -> None:
    form = show(*BOXES)
    topic = form.field(*BOXES, "topic")
    topic.fill("/lamp")
    topic.press("Enter")
    until(lambda: form.saved["page"][0]["widget"][0]["type"] == "std_msgs/msg/UInt8", "with its type")
    assert len(form.labels) == 1


@pytest.mark.parametrize("key", ["Tab", "Enter"])
def test_after_a_field_that_goes_the_focus_is_in_the_next(show: Show, key: str) -> None:
    text = TEXT.replace('type = "geometry_msgs/msg/Twist"\n', "").replace(
        "message = { linear = { x = 0.5 } }\n", ""
    )
    form = show(*GO, text=text)
    form.field(*GO, "type").fill("geometry_msgs/msg/Twist")
    form.field(*GO, "type").press(key)
    until(lambda: "type" in form.saved["page"][0]["widget"][1], "the type is set")
    expect(form.field(*GO, "type")).to_be_hidden()  # it stands beside the topic now
    expect(form.page.locator(f"[id='{element_id((*GO, 'message'))}'] select")).to_be_focused()


def test_a_widgets_group_stays_over_an_edit(show: Show) -> None:
    form = show(*BOXES)
    group = form.page.get_by_label("Group", exact=True)
    expect(group).to_be_visible()
    form.field(*BOXES, "target").fill("150")
    form.field(*BOXES, "target").press("Enter")
    until(lambda: form.saved["page"][0]["widget"][0]["target"] == 150, "a key is set")
    expect(group).to_be_visible()


def test_tables_are_opened_from_lists_and_added(show: Show) -> None:
    form = show()
    form.page.get_by_role("button", name="boxes_full").click()
    expect(form.page.locator("[data-form]")).to_have_attribute("data-form", '["alarm", 0]')
    tabs = form.page.get_by_role("tab")
    expect(tabs).to_have_text(["Alarm", "Used by 1", "As text"])
    tabs.nth(0).focus()
    form.page.keyboard.press("ArrowRight")
    form.page.keyboard.press("Enter")
    expect(form.page.locator(".used button")).to_have_text(["boxes_fullalarm"])


def test_help_is_that_of_the_reference(show: Show) -> None:
    form = show(*BOXES)
    strip = form.page.locator(".form-help")
    expect(strip).to_contain_text("One number that is read from afar")
    form.field(*BOXES, "topic").focus()
    expect(strip).to_have_text("topic: The topic to subscribe to.")


@pytest.mark.parametrize("language", ["en", "ja", "de"])
def test_axe_finds_nothing_in_any_theme(axe_page: Page, tmp_path: Path, language: str) -> None:
    for path in (BOXES, GO, ("alarm", 0), ()):
        form = FormBrowser(axe_page, TEXT, path, tmp_path, language)
        assert violations(form.page) == []
        axe_page.unroute_all()


@pytest.mark.parametrize("language", ["en", "ja", "de"])
def test_no_label_or_button_is_cut(show: Show, language: str) -> None:
    for path in (BOXES, GO, LAMP, ("alarm", 0), ("interlock", 0), ()):
        form = show(*path, language=language)
        cut = form.page.evaluate(
            """() => [...document.querySelectorAll("main :is(.l, .act span, h2, h3, .seg button)")]
              .filter((e) => e.checkVisibility() && e.scrollWidth > e.clientWidth + 1)
              .map((e) => e.textContent.trim())"""
        )
        assert cut == [], path
        assert form.page.evaluate("document.querySelector('.form').scrollWidth <= 360")
        form.page.unroute_all()

"""Numbers as an operator enters them, in Chromium: the screen shows what a ROS 2 node receives."""

import random
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Final

import pytest
from playwright.sync_api import Browser, BrowserContext, Locator, Page, expect

from app.panel.numbers import Range, decimal_text
from app.system.texts.locales import read_number, read_numbers
from tests.support.browser.browsers import opened
from tests.support.browser.pages import asked
from tests.support.browser.touch import HUMAN_S
from tests.support.parts import TAP_AGAIN_MS, Bridge, RosNode, Server, has_heard, until
from tests.support.servers import live_server
from tests.support.typed_numbers import LANGUAGES, TABLE, UNCLEAR, as_sent, generated

pytestmark = pytest.mark.promise("numbers")

TOPIC: Final = "/test_typed"
FLOAT: Final = "std_msgs/msg/Float64"
PANEL: Final = """
title = "Cell"
languages = ["en", "de", "ja"]

[[page]]
id = "one"
title = "One"

[[page.widget]]
id = "level"
kind = "number"
label = "Level"
min = -2000.0
max = 2000.0
unit = "mm"

[[page.widget]]
id = "height"
kind = "slider"
label = "Height"
min = 0.0
max = 2.0
step = 0.1

[[page.widget]]
id = "fine"
kind = "number"
label = "Fine"
min = 0.0
max = 2.0
step = 0.1

[[page.widget]]
id = "send"
kind = "publish"
label = "Send"
topic = "/test_typed"
type = "std_msgs/msg/Float64"
message = { data = "{level}" }

[[page.widget]]
id = "send_asked"
kind = "publish"
label = "Ask"
topic = "/test_typed"
type = "std_msgs/msg/Float64"
message = { data = "{level}" }
confirm_press = true

[[page.widget]]
id = "send_height"
kind = "publish"
label = "Send height"
topic = "/test_typed"
type = "std_msgs/msg/Float64"
message = { data = "{height}" }

[[page.widget]]
id = "send_fine"
kind = "publish"
label = "Send fine"
topic = "/test_typed"
type = "std_msgs/msg/Float64"
message = { data = "{fine}" }
"""
# The panel's language and the browser's: neither of the others decides.
READERS: Final = [("de", "en-US"), ("en", "de-DE"), ("ja", "de-DE")]
JUDGED: Final = """async ([path, rows]) => {
  const { judged } = await import(path);
  const limits = ([min, max, step, isWhole]) => ({ min, max, step, isWhole });
  return rows.map(([text, ...row]) => judged(text, limits(row)).problem);
}"""
READ: Final = """async ([path, rows]) => {
  const { readNumber, readNumbers } = await import(path);
  return rows.map(([text, isWhole, isList]) => {
    const read = (element) => readNumber(element, isWhole);
    return isList ? readNumbers(text, read) : read(text);
  });
}"""


@pytest.fixture(scope="module")
def cell(bridge: Bridge, node: RosNode, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    node.subscribe(TOPIC, FLOAT)
    with live_server(bridge, tmp_path_factory.mktemp("cell"), PANEL) as mine:
        until(partial(node.endpoints, TOPIC), "the robot sees who publishes")
        yield mine


Opens = Callable[..., Page]


@pytest.fixture
def opens(chromium: Browser, cell: Server) -> Iterator[Opens]:
    """Opens the page in a language of the panel, in a browser of another language."""
    contexts: list[BrowserContext] = []

    def opens(language: str, locale: str, **options: Any) -> Page:
        context = opened(
            chromium, locale=locale, permissions=["clipboard-read", "clipboard-write"], **options
        )
        contexts.append(context)
        context.add_cookies([{"name": "kiosk_language", "value": language, "url": cell.url}])
        page = context.new_page()
        page.goto(cell.url)
        if options.get("java_script_enabled", True):
            expect(page.locator("html[data-inputs][data-floor]")).to_be_attached()
        else:
            page.wait_for_timeout(TAP_AGAIN_MS)
        return page

    yield opens
    for context in contexts:
        context.close()


def entry(page: Page) -> Locator:
    return page.locator("#input-level")


def press(page: Page, name: str = "send") -> None:
    button = page.locator(f'[data-widget="{name}"] button[type=submit]').first
    expect(button).not_to_have_attribute("aria-busy", "true")
    button.click()


def typed(page: Page, text: str) -> None:
    entry(page).press_sequentially(text)


def by_hand(page: Page, text: str) -> None:
    page.keyboard.type(text, delay=1000 * HUMAN_S)


def pasted(page: Page, text: str) -> None:
    page.evaluate("(text) => navigator.clipboard.writeText(text)", text)
    entry(page).focus()
    page.keyboard.press("Control+V")


def composed(page: Page, text: str) -> None:
    """By an input method: a composition, which is then committed."""
    entry(page).focus()
    method = page.context.new_cdp_session(page)
    for end in range(1, len(text) + 1):
        composition = {"text": text[:end], "selectionStart": end, "selectionEnd": end}
        method.send("Input.imeSetComposition", composition)
    method.send("Input.insertText", {"text": text})


def without(page: Page, text: str) -> None:
    entry(page).fill(text)


Numbers = list[tuple[str, float]]
ROWS: Final[dict[str, tuple[Numbers, list[str]]]] = {
    "de": (
        [("1,5", 1.5), ("−2,5", -2.5), ("1.234,5", 1234.5), ("１，５", 1.5)],
        ["1.5", "1,5 mm", "1,2,3"],
    ),
    "en": (
        [("1.5", 1.5), ("−2.5", -2.5), ("1,234.5", 1234.5), ("１．５", 1.5)],
        ["1,5", "1.5 mm", "1.2.3"],
    ),
    "ja": (
        [("1.5", 1.5), ("－２．５", -2.5), ("1,234.5", 1234.5), ("１．５", 1.5)],
        ["1,5", "ー５", "１。５"],
    ),
}
WAYS: Final = {"typed": typed, "pasted": pasted, "composed": composed, "a form": without}


@pytest.mark.long("every screen")
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("language", "locale"), READERS)
def test_entered_number_reaches_the_robot_exactly_or_is_refused(
    node: RosNode, opens: Opens, language: str, locale: str, way: str
) -> None:
    page = opens(language, locale, java_script_enabled=way != "a form")
    accepted, refused = ROWS[language]
    before = len(node.heard(TOPIC))
    if way == "a form":  # each is a page
        accepted, refused = accepted[:2], refused[:1]
    for text in refused:
        entry(page).fill("")
        WAYS[way](page, text)
        if way != "a form":
            expect(entry(page)).to_have_attribute("data-unread", "")
        press(page)
        expect(page.locator("#receipt-send")).to_contain_text(f'"{text}"')
        expect(entry(page)).to_have_value(text)
    for i, (text, number) in enumerate(accepted):
        if way == "a form":
            page.wait_for_timeout(TAP_AGAIN_MS)
        entry(page).fill("")
        WAYS[way](page, text)
        press(page)
        until(partial(has_heard, node, TOPIC, before + i + 1), "it is received")
        shown = entry(page).input_value()
        assert read_number(shown, language) == number, shown
    assert node.heard_data(TOPIC)[before:] == [number for _, number in accepted]


@pytest.mark.long("every screen")
@pytest.mark.parametrize(("language", "locale"), READERS)
def test_the_keypad_reads_by_the_same_rules(
    node: RosNode, opens: Opens, language: str, locale: str
) -> None:
    page = opens(language, locale, has_touch=True)
    decimal, other = (",", ".") if language == "de" else (".", ",")
    before = len(node.heard(TOPIC))
    page.locator("#input-level").tap()
    sheet = page.locator(".sheet.keypad")
    for key in ("1", ".", "5"):
        sheet.locator(f'[data-key="{key}"]').tap()
    expect(sheet.locator("output")).to_have_text(f"1{decimal}5")
    sheet.locator(".set-entry").tap()
    expect(entry(page)).to_have_value(f"1{decimal}5")
    expect(page.locator("body[data-settling]")).to_have_count(0)
    for enters, text in ((by_hand, f"2{other}5"), (pasted, f"2{other}5"), (composed, "２ー５")):
        page.locator("#input-level").tap()
        expect(sheet).to_be_visible()
        page.locator("#input-level").select_text()
        enters(page, text)
        expect(sheet.locator("output")).to_have_text(text)
        expect(sheet.locator(".set-entry")).to_be_disabled()
        example = "1.234,5" if language == "de" else "1,234.5"
        expect(sheet.locator(".entered p")).to_contain_text(example)
        sheet.locator(".cancel-entry").tap()
        expect(entry(page)).to_have_value(f"1{decimal}5")
        expect(page.locator("body[data-settling]")).to_have_count(0)
    page.locator("#input-level").tap()
    expect(sheet).to_be_visible()
    page.locator("#input-level").select_text()
    composed(page, "－２．５".replace("．", "，" if language == "de" else "．"))
    sheet.locator(".set-entry").tap()
    expect(entry(page)).to_have_value(f"−2{decimal}5")
    expect(page.locator("body[data-settling]")).to_have_count(0)
    press(page)
    until(partial(has_heard, node, TOPIC, before + 1), "it is received")
    assert node.heard_data(TOPIC)[before:] == [-2.5]


def test_confirmation_question_shows_the_values_that_are_sent(node: RosNode, opens: Opens) -> None:
    page = opens("de", "en-US")
    before = len(node.heard(TOPIC))
    typed(page, "-1.234,50")
    dialog = asked(page.locator('[data-widget="send_asked"] button[type=submit]').first)
    expect(dialog.locator("dd")).to_have_text("−1234,5")
    dialog.locator(".yes").click()
    until(partial(has_heard, node, TOPIC, before + 1), "it is received")
    assert node.heard_data(TOPIC)[before:] == [-1234.5]


def test_slider_and_its_buttons_show_the_value_that_is_sent(node: RosNode, opens: Opens) -> None:
    page = opens("de", "en-US")
    before = len(node.heard(TOPIC))
    more = page.locator('[data-widget="height"] .step').last
    for _ in range(3):
        more.click()
    expect(page.locator('[data-widget="height"] output')).to_have_text("0,3")
    press(page, "send_height")
    until(partial(has_heard, node, TOPIC, before + 1), "it is received")
    assert node.heard_data(TOPIC)[before:] == [0.3]
    for _ in range(3):
        page.locator('[data-widget="level"] .step').first.click()
    expect(entry(page)).to_have_value("−2000")  # nothing yet, then the lowest value, and never below it


def test_a_lone_group_that_may_be_either_is_judged_as_by_the_server(opens: Opens) -> None:
    for language in LANGUAGES:
        page = opens(language, "en-US")
        path = (page.locator("script[type=module]").get_attribute("src") or "").replace(
            "main", "number-inputs"
        )
        rows = [(text, limits, number) for text, its, limits, number in UNCLEAR if its == language]
        judged = page.evaluate(JUDGED, [path, [(text, *limits) for text, limits, _ in rows]])
        assert judged == [None if number is not None else "unclear" for *_, number in rows]


def test_a_lone_group_of_three_digits_is_refused_and_the_keypad_shows_how_it_was_read(
    node: RosNode, opens: Opens
) -> None:
    before = len(node.heard(TOPIC))
    for language, text, read in (("de", "1.000", "1000"), ("en", "1.250", "1.25")):
        page = opens(language, "en-US", has_touch=True)
        entry(page).evaluate("(input, text) => { input.value = text; }", text)
        entry(page).dispatch_event("input")
        expect(entry(page)).to_have_attribute("data-unread", "unclear")
        press(page)
        expect(page.locator("#receipt-send")).to_contain_text(text)
        expect(entry(page)).to_have_value(text)
        entry(page).evaluate("(input) => { input.value = ''; }")
        page.locator("#input-level").tap()
        expect(page.locator(".sheet.keypad")).to_be_visible()
        page.locator("#input-level").select_text()
        by_hand(page, text)
        expect(page.locator(".sheet.keypad output")).to_have_text(text)
        page.locator(".sheet.keypad .set-entry").tap()
        expect(entry(page)).to_have_value(read)
        expect(entry(page)).not_to_have_attribute("data-unread")
        page.close()
    assert node.heard_data(TOPIC)[before:] == []


def exact(number: float | str | None) -> float | str | None:
    return number if isinstance(number, str | None) else float(number)


def test_scripts_and_server_read_the_same(opens: Opens) -> None:
    for language in LANGUAGES:
        page = opens(language, "en-US")
        path = (page.locator("script[type=module]").get_attribute("src") or "").replace(
            "main", "number-text"
        )
        rows = [(row.text, row.whole, False) for row in TABLE if row.language == language]
        texts = [text for text, _ in generated(20_000, seed=len(rows))]
        rows += [(text, whole, False) for text in texts for whole in (False, True)]
        pairs = zip(texts, [", ", "; ", ","] * len(texts), texts[1:], strict=False)
        rows += [(f"{before}{between}{other}", False, True) for before, between, other in pairs]
        read = page.evaluate(READ, [path, rows])
        for (text, whole, is_list), numbers in zip(rows, read, strict=True):
            if is_list:
                own: Any = [as_sent(number) for number in read_numbers(text, language)]
                by_server: Any = [exact(number) for number in numbers]
            else:
                own = as_sent(read_number(text, language, whole=whole))
                by_server = exact(numbers)
            assert own == by_server, (text, language, whole)


def test_scripts_and_server_judge_limits_and_steps_the_same(opens: Opens) -> None:
    page = opens("en", "de-DE")
    path = (page.locator("script[type=module]").get_attribute("src") or "").replace(
        "main", "number-inputs"
    )
    chance = random.Random(2)
    rows: list[tuple[float, Range, bool]] = []
    for _ in range(5_000):
        whole = chance.random() < 0.3
        step = (
            chance.choice([1, 2, 5, 10**10]) if whole else chance.choice([0.1, 0.01, 0.25, 1e-3, 2.5])
        )
        low = step * chance.randint(-9, 9) if whole else round(step * chance.randint(-9, 9), 3)
        limits = Range(low, low + step * 100 if whole else round(low + step * 100, 3), step)
        value = low + step * chance.randint(-1, 101)
        value += chance.choice([0, 0, 1e-16, -1e-11, 0.9e-9, -0.9e-9, 1.1e-9, 1e-3, 0.5]) * step
        rows.append((round(value) if whole else value, limits, whole))
    sent = [
        (
            decimal_text(value),
            *(decimal_text(limit or 0) for limit in (limits.low, limits.high, limits.step)),
            whole,
        )
        for value, limits, whole in rows
    ]
    problems = page.evaluate(JUDGED, [path, sent])
    for (value, limits, _), problem in zip(rows, problems, strict=True):
        assert limits.contains(value) == (problem is None), (value, limits, problem)
    assert 500 < problems.count(None) < 4_500


def test_a_sum_of_steps_is_on_a_step(node: RosNode, opens: Opens, cell: Server) -> None:
    page = opens("de", "en-US")
    before = len(node.heard(TOPIC))
    sums = (0.1 + 0.2, 0.7999999999999999)
    for number in sums:
        answer = cell.http.post("/widgets/send_height", json={"inputs": {"height": number}})
        assert answer.status_code == 200
    form = {"height": "0,30000000000000004", "_language": "de"}
    assert cell.http.post("/widgets/send_height", data=form).status_code == 303
    page.locator("#input-fine").fill("0,30000000000000004")
    expect(page.locator("#input-fine:invalid")).to_have_count(0)
    press(page, "send_fine")
    until(partial(has_heard, node, TOPIC, before + 4), "all are received")
    assert node.heard_data(TOPIC)[before:] == [*sums, 0.1 + 0.2, 0.1 + 0.2]
    page.locator('[data-widget="fine"] .step').last.click()
    expect(page.locator("#input-fine")).to_have_value("0,4")

"""The reason of a stop is given by a finger: the question on the line, the keys, the figures at each
size; before the shift ends those of all robots."""

import re
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Final

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.test_accessibility import violations
from tests.browser.test_alarm_line import SIZES, started
from tests.support.browser.pages import DRAWN, without_its_time
from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.web.test_oee import PANEL, TWO_ROBOTS, asked_stops

# In each language: the question, its robots, the name of the robot on the right, a reason.
WORDS: Final = {
    "en": (
        r"Stops without a reason: \d+",
        r"Left: \d+, Right: \d+\. Say why before the shift ends\.",
        "Right",
        "Material",
    ),
    "ja": (
        r"理由が未回答の停止：\d+",
        r"左：\d+、右：\d+。シフト終了前に回答してください。",
        "右",
        "材料",
    ),
    "de": (
        r"Stillstände ohne Grund: \d+",
        r"Links: \d+, Rechts: \d+\. Bitte vor Schichtende angeben\.",
        "Rechts",
        "Material",
    ),
}
CUT: Final = "element => element.scrollWidth > element.clientWidth"


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("cell"), PANEL) as server:
        yield server


@pytest.mark.parametrize("size", SIZES)
def test_a_finger_answers_and_the_figures_say_so(
    cell: Server, chromium: Browser, size: tuple[int, int]
) -> None:
    width, height = size
    opened = chromium.new_context(
        viewport={"width": width, "height": height}, has_touch=True, bypass_csp=True
    )
    with closing(opened) as context:
        answer_by_finger(cell, context.new_page(), width)


def answer_by_finger(cell: Server, page: Page, width: int) -> None:
    started(page, cell.url)
    reason = page.locator(".asked-key")
    expect(reason).to_be_visible(timeout=20_000)
    expect(page.locator(".asked b")).to_contain_text("Stood still for")
    assert page.locator(".alarm-line button[type=submit]").is_hidden()
    reason.tap()
    key = page.locator(".reasons button", has_text="Material")
    expect(key).to_be_in_viewport()
    page.evaluate(DRAWN)
    box = key.bounding_box()
    assert box is not None
    assert box["height"] >= 44
    assert violations(page) == []
    key.tap()
    expect(page.locator(".reasons [aria-pressed=true]")).to_contain_text("Material")
    expect(page.locator(".reasons .given")).to_contain_text("Material, by")
    started(page, f"{cell.url}/oee")
    expect(page.locator(".pareto")).to_contain_text("Material")
    page.evaluate(DRAWN)
    assert page.evaluate("document.documentElement.scrollWidth") == width
    assert violations(page) == []
    for link in page.locator(".oee-stops a").all():
        place = link.bounding_box()
        assert place is not None
        assert place["height"] >= 44


def test_the_stops_of_two_robots_are_asked_together_and_answered_by_a_finger(
    tmp_path: Path, chromium: Browser
) -> None:
    with demo_server(tmp_path, TWO_ROBOTS, app="tests.support.apps.shift_end:app") as server:
        left = server.robot("left")
        both = {"left", "right"}
        until(lambda: {stop["robot"] for stop in asked_stops(left)} == both, "both are asked", 60)
        for language, size in zip(WORDS, SIZES, strict=True):
            opened = chromium.new_context(locale=language, has_touch=True, bypass_csp=True)
            with closing(opened) as context:
                page = context.new_page()
                for width, height in SIZES:
                    page.set_viewport_size({"width": width, "height": height})
                    ask_of_both(server, page, language, width)
                width, height = size
                page.set_viewport_size({"width": width, "height": height})
                answer_of_right(server, page, language)


def ask_of_both(server: Server, page: Page, language: str, width: int) -> None:
    """The line, and the list to which its key leads."""
    text, times, name, _ = WORDS[language]
    page.goto(f"{server.url}/robots/left/pages/main")
    for selector, wanted in (("b", text), ("small", times)):
        line = page.locator(f".asked {selector}")
        expect(line).to_have_text(re.compile(wanted), timeout=20_000)
        assert not line.evaluate(CUT)
    page.locator(".asked-key").tap()
    expect(page.locator(".oee-stops .of-robot").last).to_have_text(name)
    expect(page.locator(".oee-stops h2")).to_be_in_viewport()
    page.evaluate(DRAWN)
    assert page.evaluate("document.documentElement.scrollWidth") == width
    box = page.locator(".oee-stops .answer").first.bounding_box()
    assert box
    assert box["height"] >= 44


def answer_of_right(server: Server, page: Page, language: str) -> None:
    """A touch answers a stop of the robot on the right, which is in the list no longer."""
    *_, name, material = WORDS[language]
    assert violations(page) == []
    group = page.locator(".oee-stops tbody", has=page.locator(".of-robot", has_text=name))
    answer = group.locator(".answer").first
    address = answer.get_attribute("href")
    answer.tap()
    expect(page.locator(".reasons-head b")).to_have_text(name)
    expect(page.locator(".reasons-head b")).to_be_in_viewport()
    assert violations(page) == []
    without_its_time(page)
    page.locator(".reasons button", has_text=material).tap()
    expect(page.locator(".reasons [aria-pressed=true]")).to_contain_text(material)
    page.goto(f"{server.url}/oee?open=1")
    expect(page.locator(".oee-stops h2")).to_be_attached()
    expect(page.locator(f'.answer[href="{address}"]')).to_have_count(0)

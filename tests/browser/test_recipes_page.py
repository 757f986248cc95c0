"""The page of recipes: chosen, loaded and edited by touch; it follows the robot and other browsers."""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest
from playwright.sync_api import Page, expect

from app.web.language import COOKIE as LANGUAGE
from tests.browser.test_accessibility import violations
from tests.cell.recipes.panels import CARTON, TRAY
from tests.support.browser.browsers import sized
from tests.support.browser.pages import DRAWN, settled
from tests.support.parts import TAP_AGAIN_MS, Server
from tests.web.test_recipes import act, exported, load, make, server_with

pytestmark = [pytest.mark.long("detail"), pytest.mark.promise("recipes")]

SIZES: Final = ((1280, 800), (1024, 600), (800, 480))
LOAD: Final = "[data-widget=boxes] .load > button"
# Texts and buttons that leave their place, by their classes and texts.
CUT: Final = """() => [...document.querySelectorAll("main :is(.act, .act *, em, .face .label)")]
  .filter((e) => e.checkVisibility() && e.scrollWidth > e.clientWidth + 1 && e.clientWidth > 0)
  .map((e) => e.className + ":" + e.textContent.trim())"""


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[Server]:
    """It has two recipes, and neither is in the robot."""
    with server_with(tmp_path) as server:
        make(server, "Carton 400 × 300", CARTON)
        make(server, "Tray", TRAY)
        yield server


def started(page: Page, url: str) -> Page:
    page.goto(url)
    expect(page.locator("html[data-floor]")).to_be_attached()
    return page


@pytest.mark.long(None)
def test_a_recipe_is_chosen_and_loaded_and_the_page_says_so(cell: Server, page: Page) -> None:
    started(page, f"{cell.url}/recipes/boxes")
    page.locator("ol.recipes a", has_text="Tray").click()
    expect(page.locator(".recipe h2")).to_have_text("Tray")
    expect(page.locator('[data-row=gripper][data-state="differs"]')).to_contain_text("Vacuum")
    expect(page.locator(".loads")).to_have_text("5 values change")
    page.locator(LOAD).click()
    expect(page.locator(".foot .result")).to_contain_text("Tray is loaded")
    expect(page.locator("ol.recipes li", has=page.locator("em"))).to_contain_text("Tray")
    expect(page.locator('[data-state="differs"]')).to_have_count(0)
    expect(page.locator(".recipe .head p")).to_have_text("The robot has these values")


def test_the_page_follows_other_browsers_and_loads_what_it_shows(cell: Server, page: Page) -> None:
    started(page, f"{cell.url}/recipes/boxes?recipe=tray")
    act(cell, "save", recipe="tray", version=1, values={**TRAY, "length": 555})
    expect(page.locator("[data-row=length] .mine")).to_have_text("555 mm")
    expect(page.locator(LOAD)).to_have_attribute("value", "tray@2")
    load(cell, "tray@2")
    expect(page.locator("ol.recipes em")).to_have_count(1)


def test_a_recipe_is_edited_by_keyboard_and_touch(cell: Server, page: Page) -> None:
    started(page, f"{cell.url}/recipes/boxes?recipe=tray")
    page.get_by_role("link", name="Edit").click()
    page.locator("#input-length").fill("450")
    page.locator("#input-fast").evaluate("(box) => box.click()")
    page.wait_for_timeout(TAP_AGAIN_MS)
    page.get_by_role("button", name="Save").click()
    expect(page.locator("[data-row=length] .mine")).to_have_text("450 mm")
    row = exported(cell)["Tray"]
    assert (row["length"], row["fast"], row["version"]) == ("450", "false", "2")
    page.get_by_role("link", name="History").click()
    expect(page.locator("ol.versions li").first).to_contain_text(
        "Length 600 mm → 450 mm, Fast On → Off"
    )
    page.wait_for_timeout(TAP_AGAIN_MS)
    page.get_by_role("button", name="Restore").click()
    expect(page.locator("[data-row=length] .mine")).to_have_text("600 mm")


def test_an_edit_that_came_second_is_refused_with_who_was_first(cell: Server, page: Page) -> None:
    started(page, f"{cell.url}/recipes/boxes?recipe=tray&mode=edit")
    act(cell, "save", recipe="tray", version=1, values={**TRAY, "note": "first"})
    page.locator("#input-note").fill("second")
    page.wait_for_timeout(TAP_AGAIN_MS)
    page.get_by_role("button", name="Save").click()
    expect(page.locator(".said")).to_contain_text("Tray was changed by")
    assert exported(cell)["Tray"]["note"] == "first"


def test_recipes_are_made_named_and_deleted(cell: Server, page: Page) -> None:
    started(page, f"{cell.url}/recipes/boxes?mode=new")
    page.get_by_label("Name").fill("Bag 25 kg")
    page.wait_for_timeout(TAP_AGAIN_MS)
    page.get_by_role("button", name="Save").click()
    expect(page.locator(".recipe h2")).to_have_text("Bag 25 kg")
    for link, button, name in (("Copy", "Copy", "Sack"), ("Rename", "Rename", "Sack 2")):
        page.locator("[popovertarget=more]").click()
        page.locator("#more").get_by_role("link", name=link).click()
        page.get_by_label("Name").fill(name)
        page.wait_for_timeout(TAP_AGAIN_MS)
        page.get_by_role("button", name=button).click()
        expect(page.locator(".recipe h2")).to_have_text(name)
    page.locator("[popovertarget=more]").click()
    page.locator("#more").get_by_role("link", name="Delete").click()
    page.wait_for_timeout(TAP_AGAIN_MS)
    page.get_by_role("button", name="Delete").click()
    expect(page.locator("ol.recipes li")).to_have_count(3)
    assert {*exported(cell)} == {"Carton 400 × 300", "Tray", "Bag 25 kg"}


def test_a_page_without_scripts_is_locked_and_says_why(cell: Server, without_scripts: Page) -> None:
    page = without_scripts
    page.goto(f"{cell.url}/recipes/boxes?recipe=tray")
    expect(page.locator(LOAD)).to_be_disabled()
    expect(page.locator(".recipe noscript")).to_have_js_property(
        "textContent", "Locked: recipes need JavaScript."
    )
    page.get_by_role("link", name="Edit").click()
    expect(page.get_by_role("button", name="Save")).to_be_disabled()
    expect(page.locator(".recipe noscript")).to_have_js_property(
        "textContent", "Locked: recipes need JavaScript."
    )


def test_axe_finds_nothing_and_nothing_is_cut_at_any_size(cell: Server, axe_page: Page) -> None:
    load(cell, "tray@1")
    shown = ("?recipe=tray", "", "?recipe=tray&mode=edit", "?recipe=tray&mode=history", "?mode=csv")
    for language in ("en", "ja", "de"):
        axe_page.context.add_cookies([{"name": LANGUAGE, "value": language, "url": cell.url}])
        for query in shown:
            started(axe_page, f"{cell.url}/recipes/boxes{query}")
            for width, height in SIZES:
                sized(axe_page, width, height).evaluate(DRAWN)
                assert axe_page.evaluate("document.documentElement.scrollWidth") == width
                assert settled(axe_page, CUT) == [], (language, query, width)
                if language == "en":
                    assert violations(axe_page) == [], (query, width)

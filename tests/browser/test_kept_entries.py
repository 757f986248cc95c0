"""What is entered on a page is there again after another page: a browser, a server that restarts."""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest
from playwright.sync_api import Page, Route, expect

from tests.support.browser.pages import widget
from tests.support.browser.touch import loaded
from tests.support.parts import ROOT, Server, until
from tests.support.servers import demo_server, ready

PANEL: Final = """
title = "Cell"
languages = ["en", "de"]

[[page]]
id = "one"
title = "One"

[[page.widget]]
id = "level"
kind = "number"
label = "Level"
min = -2.0
max = 2000.0
default = 1

[[page.widget]]
id = "height"
kind = "slider"
label = "Height"
min = 0.0
max = 2.0
step = 0.1

[[page.widget]]
id = "note"
kind = "text"
label = "Note"

[[page.widget]]
id = "mode"
kind = "select"
label = "Mode"
options = [{ value = 1, label = "Slow" }, { value = 2, label = "Fast" }]

[[page.widget]]
id = "light"
kind = "toggle"
label = "Light"

[[page.widget]]
id = "gain"
kind = "parameter"
label = "Gain"
node = "/arm"
parameter = "gain"
type = "double"
min = 0.0
max = 5.0

[[page.widget]]
id = "gains"
kind = "parameter"
label = "Gains"
node = "/arm"
parameter = "gains"
type = "double[]"
min = 0.0
max = 5.0

[[page.widget]]
id = "send"
kind = "publish"
label = "Send"
topic = "/level"
type = "std_msgs/msg/Float64"
message = { data = "{level}" }

[[page]]
id = "two"
title = "Two"

[[page.widget]]
id = "level_two"
kind = "number"
label = "Level"
min = 0.0
max = 9.0
"""
GAIN: Final = '[data-widget="gain"] input'
GAINS: Final = '[data-widget="gains"] input'


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    mine = demo_server(tmp_path_factory.mktemp("cell"), PANEL)
    yield mine
    mine.end()


def opened(page: Page, kiosk: Server) -> Page:
    return loaded(page, kiosk, "/pages/one")


def gone_and_back(page: Page) -> None:
    is_kept(page)
    page.get_by_role("link", name="Two").click()
    expect(page.locator("#input-level_two")).to_have_value("")
    page.get_by_role("link", name="One").click()
    is_kept(page)


def is_kept(page: Page) -> None:
    """The script that keeps entries is there: it comes with the first entry."""
    expect(page.locator("html[data-kept]")).to_be_attached()


def enter(page: Page) -> None:
    page.locator("#input-level").fill("1,234.50")
    for _ in range(3):
        widget(page, "height").locator(".step").last.click()
    page.locator("#input-note").fill("grüezi <b>")
    page.locator("#input-mode").select_option("2")
    page.locator("#input-light").check(force=True)
    page.locator(GAIN).fill("4.5")
    page.locator(GAINS).fill("1.5, 2")


def are_there(page: Page) -> None:
    expect(page.locator("#input-level")).to_have_value("1234.5")
    expect(page.locator("#input-height")).to_have_value("0.3")
    expect(widget(page, "height").locator("output")).to_have_text("0.3")
    expect(page.locator("#input-note")).to_have_value("grüezi <b>")
    expect(page.locator("#input-mode")).to_have_value("2")
    expect(page.locator("#input-light")).to_be_checked()
    expect(page.locator(GAIN)).to_have_value("4.5")
    expect(page.locator(GAINS)).to_have_value("1.5, 2")


def are_initial(page: Page) -> None:
    expect(page.locator("#input-level")).to_have_value("1")
    expect(page.locator("#input-height")).to_have_value("0")
    expect(page.locator("#input-note")).to_have_value("")
    expect(page.locator("#input-mode")).to_have_value("1")
    expect(page.locator("#input-light")).not_to_be_checked()
    expect(page.locator(GAIN)).not_to_have_value("4.5")


def test_entry_is_kept_over_another_page_and_is_not_sent(kiosk: Server, page: Page) -> None:
    sent: list[str] = []
    page.on("request", lambda request: sent.append(request.url) if request.method == "POST" else None)
    page.on("websocket", lambda socket: socket.on("framesent", lambda text: sent.append(str(text))))
    opened(page, kiosk)
    are_initial(page)
    enter(page)
    for _ in range(2):  # what was restored is kept too
        gone_and_back(page)
        are_there(page)
    page.reload()
    are_there(page)
    assert sent == []
    page.locator('[data-widget="send"] button[type=submit]').click()
    expect(page.locator("#receipt-send")).to_contain_text("Sent at")


def test_entry_before_the_scripts_arrive_is_kept(kiosk: Server, page: Page) -> None:
    """The robot's value is not put over it: the press would send that in its place."""
    held: list[Route] = []
    page.route("**/main.js", lambda route: held.append(route))
    page.goto(kiosk.url + "/pages/one", wait_until="domcontentloaded")
    page.locator("#input-height").fill("0.3")
    for name, text in {"level": "1234.5", "note": "grüezi <b>"}.items():
        page.locator(f"#input-{name}").fill(text)
    page.locator("#input-mode").select_option("2")
    page.locator("#input-light").check(force=True)
    page.locator(GAIN).fill("4.5")
    page.locator(GAINS).fill("1.5, 2")
    until(lambda: bool(held), "the page's script is requested")
    page.unroute("**/main.js")  # lets what is held go on
    is_kept(page)
    for gain in (3, 2):  # one of them is another than before
        kiosk.http.post("/widgets/gain", json={"inputs": {"gain": gain}})
        expect(widget(page, "gain").locator(".value")).to_have_text(str(gain))
    are_there(page)
    gone_and_back(page)
    are_there(page)


@pytest.mark.long("detail")
def test_a_number_is_restored_in_the_notation_of_the_page(kiosk: Server, page: Page) -> None:
    opened(page, kiosk)
    enter(page)
    page.locator(".menu-key").click()
    page.get_by_role("button", name="Deutsch", exact=True).click()
    expect(page.locator("html[lang=de][data-kept]")).to_be_attached()
    expect(page.locator("#input-level")).to_have_value("1234,5")
    expect(page.locator(GAINS)).to_have_value("1,5; 2")


@pytest.mark.long("detail")
def test_a_parameter_follows_the_robot_again_after_it_is_set(kiosk: Server, page: Page) -> None:
    opened(page, kiosk)
    page.locator(GAIN).fill("4.5")
    page.get_by_role("button", name="Set Gain", exact=True).click()
    expect(widget(page, "gain").locator(".result")).to_contain_text("Set to 4.5")
    kiosk.http.post("/widgets/gain", json={"inputs": {"gain": 3}})
    expect(page.locator(GAIN)).to_have_value("3")
    gone_and_back(page)
    expect(page.locator(GAIN)).to_have_value("3")


@pytest.mark.long("detail")
def test_entry_outside_the_limits_or_not_a_number_is_not_restored(kiosk: Server, page: Page) -> None:
    opened(page, kiosk)
    initial = page.locator(GAINS).input_value()
    for level, gains in (("2000.1", "1, 6"), ("1,5", "1.5; 2"), ("", "1,234")):
        page.locator("#input-level").fill(level)
        page.locator(GAINS).fill(gains)
        gone_and_back(page)
        expect(page.locator("#input-level")).to_have_value("1")
        expect(page.locator(GAINS)).to_have_value(initial)
    # Nor what is in the storage by another way.
    page.locator("#input-level").fill("5")
    gone_and_back(page)
    expect(page.locator("#input-level")).to_have_value("5")
    page.evaluate(
        """() => {
          const wrong = '"level":"5000","mode":"7","light":"x"';
          const key = Object.keys(sessionStorage).find((name) => name.endsWith("/one"));
          addEventListener("pagehide", () => {
            sessionStorage.setItem(key, sessionStorage.getItem(key).replace('"level":"5"', wrong));
          });
        }"""
    )
    gone_and_back(page)
    are_initial(page)


@pytest.mark.parametrize(
    "change",
    [False, pytest.param(True, marks=pytest.mark.long("detail"))],
    ids=["a restart", "another panel file"],
)
def test_restart_discards_the_entered_value(page: Page, tmp_path: Path, change: bool) -> None:
    first = demo_server(tmp_path, PANEL)
    try:
        opened(page, first)
        enter(page)
        gone_and_back(page)
        are_there(page)
        page.goto("about:blank")  # the page would load itself again
    finally:
        first.end()
    path = tmp_path / "again.toml"
    path.write_text(PANEL.replace('label = "Note"', 'label = "Remark"') if change else PANEL)
    again = ready(Server(ROOT, first.port, KIOSK_PANEL=str(path), KIOSK_MODE="demo"))
    try:
        page.goto(f"{again.url}/pages/one")
        expect(page.locator("html[data-kept]")).to_be_attached()  # what is kept is read
        are_initial(page)
    finally:
        again.end()


@pytest.mark.long("detail")
def test_each_robot_has_its_own_kept_entries(page: Page, tmp_path: Path) -> None:
    robots = "".join(
        f'[[robot]]\nid = "{id}"\nname = "{id}"\nnamespace = "/{id}"\n' for id in ("r1", "r2")
    )
    server = demo_server(tmp_path, PANEL.replace("[[page]]", f"{robots}\n[[page]]", 1))
    try:
        for robot in ("r1", "r2"):
            loaded(page, server, f"/robots/{robot}/pages/one")
            are_initial(page)
            page.locator("#input-note").fill(f"for {robot}")
            is_kept(page)
        for robot in ("r1", "r2"):
            loaded(page, server, f"/robots/{robot}/pages/one")
            expect(page.locator("#input-note")).to_have_value(f"for {robot}")
    finally:
        server.end()

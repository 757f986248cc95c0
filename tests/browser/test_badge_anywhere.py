"""At the sign-in a badge goes to the badge, whatever has the focus, and stands nowhere to be read."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.test_fast_keys import Reader
from tests.support.parts import ROOT, Server
from tests.support.servers import ready
from tests.support.users import add_user

pytestmark = pytest.mark.long("real time")

BADGE = "04A2B3"


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    data = tmp_path_factory.mktemp("data")
    add_user(data, "M. Sato", "operator", pin="2580", badge=BADGE)
    add_user(data, "J. Brandt", "engineer", password="long enough")
    panel = str(ROOT / "tests/reference.toml")
    with ready(Server(ROOT, KIOSK_DATA=str(data), KIOSK_MODE="demo", KIOSK_PANEL=panel)) as mine:
        yield mine


@pytest.mark.parametrize("suffix", ["\n", "\t", "\n\n", ""])
@pytest.mark.parametrize(
    ("query", "focused"),
    [
        ("", "#badge"),
        ("", "body"),
        ("?user=M.+Sato", "input[name=pin]"),
        ("?user=M.+Sato", ".pad button >> nth=3"),
        ("?user=J.+Brandt", "#password"),
        ("?user=J.+Brandt", ".sign-in-key"),
        ("?other=1", "#user"),
        ("?other=1", "a.tile >> nth=0"),
    ],
)
def test_a_badge_signs_in_whatever_has_the_focus(
    own_page: Page, kiosk: Server, query: str, focused: str, suffix: str
) -> None:
    if focused == "#badge" and not suffix:
        return  # the field itself waits for the end
    page = own_page
    page.goto(f"{kiosk.url}/signin{query}")
    expect(page.locator("html[data-floor]")).to_be_attached()
    if focused == "body":
        page.evaluate("document.activeElement.blur()")
    else:
        page.locator(focused).focus()
    Reader(page).type(BADGE + suffix)
    expect(page.locator("a.user")).to_have_attribute("data-user", "M. Sato")
    assert BADGE not in page.content() + page.url
    values = page.evaluate("[...document.querySelectorAll('input')].map((input) => input.value)")
    assert BADGE not in "".join(values)

"""Sign-in by a provider in a browser: its page is of another site, which keeps cookies back."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.support.oidc_provider import SECRET, Provider, provider
from tests.support.parts import ROOT, Server
from tests.support.servers import ready
from tests.support.users import add_user

pytestmark = pytest.mark.long("detail")

OIDC = """
[access.oidc]
issuer = "{url}"
client_id = "panel1"
name = "Plant login"
secret_file = "{secret}"
operator = ["line1"]
"""
SIZES = ((1280, 800), (1024, 600), (800, 480))


@pytest.fixture(scope="module")
def plant() -> Iterator[Provider]:
    with provider("localhost") as mine:
        yield mine


@pytest.fixture(scope="module")
def kiosk(plant: Provider, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    data, folder = tmp_path_factory.mktemp("data"), tmp_path_factory.mktemp("panel")
    add_user(data, "M. Sato", "operator", pin="2580")
    (folder / "secret").write_text(SECRET)
    table = OIDC.format(url=plant.url, secret=folder / "secret")
    (folder / "panel.toml").write_text((ROOT / "tests/reference.toml").read_text() + table)
    with ready(
        Server(ROOT, KIOSK_DATA=str(data), KIOSK_MODE="demo", KIOSK_PANEL=str(folder / "panel.toml"))
    ) as mine:
        yield mine


@pytest.mark.long(None)
def test_a_user_of_the_plant_signs_in_with_a_touch(own_page: Page, kiosk: Server) -> None:
    page = own_page
    page.goto(kiosk.url)
    page.locator("a.user").click()
    page.get_by_role("link", name="Sign in with Plant login").click()
    expect(page.locator("a.user")).to_have_attribute("data-user", "oidc:sato")
    assert page.url == f"{kiosk.url}/"


def test_without_scripts_too_and_a_refusal_says_why(
    without_scripts: Page, kiosk: Server, plant: Provider
) -> None:
    page = without_scripts
    page.goto(f"{kiosk.url}/signin")
    page.get_by_role("link", name="Sign in with Plant login").click()
    page.wait_for_url(f"{kiosk.url}/")
    expect(page.locator("a.user")).to_have_attribute("data-user", "oidc:sato")
    plant.claims = {"groups": ["visitors"]}
    page.goto(f"{kiosk.url}/signin")
    page.get_by_role("link", name="Sign in with Plant login").click()
    expect(page.locator("p.said")).to_contain_text("None of your groups")


@pytest.mark.parametrize("language", ["en", "de", "ja"])
def test_the_tile_is_whole_at_every_size(own_page: Page, kiosk: Server, language: str) -> None:
    page = own_page
    page.set_extra_http_headers({"accept-language": language})
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        page.goto(f"{kiosk.url}/signin")
        text = page.locator(".tile.whole b")
        assert text.evaluate("(b) => b.scrollWidth <= b.clientWidth + 1"), (language, width)
        inside = "(b) => b.parentElement.scrollHeight <= b.closest('.tile').clientHeight + 1"
        assert text.evaluate(inside), (language, width)

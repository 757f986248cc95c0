"""Sign-in by a provider over HTTP: the way there and back, who may, and what another site can't do."""

import html
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import httpx
import pytest

from tests.support.oidc_provider import SECRET, Provider, provider
from tests.support.parts import ROOT, Server, until
from tests.support.servers import ready
from tests.support.users import Browsers, add_user, log_rows

pytestmark = pytest.mark.promise("neighbours")

PAGE = {"accept": "text/html"}
PANEL = """
title = "Cell"
mode = "demo"
[access]
groups = ["quality"]
[access.oidc]
issuer = "{url}"
client_id = "panel1"
name = "Plant login"
secret_file = "{secret}"
operator = ["line1"]
engineer = ["staff"]
[[page]]
id = "a"
title = "A"
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/start"
type = "std_msgs/msg/Bool"
message = {{ data = true }}
confirm_press = "pin"
[[page.widget]]
id = "bypass"
kind = "publish"
label = "Bypass"
topic = "/bypass"
type = "std_msgs/msg/Bool"
message = {{ data = true }}
confirm_press = "two_persons"
"""


@pytest.fixture(scope="module")
def plant() -> Iterator[Provider]:
    with provider() as mine:
        yield mine


@pytest.fixture(scope="module")
def kiosk(plant: Provider, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("panel")
    (folder / "secret").write_text(SECRET + "\n")
    panel = folder / "cell.toml"
    panel.write_text(PANEL.format(url=plant.url, secret=folder / "secret"))
    data = tmp_path_factory.mktemp("data")
    add_user(data, "M. Sato", "operator", pin="2580")
    with ready(Server(ROOT, KIOSK_DATA=str(data), KIOSK_PANEL=str(panel))) as mine:
        yield mine


@pytest.fixture
def browsers(plant: Provider) -> Iterator[Browsers]:
    plant.claims, plant.status = {}, 200
    every = Browsers()
    yield every
    every.close()


def gone_to_provider(browser: httpx.Client) -> str:
    """The address by which the provider sends the browser back."""
    begun = browser.get("/session/oidc")
    assert begun.status_code == 303
    return str(httpx.get(begun.headers["location"], trust_env=False).headers["location"])


def came_back(browser: httpx.Client, address: str) -> str:
    """Where the page that the browser comes back to leads."""
    answer = browser.get(address, headers={"sec-fetch-site": "cross-site"})
    assert answer.status_code == 200, answer.text
    return answer.text.partition('content="0;url=')[2].partition('"')[0]


def test_a_user_of_the_plant_signs_in_and_out(
    browsers: Browsers, kiosk: Server, plant: Provider
) -> None:
    plant.claims = {"groups": ["staff", "quality"]}
    browser = browsers.opened(kiosk.url)
    assert "Sign in with Plant login" in browser.get("/signin", headers={"accept": "text/html"}).text
    assert came_back(browser, gone_to_provider(browser)) == "/"
    said = browser.get("/session").json()
    assert (said["user"], said["role"], said["groups"]) == ("oidc:sato", "engineer", ["quality"])
    rows = [row for row in log_rows(browser) if row["action"] == "sign_in"]
    assert (rows[-1]["who"], rows[-1]["outcome"]) == ("oidc:sato", "accepted")
    assert browser.delete("/session").status_code == 204
    assert browser.get("/session").json()["user"] == ""


def test_a_sign_out_ends_the_session_at_the_provider_too(
    browsers: Browsers, kiosk: Server, plant: Provider
) -> None:
    browser = browsers.opened(kiosk.url)
    came_back(browser, gone_to_provider(browser))
    plant.ended.clear()
    answer = browser.post("/session/end")
    assert answer.status_code == 200
    assert browser.get("/session").json()["user"] == ""
    address = html.unescape(answer.text.partition('content="0;url=')[2].partition('"')[0])
    assert address.startswith(f"{plant.url}/end?")
    leads = httpx.get(address, trust_env=False).headers["location"]
    assert (leads, plant.ended) == (f"{kiosk.url}/signin", ["1"])
    local = browsers.signed_in(kiosk.url, "M. Sato", pin="2580")
    assert local.post("/session/end").headers["location"] == "/signin"


def test_a_user_of_the_provider_has_no_pin_and_is_shown_what_to_do(
    browsers: Browsers, kiosk: Server
) -> None:
    browser = browsers.opened(kiosk.url)
    came_back(browser, gone_to_provider(browser))
    sheet = browser.get("/widgets/start/confirm", headers=PAGE).text
    assert "Sign in as a user of this panel" in sheet
    assert 'name="_pin"' not in sheet
    answer = browser.post("/widgets/start/confirm", json={"pin": "2580"})
    assert (answer.status_code, answer.json()["code"]) == (403, "confirm_without_pin")
    second = {"user": "M. Sato", "pin": "2580"}
    answer = browser.post("/widgets/bypass/confirm", json=second)
    assert answer.status_code == 200, answer.text
    body = {"inputs": {}, "confirmation": answer.json()["confirmation"]}
    receipt = browser.post("/widgets/bypass", json=body).json()
    assert "oidc:sato" in receipt["reason"]
    assert "M. Sato" in receipt["reason"]


def test_a_code_works_once_and_in_its_own_browser_only(browsers: Browsers, kiosk: Server) -> None:
    browser, other = browsers.opened(kiosk.url), browsers.opened(kiosk.url)
    address = gone_to_provider(browser)
    assert came_back(other, address) == "/signin?refused=oidc_late"
    gone_to_provider(other)  # a state of its own does not help
    assert came_back(other, address) == "/signin?refused=oidc_late"
    assert other.get("/session").json()["user"] == ""
    assert came_back(browser, address) == "/"
    assert came_back(browser, address) == "/signin?refused=oidc_late"
    assert browser.get("/session").json()["user"] == "oidc:sato"


def test_without_a_role_or_after_a_refusal_nobody_is_signed_in(
    browsers: Browsers, kiosk: Server, plant: Provider
) -> None:
    browser = browsers.opened(kiosk.url)
    plant.claims = {"groups": ["visitors"]}
    assert came_back(browser, gone_to_provider(browser)) == "/signin?refused=oidc_no_role"
    page = browser.get("/signin?refused=oidc_no_role", headers={"accept": "text/html"}).text
    assert "None of your groups" in page
    plant.claims = {"nonce": "another"}
    assert came_back(browser, gone_to_provider(browser)) == "/signin?refused=oidc_invalid"
    state = parse_qs(urlsplit(gone_to_provider(browser)).query)["state"][0]
    back = f"/session/oidc/back?error=access_denied&state={state}"
    assert came_back(browser, back) == "/signin?refused=oidc_refused"
    assert browser.get("/session").json()["user"] == ""
    engineer = browsers.opened(kiosk.url)
    plant.claims = {"groups": ["staff"]}
    came_back(engineer, gone_to_provider(engineer))
    refused = [row["reason"] for row in log_rows(engineer) if row["outcome"] == "refused"]
    assert "None of your groups at Plant login has a role on this panel." in refused


def test_the_way_back_leads_to_the_panel_only(browsers: Browsers, kiosk: Server) -> None:
    browser = browsers.opened(kiosk.url)
    begun = browser.get("/session/oidc?next=https://evil.example").headers["location"]
    asked = parse_qs(urlsplit(begun).query)
    assert asked["redirect_uri"] == [f"{kiosk.url}/session/oidc/back"]
    address = gone_to_provider(browser) + "&next=https://evil.example"
    assert came_back(browser, address) == "/"


def test_another_site_begins_no_sign_in(browsers: Browsers, kiosk: Server) -> None:
    browser = browsers.opened(kiosk.url)
    answer = browser.get("/session/oidc", headers={"sec-fetch-site": "cross-site"})
    assert answer.headers["location"] == "/signin"


def test_a_panel_with_a_provider_is_closed_without_users_of_its_own(
    browsers: Browsers, plant: Provider, tmp_path: Path
) -> None:
    """And local users go on where the provider is away: nothing waits for it but its own sign-in."""
    panel = tmp_path / "cell.toml"
    panel.write_text(PANEL.format(url="http://127.0.0.1:9", secret=tmp_path / "none"))
    data = tmp_path / "data"
    data.mkdir(mode=0o700)
    with ready(Server(ROOT, KIOSK_DATA=str(data), KIOSK_PANEL=str(panel))) as server:
        browser = browsers.opened(server.url)
        said = browser.get("/session").json()
        assert (said["role"], said["users"]) == ("viewer", True)
        away = browser.get("/session/oidc").headers["location"]
        assert away == "/signin?refused=oidc_away"
        page = browser.get(away, headers={"accept": "text/html"}).text
        assert "Plant login can&#39;t be reached: Connection refused" in page
        add_user(data, "M. Sato", "operator", pin="2580")
        local = {"user": "M. Sato", "pin": "2580"}
        until(lambda: "M. Sato" in server.http.get("/signin", headers=PAGE).text, "the user is known")
        assert browser.post("/session", json=local).json()["user"] == "M. Sato"

"""Loads of recipes that are confirmed: the question names what changes, and a person answers it with
the PIN, or a second one does."""

import html
import re
from collections.abc import Iterator
from typing import Any, Final

import httpx
import pytest

from tests.cell.recipes.panels import CARTON, PANEL, TRAY
from tests.support.confirmed import add_users
from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.support.users import Browsers, log_rows

OTHER: Final = """
[[recipe]]
id = "pairs"
label = "Pairs"
fields = ["length", "speed"]
node = "/palletizer"
confirm_press = "two_persons"
confirm_s = 8.0
parameters = { length = "box.length", speed = "arm.speed" }
[[recipe]]
id = "asked"
label = "Asked"
fields = ["length", "speed"]
node = "/palletizer"
confirm_press = true
confirm_s = 8.0
parameters = { length = "box.length", speed = "arm.speed" }
"""
WITH_PIN: Final = PANEL.replace("confirm_s = 8.0", 'confirm_s = 8.0\nconfirm_press = "pin"', 1).replace(
    '[demo."/palletizer"]', f'{OTHER}\n[demo."/palletizer"]'
)
FAST: Final = {"length": 500, "speed": 90.0}
TAP_S: Final = 0.8  # a form that is sent sooner after its page is a second tap


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    data = tmp_path_factory.mktemp("data")
    add_users(data)
    browsers = Browsers()
    with demo_server(tmp_path_factory.mktemp("panel"), WITH_PIN, KIOSK_DATA=str(data)) as server:
        client = browsers.signed_in(server.url, "J. Brandt", pin="3691")
        made = {"Carton": ("boxes", CARTON), "Tray": ("boxes", TRAY)}
        made |= {"Pair": ("pairs", FAST), "Ask": ("asked", FAST)}
        for name, (set_id, values) in made.items():
            answer = client.post(f"/recipes/{set_id}/create", json={"name": name, "values": values})
            assert answer.json()["done"], answer.text
        until(lambda: "differ from what" in page(client, "boxes", "carton"), "the robot reports")
        yield server
    browsers.close()


def page(client: httpx.Client, set_id: str, recipe: str) -> str:
    return client.get(f"/recipes/{set_id}", params={"recipe": recipe}).text


def plain(text: str) -> str:
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", html.unescape(text)))


def load(client: httpx.Client, set_id: str, recipe: str, **more: Any) -> httpx.Response:
    return client.post(f"/widgets/{set_id}", json={"inputs": {set_id: recipe}, **more})


def confirm(client: httpx.Client, set_id: str, recipe: str, **body: Any) -> httpx.Response:
    return client.post(f"/widgets/{set_id}/confirm", json={"inputs": {set_id: recipe}, **body})


def sheet(client: httpx.Client, set_id: str, recipe: str) -> str:
    return plain(client.get(f"/widgets/{set_id}/confirm", params={"value": recipe}).text)


def loads(client: httpx.Client, set_id: str) -> list[dict[str, str]]:
    return [row for row in log_rows(client) if row["widget"] == set_id]


def test_a_recipe_is_loaded_with_the_right_pin_only(browsers: Browsers, cell: Server) -> None:
    client = browsers.signed_in(cell.url, "M. Sato", pin="2580")
    shown = sheet(client, "boxes", "tray@1")
    assert "Load Tray? " in shown
    assert "Length 400 mm → 600 mm" in shown
    assert "Gripper Vacuum → Fork" in shown
    refused = load(client, "boxes", "tray@1")
    assert (refused.status_code, refused.json()["code"]) == (403, "confirm_needed_pin")
    wrong = confirm(client, "boxes", "tray@1", pin="2581")
    assert (wrong.status_code, wrong.json()["code"]) == (401, "confirm_wrong_pin")
    token = confirm(client, "boxes", "tray@1", pin="2580").json()["confirmation"]
    other = load(client, "boxes", "carton@1", confirmation=token)
    assert other.json()["code"] == "confirm_needed_pin"  # it was for the other recipe
    token = confirm(client, "boxes", "tray@1", pin="2580").json()["confirmation"]
    receipt = load(client, "boxes", "tray@1", confirmation=token).json()
    assert receipt["outcome"] == "confirmed", receipt
    assert "Confirmed by M. Sato with the PIN." in receipt["reason"]
    rows = loads(client, "boxes")
    assert [row["outcome"] for row in rows if row["action"] == "confirm"] == ["refused"]
    done = rows[-1]
    assert (done["who"], done["outcome"]) == ("M. Sato", "confirmed")
    assert "Confirmed by M. Sato with the PIN." in done["reason"]
    assert "Gripper Vacuum → Fork" in done["reason"]


def test_a_second_person_confirms_and_the_log_names_both(browsers: Browsers, cell: Server) -> None:
    operator = browsers.signed_in(cell.url, "M. Sato", pin="2580")
    assert load(operator, "pairs", "pair@1").status_code == 403
    client = browsers.signed_in(cell.url, "K. Novak", pin="1470")
    assert "Load Pair?" in sheet(client, "pairs", "pair@1")
    assert load(client, "pairs", "pair@1").json()["code"] == "confirm_needed_two"
    alone = confirm(client, "pairs", "pair@1", user="K. Novak", pin="1470")
    assert (alone.status_code, alone.json()["code"]) == (403, "confirm_same_person")
    wrong = confirm(client, "pairs", "pair@1", user="J. Brandt", pin="3690")
    assert (wrong.status_code, wrong.json()["code"]) == (401, "confirm_wrong_pin")
    token = confirm(client, "pairs", "pair@1", user="J. Brandt", pin="3691").json()["confirmation"]
    receipt = load(client, "pairs", "pair@1", confirmation=token).json()
    assert receipt["outcome"] == "confirmed", receipt
    done = loads(client, "pairs")[-1]
    assert (done["who"], done["outcome"]) == ("K. Novak", "confirmed")
    assert "Confirmed by K. Novak and J. Brandt (PIN)." in done["reason"]


def test_a_load_that_asks_lists_what_changes(browsers: Browsers, cell: Server) -> None:
    client = browsers.signed_in(cell.url, "M. Sato", pin="2580")
    token = confirm(client, "boxes", "carton@1", pin="2580").json()["confirmation"]
    assert load(client, "boxes", "carton@1", confirmation=token).json()["outcome"] == "confirmed"
    dialog = page(client, "asked", "ask").partition('<dialog class="ask"')[2].partition("</dialog>")[0]
    assert "Load Ask?" in plain(dialog)
    assert " → 90 %" in plain(dialog)


@pytest.mark.parametrize("set_id", ["boxes", "asked"])
def test_no_recipe_is_loaded_without_scripts(browsers: Browsers, cell: Server, set_id: str) -> None:
    client = browsers.signed_in(cell.url, "M. Sato", pin="2580")
    shown = client.get(f"/recipes/{set_id}").text
    button = re.search(rf'<button[^>]*formaction="/widgets/{set_id}"[^>]*>', shown)
    assert button is not None
    assert button[0].endswith(" disabled>")
    assert "<noscript>Locked: recipes need JavaScript.</noscript>" in shown
    before = loads(client, set_id)
    refused = client.post(f"/widgets/{set_id}", data={set_id: "tray@1"})
    assert refused.status_code == 422
    assert loads(client, set_id) == before

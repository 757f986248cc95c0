"""Changes of recipes that a person confirms: the PIN again, or that of a second person."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import httpx
import pytest

from tests.cell.recipes.panels import CARTON, PANEL
from tests.support.confirmed import add_users
from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.support.users import Browsers, log_rows, says, token_of
from tests.web.test_confirm import form_fields
from tests.web.test_recipes_confirmed import plain

SECOND: Final = """
[[recipe]]
id = "pairs"
label = "Pairs"
fields = ["length", "speed"]
node = "/palletizer"
confirm_edit = "two_persons"
parameters = { length = "box.length", speed = "arm.speed" }
"""
CELL: Final = PANEL.replace("confirm_s = 8.0", 'confirm_s = 8.0\nconfirm_edit = "pin"').replace(
    '[demo."/palletizer"]', f'{SECOND}\n[demo."/palletizer"]'
)
VALUES: Final = {"length": "450", "speed": "80", "gripper": "vacuum", "fast": "false", "note": "-"}
PIN: Final = {"_enter": "yes", "_since": "0"}


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    add_users(folder)
    return folder


@pytest.fixture(scope="module")
def cell(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("panel"), CELL, KIOSK_DATA=str(data)) as server:
        yield server


def sent(client: httpx.Client, act: str, set_id: str = "boxes", **fields: str) -> httpx.Response:
    return client.post(
        f"/recipes/{set_id}/{act}", data={k.replace("own_", "-"): v for k, v in fields.items()}
    )


def asked(answer: httpx.Response) -> dict[str, str]:
    """The fields of the page that asks."""
    assert answer.status_code == 200, answer.text
    form = answer.text.partition("data-confirm-act")[2].partition("</form>")[0]
    return form_fields(form)


def names(client: httpx.Client, set_id: str = "boxes") -> list[str]:
    text = client.get(f"/recipes/{set_id}.csv").text
    return [line.partition(",")[0] for line in text.splitlines()[1:]]


def test_a_recipe_is_changed_with_the_right_pin_only_and_the_log_says_so(
    browsers: Browsers, cell: Server
) -> None:
    client = browsers.signed_in(cell.url, "K. Novak", pin="1470")
    answer = sent(client, "create", own_name="Carton", **VALUES)
    assert "Length — → 450 mm" in plain(answer.text)
    assert names(client) == []
    fields = asked(answer) | PIN
    wrong = client.post("/recipes/boxes/create", data=fields | {"_pin": "1471"})
    assert "The PIN is wrong. Tries left:" in plain(wrong.text)
    assert names(client) == []
    done = client.post("/recipes/boxes/create", data=asked(wrong) | PIN | {"_pin": "1470"})
    assert done.status_code == 303, plain(done.text)
    assert "Confirmed by K. Novak with the PIN." in plain(client.get(done.headers["location"]).text)
    assert names(client) == ["Carton"]
    saving = asked(
        sent(client, "save", own_recipe="carton", own_version="1", **VALUES | {"length": "500"})
    )
    done = client.post("/recipes/boxes/save", data=saving | PIN | {"_pin": "1470"})
    assert done.status_code == 303, plain(done.text)
    rows = [row for row in log_rows(client) if row["action"] == "recipe_save"]
    assert [(row["who"], row["outcome"]) for row in rows] == [("K. Novak", "succeeded")]
    assert "Length 450 mm → 500 mm" in rows[0]["reason"]
    assert "Confirmed by K. Novak with the PIN." in rows[0]["reason"]
    assert not says(log_rows(client), "1470")


def test_a_second_person_confirms_a_change(browsers: Browsers, cell: Server) -> None:
    client = browsers.signed_in(cell.url, "K. Novak", pin="1470")
    fields = asked(sent(client, "create", "pairs", own_name="Pair", length="400", speed="80")) | PIN
    own = client.post("/recipes/pairs/create", data=fields | {"_user": "K. Novak", "_pin": "1470"})
    assert own.status_code == 200
    done = client.post("/recipes/pairs/create", data=fields | {"_user": "J. Brandt", "_pin": "3691"})
    assert done.status_code == 303, plain(done.text)
    assert names(client, "pairs") == ["Pair"]
    made = [row for row in log_rows(client) if row["action"] == "recipe_create"][-1]
    assert "Confirmed by K. Novak and J. Brandt (PIN)." in made["reason"]


def test_what_nobody_has_confirmed_is_refused(browsers: Browsers, cell: Server, data: Path) -> None:
    body: dict[str, Any] = {"name": "Sly", "values": CARTON}
    client = browsers.signed_in(cell.url, "K. Novak", pin="1470")
    answer = client.post("/recipes/boxes/create", json=body)
    assert (answer.status_code, answer.json()["code"]) == (403, "confirm_needed_pin")
    token = {"authorization": f"Bearer {token_of(data, 'line', 'engineer')}"}

    def refused() -> str:
        code: str = (
            cell.http.post("/recipes/boxes/create", json=body, headers=token).json().get("code", "")
        )
        return code

    until(lambda: refused() == "confirm_by_program", "the token is known")
    operator = browsers.signed_in(cell.url, "M. Sato", pin="2580")
    lacking = sent(operator, "create", own_name="Sly", **VALUES)
    assert lacking.status_code == 303  # refused for the role, without a page that asks
    assert "Sly" not in names(client)


def test_without_users_changes_are_locked(tmp_path: Path) -> None:
    with demo_server(tmp_path, CELL) as server:
        answer = server.http.post("/recipes/boxes/create", json={"name": "Sly", "values": CARTON})
        assert answer.json()["code"] == "confirm_without_users"


def test_the_page_that_asks_goes_back_when_it_is_loaded_again(browsers: Browsers, cell: Server) -> None:
    client = browsers.signed_in(cell.url, "K. Novak", pin="1470")
    back = client.get("/recipes/boxes/save")
    assert (back.status_code, back.headers["location"]) == (303, "/recipes/boxes")

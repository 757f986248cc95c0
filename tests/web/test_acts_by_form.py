"""Every act as JSON and as a form: the same receipt, the same entry of the operator's log, the same
refusal. All are sent in the same order to two servers alike, one of which gets forms only."""

import html
import re
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import httpx
import pytest

from app.cell.commands.alarm_acts import ALARM_ACTS
from app.cell.commands.control_acts import CONTROL_ACTS, HAND_OVERS
from app.cell.commands.diagnostic_acts import DIAGNOSTIC_ACTS
from app.cell.commands.machine_acts import MACHINE_ACTS
from app.cell.commands.place_acts import PLACE_ACTS
from app.cell.commands.recipe_acts import RECIPE_ACTS
from app.cell.commands.shift_acts import SHIFT_ACTS
from app.cell.commands.user_acts import USER_ACTS
from tests.cell.recipes.panels import CARTON, PANEL
from tests.support.parts import ROOT, Server, until
from tests.support.servers import panel_file, ready
from tests.support.users import Browsers, add_user, log_rows

ALARM: Final = """
[[alarm]]
id = "air"
topic = "/air"
type = "std_msgs/msg/Float64"
text = "Air pressure low"
low = 5.0
[demo."/air"]
values = [4.5]
[control]
required = true
[record]
topics = ["/air"]
"""
HALL: Final = """
[[page]]
id = "drive"
title = "Drive"
[[page.widget]]
id = "hall"
kind = "map"
label = "Hall"
[[page.widget]]
id = "goal"
kind = "place"
label = "Places"
map = "hall"
touch = true
save = true
[[page.widget]]
id = "remark"
kind = "text"
label = "Remark"
[[page.widget]]
id = "tell"
kind = "publish"
label = "Tell"
topic = "/remark"
type = "std_msgs/msg/String"
message = { data = "{remark}" }
interlock = "never"
[[interlock]]
id = "never"
topic = "/never"
type = "std_msgs/msg/Bool"
field = "data"
"""
PATIENT: Final = "tests.support.apps.patient:app"
PIN: Final = "2580"
SECRET: Final = "7391"
RECIPE: Final = {**CARTON, "speed": 82.5}
CSV: Final = "name,length,speed,gripper,fast,note\nTray,600,80,fork,true,x\n"
POSE: Final = "x=1.50 y=1.00 yaw=1.57 map={map}"
COMPARED: Final = ("kind", "who", "action", "values", "outcome", "reason", "text")
BY_TIME: Final = {action for action, *_ in HAND_OVERS.values()}  # entries of no act
A_TIME: Final = r"\d{4}-\d\d-\d\d[T ][\d:.+]+|\d\d:\d\d(:\d\d)?"
Fields = Mapping[str, Any]


class Row(NamedTuple):
    """An act: what a program sends, and the form of a page where its fields differ."""

    path: str
    body: Fields = MappingProxyType({})
    form: Fields | None = None
    code: str = ""  # of its refusal

    @property
    def fields(self) -> dict[str, str]:
        sent = self.body if self.form is None else self.form
        return {name: str(value) for name, value in sent.items()}


def _recipe(**fields: Any) -> dict[str, Any]:
    """The fields of a form of recipes: "-" stands before its own, the others are values of inputs."""
    values = fields.pop("values", {})
    typed = {name: str(value).lower() for name, value in values.items()}
    return typed | {f"-{name}": value for name, value in fields.items()}


def _edit(act: str, code: str = "", /, **body: Any) -> Row:
    return Row(f"/recipes/boxes/{act}", body, _recipe(**body), code)


ROWS: Final = (
    Row("/control/release"),
    Row("/control/take"),
    Row("/control/ask"),
    Row("/control/give", {"to": "0123456789ab"}, code="control_changed"),
    Row("/control/keep", {"to": "0123456789ab"}, code="control_changed"),
    Row("/alarms/air/acknowledge", {"occurrence": 9}, code="alarm_came_again"),
    Row("/alarms/acknowledge", {"alarms": {"air": 1}}, {"occurrence.air": 1}),
    Row("/alarms/air/acknowledge", {"occurrence": 1}),
    Row("/alarms/air/shelve", {"reason": "test", "for_s": 600}),
    Row("/alarms/air/unshelve"),
    Row("/alarms/air/out_of_service", {"reason": "test"}),
    Row("/alarms/air/in_service"),
    Row("/alarms/air/reset", code="alarm_not_latched"),
    Row("/alarms/air/shelve", {"for_s": 600}, code="alarm_reason_missing"),
    Row("/alarms/none/reset", code="alarm_gone"),
    Row("/alarms/report", {"text": "Belt 2 slips."}),
    Row("/alarms/report", code="alarms_message_empty"),
    Row("/diagnostics/bundle"),
    Row("/diagnostics/foxglove"),
    Row("/diagnostics/check"),
    Row("/users/add", {"name": "Ito", "role": "viewer", "groups": [], "pin": SECRET},
        {"name": "Ito", "role": "viewer", "way": "pin", "secret": SECRET}),
    Row("/users/add", {"name": "Ito", "role": "viewer", "groups": []},
        {"name": "Ito", "role": "viewer"},
        code="users_no_way"),
    Row("/users/role", {"name": "Ito", "role": "operator", "groups": []},
        {"name": "Ito", "role": "operator"}),
    Row("/users/pin", {"name": "Ito", "pin": "8206"}, {"name": "Ito", "secret": "8206"}),
    Row("/users/password", {"name": "Ito", "password": "long enough"},
        {"name": "Ito", "secret": "long enough"}),
    Row("/users/badge", {"name": "Ito", "badge": "04A2"}, {"name": "Ito", "secret": "04A2"}),
    Row("/users/badge", {"name": "Ito", "none": True}, {"name": "Ito", "none": "true"}),
    Row("/users/disable", {"name": "Ito"}),
    Row("/users/enable", {"name": "Ito"}),
    Row("/users/remove", {"name": "Ito"}),
    Row("/users/remove", {"name": "Ito"}, code="users_unknown"),
    Row("/users/token", {"name": "mes", "role": "viewer"}),
    Row("/users/revoke", {"name": "mes"}),
    Row("/diagnostics/postpone", {"version": "9.9.9", "days": 7}, code="release_gone"),
    Row("/users/end", {"name": "0" * 16}, code="users_session_gone"),
    _edit("create", name="Carton", values=RECIPE),
    _edit("create", "recipe_name_taken", name="Carton", values=RECIPE),
    _edit("save", recipe="carton", version=1, values={**RECIPE, "length": 500}),
    _edit("save", "recipe_changed_since", recipe="carton", version=1, values=RECIPE),
    _edit("restore", recipe="carton", version=2, to=1),
    _edit("copy", recipe="carton", version=3, name="Second"),
    _edit("rename", recipe="second", version=1, name="Third"),
    _edit("import", csv=CSV),
    _edit("import", "between_sentences", csv="name\n"),
    _edit("delete", recipe="second", version=2),
    Row("/places/goal/save", {"name": "Bay", "value": POSE}),
    Row("/places/goal/save", {"name": "bay", "value": POSE}, code="place_name_taken"),
    Row("/places/goal/delete", {"place": "bay"}),
    Row("/places/goal/delete", {"place": "bay"}, code="saved_place_gone"),
)  # fmt: skip


class TypedForm(NamedTuple):
    """A form of a page on which text is entered: what is typed, and the markup that shows it again."""

    page: str
    action: str
    typed: Fields
    again: tuple[str, ...]


TYPED: Final = (
    TypedForm(
        "/users?mode=add",
        "/users/add",
        {"name": "Kato", "role": "viewer", "way": "password", "secret": SECRET},
        ('name="name" type="text" maxlength="40" required autocomplete="off" value="Kato"',
         'value="viewer" required checked', 'value="password" checked'),
    ),
    TypedForm(
        "/users?mode=token", "/users/token", {"name": "mes 7", "role": "viewer"},
        ('value="mes 7"', 'value="viewer" required checked'),
    ),
    TypedForm(
        "/recipes/boxes?mode=new",
        "/recipes/boxes/create",
        _recipe(name="Lid", values={**RECIPE, "length": 455, "note": "blue"}),
        ('value="Lid"', 'value="455"', 'value="82.5"', 'value="blue"'),
    ),
    TypedForm(
        "/recipes/boxes?recipe=kept&mode=edit",
        "/recipes/boxes/save",
        _recipe(recipe="kept", version=1, values={**RECIPE, "length": 466}),
        ('value="466"',),
    ),
    TypedForm(
        "/recipes/boxes?recipe=kept&mode=copy", "/recipes/boxes/copy",
        _recipe(recipe="kept", version=1, name="Copied"), ('value="Copied"',),
    ),
    TypedForm(
        "/recipes/boxes?recipe=kept&mode=rename", "/recipes/boxes/rename",
        _recipe(recipe="kept", version=1, name="Renamed"), ('value="Renamed"',),
    ),
    TypedForm(
        "/recipes/boxes?mode=csv", "/recipes/boxes/import",
        {"-csv": CSV}, (">name,length,speed,gripper,fast,note\nTray,600,80,fork,true,x\n</textarea>",),
    ),
    TypedForm("/places/goal?mode=save", "/places/goal/save", {"name": "Gate"}, ('value="Gate"',)),
    TypedForm("/alarms/report", "/alarms/report", {"text": "Oil is low."}, ('value="Oil is low."',)),
    TypedForm("/pages/drive", "/widgets/tell", {"remark": "as agreed"}, ('value="as agreed"',)),
)  # fmt: skip
NOT_READ: Final = TypedForm(
    "/recipes/boxes?mode=new",
    "/recipes/boxes/create",
    {"-name": "Lid", "length": "45O", "speed": "80", "gripper": "fork", "note": "blue"},
    ('value="Lid"', 'value="45O"', 'value="80"', 'value="blue"'),
)


@pytest.fixture(scope="module")
def browsers() -> Iterator[Browsers]:
    every = Browsers()
    yield every
    every.close()


def cell(folder: Path) -> Server:
    data = folder / "data"
    data.mkdir(mode=0o700)
    add_user(data, "Sato", "engineer", pin=PIN)
    add_user(data, "Mori", "viewer", pin=PIN)
    panel = panel_file(folder, PANEL + ALARM + HALL)
    more: Any = {"KIOSK_DATA": str(data), "KIOSK_PANEL": str(panel), "KIOSK_MODE": "demo"}
    return ready(Server(ROOT, app=PATIENT, **more))


def _is_on_the_map(server: Server) -> bool:
    return bool(server.widget("hall")["state"] == "live")


def _is_raised(server: Server) -> bool:
    return bool(server.http.get("/alarms").json()["alarms"])


@pytest.fixture(scope="module")
def cells(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Server, Server]]:
    """One gets JSON, the other one forms."""
    with (
        cell(tmp_path_factory.mktemp("json")) as first,
        cell(tmp_path_factory.mktemp("form")) as second,
    ):
        for server in (first, second):
            until(partial(_is_raised, server), "the alarm is raised")
            until(partial(_is_on_the_map, server), "the robot is on the map")
        yield first, second


class Sent(NamedTuple):
    """What came of an act: its answer, and the page after a form."""

    answer: httpx.Response
    page: str


def sent_by(
    client: httpx.Client, log: httpx.Client, name: str, as_form: bool
) -> tuple[list[Sent], list[dict[str, str]]]:
    """What came of all rows, and the entries of the log; `name` begins the ids."""
    send, before = _by_form if as_form else _by_json, len(log_rows(log))
    answers = []
    version = _map_version(log)
    for place, row in enumerate(ROWS):
        if row.body.get("value") == POSE:
            row = row._replace(body={**row.body, "value": POSE.format(map=version)})
        client.post("/control/here", json={"touched": True}).raise_for_status()
        answers.append(send(row, client, f"{name}-{place}"))
    entries = [
        {column: _timeless(entry[column]) for column in COMPARED}
        for entry in log_rows(log)[before:]
        if entry["action"] not in BY_TIME and entry["kind"] != "clock"
    ]
    return answers, entries


def _map_version(client: httpx.Client) -> str:
    page = client.get("/places/goal", params={"mode": "save"}).text
    version = re.search(r'name="map" value="([0-9a-f]{16})"', page)
    assert version, page
    return version[1]


def _by_json(row: Row, client: httpx.Client, act_id: str) -> Sent:
    return Sent(client.post(row.path, json={**row.body, "id": act_id}), "")


def _by_form(row: Row, client: httpx.Client, act_id: str) -> Sent:
    fields = row.fields | {"-id" if row.path.startswith("/recipes") else "id": act_id}
    headers = {"accept": "text/html"}
    answer = client.post(row.path, data=fields, headers=headers)
    if seen := re.search(r'name="-seen" value="([^"]+)"', answer.text):  # the comparison before
        answer = client.post(row.path, data={**fields, "-seen": seen[1]}, headers=headers)
    location = answer.headers.get("location")
    page = client.get(location, headers=headers, follow_redirects=True) if location else answer
    is_page = page.headers["content-type"].startswith("text/html")
    return Sent(answer, html.unescape(page.text) if is_page else "")


def _timeless(text: str) -> str:
    return re.sub(A_TIME, "a time", text)


def receipt_of(answer: httpx.Response) -> dict[str, Any]:
    content = answer.json()
    receipt: dict[str, Any] = content.get("receipts", [content])[0]
    return receipt


def test_all_acts_are_here() -> None:
    named = {(room, act) for _, room, *_, act in (row.path.split("/") for row in ROWS)}
    tables = {
        "control": CONTROL_ACTS,
        "alarms": ALARM_ACTS,
        "diagnostics": {**DIAGNOSTIC_ACTS, **MACHINE_ACTS},
        "users": USER_ACTS,
        "recipes": RECIPE_ACTS,
        "places": PLACE_ACTS,
    }
    assert {(room, act) for room, acts in tables.items() for act in acts} <= named
    # Those on stops are sent in tests/web/test_oee.py, those of parcels and recordings in
    # tests/tools/doctor/test_parcel.py and tests/web/test_stop_recordings.py, as this cell has no stop.
    assert ([*SHIFT_ACTS], ("alarms", "report") in named) == (
        ["message", "reason", "parcel", "foxglove", "later"],
        True,
    )


def test_every_act_is_the_same_by_json_and_by_form(
    browsers: Browsers, cells: tuple[Server, Server]
) -> None:
    by_json, by_form = (browsers.signed_in(server.url, "Sato", pin=PIN) for server in cells)
    programs, logged = sent_by(by_json, by_json, "sato", as_form=False)
    pages, logged_of_forms = sent_by(by_form, by_form, "sato", as_form=True)
    assert logged == logged_of_forms
    for row, program, page, entry in zip(ROWS, programs, pages, logged, strict=True):
        if row.path == "/diagnostics/bundle":
            assert {s.answer.headers["content-type"] for s in (program, page)} == {"application/zip"}
            continue
        receipt, is_token = receipt_of(program.answer), row.path == "/users/token"
        assert (receipt["code"], receipt["done"]) == (row.code, not row.code), (row, receipt)
        assert (program.answer.status_code == 200) is receipt["done"], row
        assert (entry["outcome"] == "refused") is not receipt["done"], row
        assert page.answer.status_code == (200 if is_token else 303), (row, page.answer.text)
        assert _timeless(receipt["reason"]) in _timeless(page.page), row
        assert bool(receipt.get("token")) is is_token, row


def test_every_act_is_refused_alike_by_json_and_by_form(
    browsers: Browsers, cells: tuple[Server, Server]
) -> None:
    logs = [browsers.signed_in(server.url, "Sato", pin=PIN) for server in cells]
    by_json, by_form = (browsers.signed_in(server.url, "Mori", pin=PIN) for server in cells)
    programs, logged = sent_by(by_json, logs[0], "mori", as_form=False)
    pages, logged_of_forms = sent_by(by_form, logs[1], "mori", as_form=True)
    assert logged == logged_of_forms
    judged = 0
    for row, program, page in zip(ROWS, programs, pages, strict=True):
        receipt, statuses = receipt_of(program.answer), (program.answer, page.answer)
        if "error" in receipt:  # who may not see the page sends nothing that is judged
            assert [answer.status_code for answer in statuses] == [403, 403], row
            assert receipt["error"] in page.page, row
            continue
        judged += 1
        may_always = row.path == "/control/release"
        refusal = ("control_changed", 409) if may_always else ("role_needed", 403)
        assert (receipt["code"], program.answer.status_code) == refusal, (row, receipt)
        assert page.answer.status_code == 303, row
    assert len(logged) == judged


def sent_at_once(client: httpx.Client, form: TypedForm, act_id: str) -> str:
    """The page after a form that was sent as soon as its page was there."""
    headers = {"accept": "text/html"}
    page = client.get(form.page, headers=headers).text
    (since, *_) = re.findall(r'name="_since" value="([0-9.]+)"', page)
    own = "-id" if form.action.startswith("/recipes") else "id"
    fields = {"_since": since, **({} if form.action.startswith("/widgets") else {own: act_id})}
    fields |= {name: str(text) for name, text in form.typed.items()}
    answer = client.post(form.action, data=fields, headers=headers)
    if seen := re.search(r'name="-seen" value="([^"]+)"', answer.text):  # the comparison before
        answer = client.post(form.action, data={**fields, "-seen": seen[1]}, headers=headers)
    assert answer.status_code == 303, (form, answer.text)
    assert SECRET not in answer.headers["location"]
    shown = client.get(answer.headers["location"], headers=headers, follow_redirects=True)
    assert shown.status_code == 200
    return html.unescape(shown.text)


def test_a_form_that_is_refused_has_again_what_was_typed(
    browsers: Browsers, cells: tuple[Server, Server]
) -> None:
    server = cells[1]
    client = browsers.signed_in(server.url, "Sato", pin=PIN)
    client.post("/control/take", json={}).raise_for_status()
    client.post("/recipes/boxes/create", json={"name": "Kept", "values": RECIPE}).raise_for_status()
    for place, form in enumerate((*TYPED, NOT_READ)):
        shown = sent_at_once(client, form, f"typed-{place}")
        assert all(text in shown for text in form.again), (form, shown)
        assert SECRET not in shown
        fresh = client.get(form.page, headers={"accept": "text/html"}).text
        assert not any(text in html.unescape(fresh) for text in form.again[:1]), form
    last = client.get("/places/goal?mode=save&act=press_too_soon").text
    assert "Gate" not in last  # a later form took its place


def test_the_message_that_was_typed_is_shown_to_its_browser_only(
    browsers: Browsers, cells: tuple[Server, Server]
) -> None:
    (message,) = (form for form in TYPED if form.action == "/alarms/report")
    client, other = (browsers.signed_in(cells[1].url, "Sato", pin=PIN) for _ in range(2))
    assert "Oil is low." in sent_at_once(client, message, "own")
    address = "/alarms/report?act=press_too_soon"
    assert "Oil is low." in client.get(address).text
    assert "Oil is low." not in other.get(address).text

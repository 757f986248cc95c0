"""What docs/ shows can be used as it stands there."""

import json
import re
import shlex
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest

from app.panel import load_panel
from app.system.settings import PREFIX, VARIABLES
from app.web.routes.holds import END_REASONS, Beat, Begin, End, HoldMessage
from app.web.server import OPTIONS
from bench.report.tables import BEGIN, END
from tests.support.beside_panel import put_named_files
from tests.support.parts import ROOT, Server, as_response, until
from tests.support.processes import command
from tests.support.servers import ready
from tests.test_imports import ROOMS

pytestmark = pytest.mark.promise("documents")

DOCS: Final = ROOT / "docs"
PAGES: Final = {
    path.relative_to(DOCS).as_posix(): path.read_text(encoding="utf-8")
    for path in sorted(DOCS.rglob("*.md"))
}
# Of the shipped panels: test_palletizing.py compares them.
QUOTES: Final = {("palletizing.md", "toml"), ("how-to/mobile-robot.md", "toml")}
JOG: Final = "float64 speed\nuint32 valid_ms\nuint16 number\n"
# What an example that is a part of a panel may name and not have itself.
PAGE: Final = '[[page]]\nid = "example"\ntitle = "Example"\n'
INTERLOCKS: Final = {
    "operation": '[[interlock]]\nid = "operation"\ntopic = "/operation_enabled"\n',
}
SOURCES: Final = {
    "air": '[[source]]\nid = "air"\ntopic = "/air"\ntype = "std_msgs/msg/Float64"\nfield = "data"\n',
}
START: Final = """[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/start"
type = "std_msgs/msg/Bool"
message = { data = true }
"""
BATTERY: Final = """[[page.widget]]
id = "battery"
kind = "readout"
label = "Battery"
topic = "/battery"
type = "sensor_msgs/msg/BatteryState"
field = "percentage"
"""
DEMO: Final = {
    "/operation_enabled": '[[interlock]]\nid = "operation"\ntopic = "/operation_enabled"\n',
    "/add_two_ints": '[[page.widget]]\nid = "add"\nkind = "call"\nlabel = "Add"\n'
    'service = "/add_two_ints"\ntype = "example_interfaces/srv/AddTwoInts"\n',
    "/count": '[[page.widget]]\nid = "count"\nkind = "action"\nlabel = "Count"\n'
    'action = "/count"\ntype = "example_interfaces/action/Fibonacci"\n',
    "/cyclone_robot": '[[page.widget]]\nid = "speed"\nkind = "parameter"\nlabel = "Speed"\n'
    'node = "/cyclone_robot"\nparameter = "speed"\ntype = "double"\n',
}
INPUTS: Final = {
    "message": '[[page.widget]]\nid = "message"\nkind = "text"\nlabel = "Message"\n',
    "speed": '[[page.widget]]\nid = "speed"\nkind = "slider"\nlabel = "Speed"\nmin = 0.0\nmax = 1.0\n',
}


def blocks(language: str) -> list[Any]:
    """The code of a language in all pages, as parameters that are named by page and number."""
    return [
        pytest.param(block, id=f"{page}-{number}")
        for page in PAGES
        if (page, language) not in QUOTES
        for number, block in enumerate(shown(page, language), 1)
    ]


def shown(page: str, language: str) -> list[str]:
    """The code of a language in one page."""
    return re.findall(rf"^```{language}\n(.*?)^```", PAGES[page], re.DOTALL | re.MULTILINE)


def completed(example: str) -> str:
    """An example of a panel file with what it leaves to the rest of the file."""
    text = example
    page, widget = text.find("[[page]]"), text.find("[[page.widget]]")
    if page < 0 and widget >= 0:
        text = text[:widget] + PAGE + text[widget:]
    elif page < 0:
        text += PAGE
    tables = tomllib.loads(text)
    if "title" not in tables:
        text = f'title = "Example"\n{text}'
    if "cell_msgs/" in text and "interfaces" not in tables:
        text = f'interfaces = ["cell_msgs"]\n{text}'
    if "/battery" in tables.get("record", {}).get("topics", ()):
        text += BATTERY
    named_in_demo = {"/battery": BATTERY, **DEMO}
    text += "".join(named_in_demo[name] for name in tables.get("demo", {}))
    widgets = {widget.get("id") for each in tables["page"] for widget in each.get("widget", [])}
    named = set(re.findall(r'"\{(\w+)\}"', text)) - widgets
    text += "".join(INPUTS[name] for name in sorted(named & set(INPUTS)))
    if "start" in _inhibited(tables) - widgets:
        text += START
    sources = set(re.findall(r'^source = "(\w+)"', text, re.MULTILINE))
    own = {source["id"] for source in tables.get("source", [])}
    text += "".join(SOURCES[name] for name in sorted(sources - own))
    locks = set(re.findall(r'^interlock = "(\w+)"', text, re.MULTILINE))
    there = {interlock["id"] for interlock in tables.get("interlock", [])}
    return text + "".join(INTERLOCKS[name] for name in sorted(locks - there))


def _inhibited(tables: dict[str, Any]) -> set[str]:
    return {name for alarm in tables.get("alarm", ()) for name in alarm.get("inhibits", ())}


@pytest.mark.parametrize("example", blocks("toml"))
def test_each_example_of_a_panel_is_good(example: str, tmp_path: Path) -> None:
    messages = tmp_path / "cell_msgs/msg"
    messages.mkdir(parents=True)
    (messages / "Jog.msg").write_text(JOG)
    put_named_files(tmp_path, example)
    panel = tmp_path / "cell1.toml"
    panel.write_text(completed(example))
    assert load_panel(panel).pages


@pytest.mark.parametrize("example", blocks("json"))
def test_each_example_of_json_is_json(example: str) -> None:
    assert isinstance(json.loads(example), dict)


@pytest.fixture(scope="module")
def kiosk() -> Iterator[Server]:
    """The shipped panel's, where the example of a press can be made."""
    with ready(Server(ROOT, KIOSK_MODE="demo")) as mine:
        until(lambda: mine.widget("operation")["enabled"], "the button is open")
        yield mine


def test_a_press_is_answered_as_its_example_shows(kiosk: Server) -> None:
    command = shlex.split(shown("reference/http.md", "sh")[0])
    url, body = command[2], command[-1]
    assert command[:2] == ["curl", "-s"]
    answer = kiosk.http.post(url.partition(":8000")[2], json=json.loads(body))
    assert answer.status_code == 200
    example = json.loads(shown("reference/http.md", "json")[0])
    assert set(answer.json()) == set(example)
    assert answer.json()["outcome"] in ("published", "unknown")  # no one may listen in the demo
    assert example["widget"] == answer.json()["widget"]


def test_a_press_by_websocket_is_answered_as_its_example_shows(kiosk: Server) -> None:
    request, expected = shown("reference/http.md", "json")[1:3]
    with kiosk.socket() as socket:
        socket.say(request)
        said = socket.hear()
    assert set(said) == set(json.loads(expected))
    assert as_response(said).status_code == 200


def test_the_example_of_a_snapshot_can_be_asked_for(kiosk: Server) -> None:
    *_, url = shlex.split(shown("reference/http.md", "sh")[1])
    assert kiosk.http.get(url.partition(":8000")[2]).text.count("event: snapshot") == 1


def test_the_log_is_verified_as_its_page_shows(kiosk: Server) -> None:
    verify = next(text for text in shown("operators-log.md", "sh") if "app.log verify" in text)
    words = shlex.split(verify)
    run = command.run(*words[2:], "--data", str(kiosk.data))
    assert (run.returncode, run.stdout[:4]) == (0, "ok, "), run.stderr


def test_the_events_have_the_names_that_the_reference_has(kiosk: Server) -> None:
    rows = re.findall(r"^\| `([a-z<>-]+)` \|", PAGES["reference/http.md"].split("## Events")[1], re.M)
    text = kiosk.http.get("/events?once=1").text
    names = set(re.findall(r"^event: (.+)$", text, re.M))
    assert {"snapshot", "beat"} <= names
    assert names <= {name.replace("<interlock>", "operation") for name in rows}
    snapshot = kiosk.snapshot()
    assert set(snapshot["link"]) == {"server", "bridge", "node"}
    table = PAGES["reference/http.md"].split("### Links")[1].split("### Control")[0]
    keys = set(re.findall(r"`(\w+)`", "".join(re.findall(r"^\| (.+?) \|", table, re.M))))
    assert set(snapshot["link"]["bridge"]) == keys
    assert set(snapshot["control"]) <= set(re.findall(r"`(\w+)`", PAGES["reference/http.md"]))


def test_the_messages_of_a_hold_are_json() -> None:
    said = re.findall(r"^\| (?:server|client) \| `(.+)` \|$", PAGES["reference/http.md"], re.MULTILINE)
    assert [json.loads(message).get("do") or json.loads(message).get("state") for message in said] == [
        *(None, "begin", "held", "beat", "held", "end", "ended")
    ]


@pytest.mark.parametrize("message", [Begin, Beat, End])
def test_each_key_of_a_holds_messages_is_described(message: type[HoldMessage]) -> None:
    section = PAGES["reference/http.md"].split("## Hold to run: WebSocket")[1].split("\n## ")[0]
    table = section.split("| JSON key of the client's messages |")[1]
    described = "".join(re.findall(r"^\| (`.+?) \|", table, re.MULTILINE))
    assert set(message.model_fields) <= set(re.findall(r"`(\w+)`", described))


def test_each_reason_for_the_end_of_a_hold_is_described() -> None:
    row = re.search(r"^\| `why` \| (.+) \|$", PAGES["reference/http.md"], re.MULTILINE)
    assert row
    assert set(END_REASONS) == set(re.findall(r"`(\w+)`", row[1])) - {"end"}


def test_every_place_in_the_code_is_there() -> None:
    """Paths in backticks that begin with a folder of the project."""
    places = set(
        re.findall(r"`((?:app|bench|deploy|docs|static|templates|tests)/[\w./-]*)`", str(PAGES))
    )
    assert {"app/system/settings.py", "docs/panel.schema.json"} <= places
    assert sorted(path for path in places if not (ROOT / path).exists()) == []


LINK: Final = re.compile(r"\]\((?!https?:|mailto:)([^)#\s]*)(?:#([^)\s]+))?\)")


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as the site and repositories make them."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    titles = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", [*PAGES, "../README.md", "../CONTRIBUTING.md", "../bench/README.md"])
def test_every_link_leads_somewhere(page: str) -> None:
    here = DOCS / page
    for name, anchor in LINK.findall(here.read_text(encoding="utf-8")):
        there = here.parent / name if name else here
        assert there.exists(), name
        assert not anchor or anchor in anchors(there), f"{name}#{anchor}"


@pytest.mark.parametrize("page", ["docs/architecture.md", "CONTRIBUTING.md"])
def test_the_table_of_rooms_has_every_room_in_order(page: str) -> None:
    table = (ROOT / page).read_text(encoding="utf-8").split("| room |")[1].split("\n\n")[0]
    assert re.findall(r"^\| `(\w+)/` \|", table, re.MULTILINE) == list(ROOMS)


def test_the_drawing_of_the_rooms_has_every_room() -> None:
    drawn = (DOCS / "rooms.svg").read_text()
    assert [room for room in ROOMS if f">{room}<" not in drawn] == []


def test_the_settings_page_starts_the_server_with_its_limits() -> None:
    flags = f"--ws-max-size {OPTIONS['ws_max_size']} --ws-max-queue {OPTIONS['ws_max_queue']}"
    flags += " --ws-per-message-deflate false --no-proxy-headers"
    assert flags in PAGES["reference/settings.md"]


def test_every_variable_is_a_setting() -> None:
    named = set(re.findall(rf"\b{PREFIX}([A-Z_]*[A-Z])\b", str(PAGES)))
    assert named <= set(VARIABLES)


def test_every_make_target_in_docs_exists() -> None:
    makefile = (ROOT / "Makefile").read_text()
    named = set(re.findall(r"\bmake ([a-z][a-z-]*)", "\n".join(blocks_of_sh())))
    assert "bench" in named
    assert [
        target for target in sorted(named) if not re.search(rf"^{target}:", makefile, re.MULTILINE)
    ] == []


def blocks_of_sh() -> Iterator[str]:
    for page in PAGES:
        yield from shown(page, "sh")


def test_the_benchmark_has_its_section() -> None:
    assert f"\n{BEGIN}\n" in PAGES["benchmark.md"]
    assert f"\n{END}\n" in PAGES["benchmark.md"]

"""What may be in a support bundle: only what is marked as public, and of findings known forms."""

import importlib
import json
import pkgutil
import shutil
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final, Literal, NamedTuple, get_origin

import pytest
from pydantic import BaseModel, Field

import app.panel
from app.panel import Panel, load_panel
from app.panel.base import Description
from app.records import Origin, new_entry
from app.records.entry import Entry
from app.records.store import Store
from app.ros.graph.model import (
    Bridge,
    BridgeRoute,
    EndpointQos,
    GraphSnapshot,
    Node,
    PeerEndpoint,
    RobotGraph,
    Server,
    SurveyedTopic,
    TopicEndpoint,
)
from app.ros.zenoh.config import ConfigSummary
from app.system.public import LEFT_OUT, PUBLIC, Public, hints_of, leaves, public_part
from app.system.settings import Settings
from app.system.texts import Text, say
from app.tools.doctor.bundle import Sources, parts
from app.tools.doctor.doctor import Diagnosis, Options
from app.tools.doctor.findings import Report
from app.tools.doctor.journal import journal_counts
from app.tools.doctor.redaction import public_report
from tests.support.beside_panel import put_beside
from tests.support.parts import TESTS
from tests.support.users import add_user, token_of
from tests.tools.doctor.secrets import NUMBER, SECRET, secrets_in

# All marked fields, by their names. A new one is public only if it is added here, too.
OF_PANEL_FILES: Final = """
    ack_command ack_input action active alarms by code condition conditions confirm_s connect
    demo_heals_s depth domain duration_s effects every_s fault field fields figures groups id
    ideal_cycle_s info interlocks key language languages level map max_age_s message namespace needs
    node page parameter_types parameters period_s places progress reason_after_s robot rows same
    screens service span stale_s success takeover_after_s text timeout_s topic topics type within_s
"""
OF_OTHERS: Final[dict[type, str]] = {
    Settings: "hosts proxies log_level without take_panel",
    ConfigSummary: "mode connect listen",
    Entry: "seq at boot monotonic of robot press widget action seen verdict board outcome prev hash",
    Bridge: "zid version",
    BridgeRoute: "bridge name key type local_nodes endpoint",
    EndpointQos: "depth",
    Node: "name bridge dds publishers subscribers services clients actions action_clients",
    PeerEndpoint: "zid key type",
    RobotGraph: "namespace",
    Server: "name key type bridge nodes dds",
    SurveyedTopic: "name key",
    TopicEndpoint: "type bridge nodes dds type_hash",
}


class Inner(BaseModel):
    name: Annotated[str, PUBLIC] = ""
    pin: str = ""


class Pair(NamedTuple):
    code: Annotated[str, Public("[a-z]+")]
    secret: int


class Sample(BaseModel):
    id: Annotated[str, PUBLIC] = "a"
    word: Literal["on", 2] | None = None
    flag: bool = False
    count: Annotated[int, Field(ge=0), PUBLIC] = 0
    plain: str | int | float = 0
    either: Annotated[str, PUBLIC] | int = 0
    listed: tuple[Annotated[str, Public("/[a-z]+")], ...] = ()
    all_listed: Annotated[tuple[str, ...], PUBLIC] = ()
    table: dict[str, Inner] = {}
    anything: Any = None
    inner: Inner = Inner()
    pair: Pair = Pair("", 0)


@pytest.mark.parametrize(
    ("field", "value", "shown"),
    [
        ("id", "b", "b"),
        ("id", "x" * 301, LEFT_OUT),
        ("word", "on", "on"),
        ("word", 2, 2),
        ("word", None, None),
        ("flag", True, True),
        ("count", 3, 3),
        ("plain", "b", LEFT_OUT),
        ("plain", 3, LEFT_OUT),
        ("either", "b", "b"),
        ("either", 3, LEFT_OUT),
        ("listed", ("/a", "a", "/b c"), ["/a", LEFT_OUT, LEFT_OUT]),
        ("all_listed", ("a", "b"), ["a", "b"]),
        ("table", {"a": Inner(name="b")}, LEFT_OUT),
        ("anything", "b", LEFT_OUT),
        ("anything", Path("b"), LEFT_OUT),
        ("inner", Inner(name="b", pin="c"), {"name": "b", "pin": LEFT_OUT}),
        ("inner", Inner(name="b"), {"name": "b"}),
        ("pair", Pair("ab", 1), {"code": "ab", "secret": LEFT_OUT}),
        ("pair", Pair("a1", 1), {"code": LEFT_OUT, "secret": LEFT_OUT}),
    ],
)
def test_only_marked_values_are_public(field: str, value: Any, shown: Any) -> None:
    assert public_part(Sample.model_construct({field}, **{field: value})) == {field: shown}


def public_fields(owner: type) -> list[str]:
    return [
        name
        for name, hint in hints_of(owner)
        if any(mark is not None and get_origin(leaf) is not Literal for leaf, mark in leaves(hint))
    ]


def models(owner: type[Description] = Description) -> Iterator[type[Description]]:
    for model in owner.__subclasses__():
        if model.__module__.startswith("app."):
            yield from (model, *models(model))


def test_what_may_be_in_a_bundle_does_not_grow_by_accident() -> None:
    for module in pkgutil.walk_packages(app.panel.__path__, "app.panel."):
        importlib.import_module(module.name)
    assert {name for model in models() for name in public_fields(model)} == {*OF_PANEL_FILES.split()}
    assert {owner: " ".join(public_fields(owner)) for owner in OF_OTHERS} == OF_OTHERS


def planted(value: Any, hint: Any = None) -> Any:
    """A value with a secret in each text and number in it that is not public by its type."""
    if isinstance(value, BaseModel):
        hints = dict(hints_of(type(value)))
        every = {name: planted(getattr(value, name), hint) for name, hint in hints.items()}
        return type(value).model_construct({*hints}, **every)
    if is_dataclass(value) and not isinstance(value, type):
        hints = dict(hints_of(type(value)))
        every = {f.name: planted(getattr(value, f.name), hints[f.name]) for f in fields(value)}
        return replace(value, **every)
    if isinstance(value, list | tuple):
        return [planted(inner, hint) for inner in value]
    if isinstance(value, dict):
        return {SECRET: SECRET}
    if value is None or isinstance(value, bool) or any(mark for _, mark in leaves(hint)):
        return value
    if isinstance(value, Text):
        return say("with_file", why=SECRET, file=SECRET)
    return int(NUMBER) if isinstance(value, int | float) else SECRET


@pytest.fixture(scope="module")
def everything(tmp_path_factory: pytest.TempPathFactory) -> Panel:
    folder = tmp_path_factory.mktemp("panel")
    messages = folder / "msgs/cell_msgs/msg"
    messages.mkdir(parents=True)
    (messages / "Jog.msg").write_text("float64 speed\nuint32 valid_ms\nuint16 number\n")
    put_beside(folder)
    return load_panel(Path(shutil.copy(TESTS / "everything.toml", folder)))


def test_a_secret_in_any_field_is_in_no_part(everything: Panel, tmp_path: Path) -> None:
    """Of the panel file, the settings, the users, the operator's log, the journal, the graph."""
    endpoint = TopicEndpoint(type=f"{SECRET} x", qos=EndpointQos(), nodes=(f"{SECRET}!",), dds=SECRET)
    topic = SurveyedTopic(name=f"/a {SECRET}", key=f"a {SECRET}", publishers=(endpoint,))
    bridge = Bridge(zid=SECRET, version=SECRET, config={"namespace": SECRET, "password": SECRET})
    graph = GraphSnapshot(robots=(RobotGraph(bridges=(bridge,), topics=(topic,)),))
    settings = planted(Settings(panel=Path(), zenoh=Path()))
    files = {"panel": tmp_path / f"{SECRET}.toml", "zenoh": tmp_path / f"{SECRET}.json5"}
    settings = replace(settings, data=tmp_path, **files)
    login = f'{{ auth: {{ usrpwd: {{ user: "{SECRET}", password: "{SECRET}" }} }} }}'
    connect = f'{{ endpoints: ["tls/robot:7447#password={SECRET}"] }}'
    settings.zenoh.write_text(f"{{ connect: {connect}, transport: {login}, metadata: {login} }}")
    settings.panel.write_text(f'title = "{SECRET}"\n{SECRET} = 1\n')
    add_user(tmp_path, SECRET, "engineer", pin=NUMBER, password=SECRET, badge=SECRET)
    token_of(tmp_path, SECRET, "engineer")
    store = Store(tmp_path, "b007")
    origin = Origin(address=SECRET, browser=SECRET, who=SECRET, seen=SECRET)
    about = {name: f"{SECRET} {NUMBER}" for name in ("press", "widget", "reason")}
    store.append([new_entry("refused", origin, {SECRET: NUMBER}, **about)])
    store.append(
        [new_entry("refused", origin, widget="say", reason=say("with_file", why=SECRET, file=""))]
    )
    store.close()
    report = Report()
    report.find("panel_fault", f"page[0].{SECRET} (line 3)", detail=SECRET)
    report.find("zenoh_config", str(settings.zenoh), detail=SECRET)
    report.find("data_unwritable", f"/home/{SECRET}", detail=SECRET)
    lines = [{"_SYSTEMD_UNIT": unit, "MESSAGE": SECRET} for unit in (SECRET, "operator-panel.service")]
    sources = Sources(
        environment={"KIOSK_PANEL": SECRET, SECRET: SECRET},
        journal=lambda: "\n".join(map(json.dumps, lines)).encode(),
    )
    diagnosis = Diagnosis(report=report, panel=planted(everything), graphs={"": graph})
    made = parts(settings, Options(port=1), diagnosis, sources)
    assert secrets_in({part.name: part.text for part in made}) == []
    assert {part.name for part in made} >= {"panel.json", "zenoh.json", "graph.json", "settings.json"}
    entries = [json.loads(line) for line in _text(made, "logs/operators-log.jsonl").splitlines()]
    assert [(entry.get("widget"), entry.get("codes")) for entry in entries[-2:]] == [
        (None, []),
        ("say", ["with_file"]),
    ]
    panel = json.loads(_text(made, "panel.json"))
    assert panel["pages"][0]["id"] == everything.pages[0].id
    assert {"robots", "interlocks", "pages", "alarms"} <= set(panel)


def _text(made: list[Any], name: str) -> str:
    (text,) = (part.text for part in made if part.name == name)
    return str(text)


@pytest.mark.parametrize(
    ("message", "kind"),
    [
        ("[INFO] [1.5] [web_ui]: Zenoh link up", "INFO"),
        ("[WARN] [1.5] [web_ui]: swordfish", "WARN"),
        ("2026-01-01T00:00:00.123Z  \x1b[33mWARN\x1b[0m main zenoh: swordfish", "WARN"),
        ("ValueError: swordfish", "ValueError"),
        ("app.system.errors.PanelError: swordfish", "PanelError"),
        ("SwordfishError: x", "other"),
        ("swordfish", "other"),
        ([115, 119], "other"),
    ],
)
def test_lines_of_the_journal_are_counted(message: object, kind: str) -> None:
    line = json.dumps({"_SYSTEMD_UNIT": "operator-panel.service", "MESSAGE": message}).encode()
    text = b"\n".join((line, line, b'{"MESSAGE": "cut', b"[]"))
    counts = journal_counts(text)
    assert counts["operator-panel.service"] == {kind: 2}
    assert secrets_in({"": json.dumps(counts)}) == []


def test_a_finding_is_its_code_and_its_names() -> None:
    report = Report()
    report.find("topic_type", "/speed", found="std_msgs/msg/Bool", wanted="swordfish")
    report.find("panel_fault", "page[0].widget[2].passwrd (line 7)", detail="swordfish")
    report.find("no_router", "tls/robot:7447#password=swordfish")
    report.find("topic_qos", "/a, /b and 7 more", detail="swordfish")
    shown = public_report(Diagnosis(report=report), "1.0")["findings"]
    assert [finding["about"] for finding in shown] == [
        "/speed",
        f"page[0].widget[2].{LEFT_OUT} (line 7)",
        "tls/robot:7447",
        "/a, /b and 7 more",
    ]
    assert (
        shown[0]["what"]
        == f"/speed is std_msgs/msg/Bool on the robot and {LEFT_OUT} in the panel file."
    )
    assert secrets_in({"doctor.json": str(shown)}) == []

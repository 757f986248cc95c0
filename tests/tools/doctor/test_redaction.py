"""What is known to be harmless, of configuration files and of logs; and that it takes no time."""

import time

import pytest

from app.tools.doctor.doctor import Diagnosis
from app.tools.doctor.findings import Report
from app.tools.doctor.journal import LEAST_LETTERS, redact_line, sentences
from app.tools.doctor.redaction import (
    GRAPH,
    LEFT_OUT,
    MOST_CHARS,
    PANEL,
    ZENOH,
    redact,
    redact_report,
    redact_text,
    redact_value,
)
from tests.support.parts import ROOT
from tests.tools.doctor.secrets import FORMS, secrets_in

OUT = f'"{LEFT_OUT}"'


def test_harmless_panel_file_keeps_its_lines_keys_and_names() -> None:
    text = (
        "# PIN 1234\n"
        'title = "Cell of Mr. Smith"\n'
        'mode = "live" # secret\n'
        "[[interlock]]\n"
        'id = "operation"\ntopic = "/enabled"\nequals = "AUTO 1234"\nmax_age_s = 2.0\n'
        '[demo."/speed"]\nvalues = [1, 2]\nhz = 3\n'
        '[[page.widget]]\nkind = "publish"\nmessage = { data = "1234", id = "a" }\n'
        'label = """\nmany\nlines"""\nspan = 3\ninterlock = ["operation", "it\'s me"]\n'
        "qos = { depth = 1, by = 'x', reliability = \"reliable\" }\n"
    )
    assert redact_text(text, PANEL, is_toml=True) == (
        "\n"
        f"title = {OUT}\n"
        'mode = "live" \n'
        "[[interlock]]\n"
        f'id = "operation"\ntopic = "/enabled"\nequals = {OUT}\nmax_age_s = 2.0\n'
        f'["{LEFT_OUT}"]\nvalues = {OUT}\nhz = {OUT}\n'
        f'[[page.widget]]\nkind = "publish"\nmessage = {OUT}\n'
        f'label = {OUT}\n\n\nspan = 3\ninterlock = ["operation", {OUT}]\n'
        f'qos = {{ depth = 1, by = {OUT}, reliability = "reliable" }}\n'
    )


def test_harmless_zenoh_file_keeps_addresses_without_their_parameters() -> None:
    text = (
        "{ /* who: me */ mode: 'peer',"
        " connect: { endpoints: ['tls/[::1]:7447#password=x', 'x', ['y']] },\n"
        "  'transport': { auth: { mode: 'peer' }, link: { tx: { lease: 2000 },"
        " unknown: { mode: 'peer' } } },\n"
        '  plugins: { ros2dds: { namespace: "/robot1", allow: { publishers: ["/a|/b/.*"] } } } }'
    )
    assert redact_text(text, ZENOH, is_toml=False) == (
        f'{{  mode: "peer", connect: {{ endpoints: ["tls/[::1]:7447", {OUT}, [{OUT}]] }},\n'
        f"  transport: {{ auth: {OUT}, link: {{ tx: {{ lease: 2000 }}, {OUT}: {OUT} }} }},\n"
        '  plugins: { ros2dds: { namespace: "/robot1", allow: { publishers: ["/a|/b/.*"] } } } }'
    )


def test_the_shipped_files_are_kept_but_for_their_comments() -> None:
    for name in ("zenoh.json5", "deploy/bridge.json5"):
        assert LEFT_OUT not in redact_text((ROOT / name).read_text(), ZENOH, is_toml=False)


UNITS = [
    "a: [",
    "a: {",
    "a=b ",
    '"""\\',
    '"\\',
    "'''",
    "/*",
    "/",
    "a.",
    "[[",
    "[a",
    "]",
    "=",
    "\\",
    "#",
    " ",
]


@pytest.mark.long("table")
@pytest.mark.parametrize("unit", [*UNITS, "/* ", "[ \t", "''' \"\"\" ", "x" * 80 + "=", "a = '", "\n["])
@pytest.mark.parametrize("is_toml", [False, True])
def test_a_megabyte_of_anything_takes_no_time(unit: str, is_toml: bool) -> None:
    """Of the processor, at twice the length at most thrice the time."""

    def cost(length: int) -> float:
        text, began = unit * (length // len(unit)), time.process_time()
        redact_text(text, PANEL if is_toml else ZENOH, is_toml)
        return time.process_time() - began

    assert cost(MOST_CHARS) < 3 * cost(MOST_CHARS // 2) + 0.2
    assert len(redact_text(unit * 1_000_000, PANEL, is_toml)) < 10 * MOST_CHARS


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    "before", ["", "{ ", '"', "'", "x = [", "endpoints: [", 'mode: "', '"""', "topic = ", "\\"]
)
def test_no_form_of_a_secret_is_kept_in_any_place(form: str, before: str) -> None:
    for text in (
        f"{before}{form}",
        f"a = 1\n{before}{form}\nb = 2",
        f"{{ mode: 'peer', {before}{form} }}",
    ):
        kept = {f"{toml}": redact_text(text, PANEL if toml else ZENOH, toml) for toml in (True, False)}
        assert secrets_in(kept) == []


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        ("[INFO] [1.5] [web_ui]: Zenoh link up", "INFO Zenoh link up"),
        ("[INFO] [1.5] [web_ui]: Robot 1: Zenoh link up", "INFO …: Zenoh link up"),
        (
            "[WARN] [1.5] [web_ui]: the event loop stalled for 2.3 s",
            "WARN the event loop stalled for 2.3 s",
        ),
        (
            "[INFO] [1.5] [web_ui]: press 3997b31354eaba96 of say by me with {'a': 'x'}: published: y",
            "INFO press 3997b31354eaba96 of say by … with …: …: …",
        ),
        ("[ERROR] [1.5] [web_ui]: /speed: too short (3 so far)", "ERROR /speed: … (… so far)"),
        ("[ERROR] [1.5] [web_ui]: anything", f"ERROR {LEFT_OUT}"),
        ("Started operator-panel.service - Operator panel.", "Started operator-panel.service - …"),
        (
            "operator-panel.service: Main process exited, code=killed, status=9/KILL",
            "operator-panel.service: Main process exited, code=killed, status=9/KILL",
        ),
        ("Traceback (most recent call last):", "Traceback (most recent call last):"),
        ('  File "/opt/x/app/main.py", line 12, in create_app', "  app/main.py, line 12"),
        ("ValueError: 1234", "ValueError: …"),
        ("app.system.errors.PanelError: 1234", "PanelError: …"),
        ("HunterError: 1234", LEFT_OUT),
    ],
)
def test_a_line_is_shown_by_its_sentence(line: str, shown: str) -> None:
    assert redact_line(line) == shown


def test_a_bridges_line_is_shown_by_its_module() -> None:
    line = "2026-01-01T00:00:00.123Z  \x1b[33mWARN\x1b[0m main zenoh_plugin_ros2dds::x: secret"
    assert redact_line(line, "zenoh-bridge-ros2dds.service") == "WARN zenoh_plugin_ros2dds::x: …"
    assert redact_line(line, "operator-panel.service") == LEFT_OUT


def test_every_sentence_of_the_program_is_known() -> None:
    told = {sentence.fixed for sentence in sentences()}
    assert ("Zenoh link up",) in told
    assert ("press ", " of ", " by ", " with ", ": ", ": ", "") in told
    assert all(sum(map(str.isalpha, "".join(fixed))) >= LEAST_LETTERS for fixed in told)


@pytest.mark.parametrize("text", ["press " + " of " * 9000, ": " * 9000, "x" * 900_000, "\n" * 9000])
def test_a_long_line_takes_no_time(text: str) -> None:
    began = time.process_time()
    redact_line(f"[INFO] [1.5] [web_ui]: {text}")
    assert time.process_time() - began < 0.5


def test_of_json_only_known_keys_are_kept() -> None:
    graph = {
        "robots": [{"namespace": "/r", "secret": 1, "bridges": [{"config": {"domain": 3, "pin": 4}}]}],
        "topics": [{"name": "a b", "type": "std_msgs/msg/Bool"}],
    }
    assert redact_value(graph, GRAPH) == {
        "robots": [{"namespace": "/r", "bridges": [{"config": {"domain": 3}}]}],
        "topics": [{"name": LEFT_OUT, "type": "std_msgs/msg/Bool"}],
    }
    deep: list[object] = []
    for _ in range(5000):
        deep = [deep]
    assert LEFT_OUT in str(redact_value({"topics": deep}, GRAPH))
    assert redact("true", GRAPH["reliable"]) == "true"


def test_a_finding_is_its_code_and_its_names() -> None:
    report = Report()
    report.find("topic_type", "/speed", found="std_msgs/msg/Bool", wanted="swordfish")
    report.find("panel_fault", "page[0].widget[2].passwrd (line 7)", detail="swordfish")
    report.find("no_router", "tls/robot:7447#password=swordfish")
    report.find("topic_qos", "/a, /b and 7 more", detail="swordfish")
    shown = redact_report(Diagnosis(report=report), "1.0")["findings"]
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

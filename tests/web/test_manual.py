"""`operator-panel manual`: every control, interlock, condition and alarm of a panel is in it."""

import hashlib
import re
import shutil
from pathlib import Path

import pytest

from app.panel import load_panel
from app.panel.model import Panel
from app.system.texts import render
from app.tools.cli.command import main
from tests.panel.test_shared_keys import put_interfaces
from tests.support.parts import ROOT

SHIPPED = ROOT / "app/panel.toml"
EVERYTHING = ROOT / "tests/everything.toml"


def written(panel: Path, folder: Path, language: str) -> str:
    file = folder / "manual.html"
    words = ["manual", str(panel), "--language", language, "-o", str(file)]
    assert main(words) == 0
    assert main(words) == 1  # it is there
    return file.read_text(encoding="utf-8")


def escaped(text: str) -> str:
    for sign, name in (("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ('"', "&#34;"), ("'", "&#39;")):
        text = text.replace(sign, name)
    return text


def of_kind(html: str, kind: str) -> list[str]:
    return re.findall(rf'data-{kind}="([^"]+)"', html)


@pytest.mark.parametrize(
    ("file", "language"), [(EVERYTHING, "en"), (SHIPPED, "en"), (SHIPPED, "ja"), (SHIPPED, "de")]
)
def test_everything_of_a_panel_is_in_its_manual(file: Path, language: str, tmp_path: Path) -> None:
    if file == EVERYTHING:
        put_interfaces(tmp_path)
        file = Path(shutil.copy(file, tmp_path / "cell.toml"))
    panel, html = load_panel(file), written(file, tmp_path, language)
    assert sorted(of_kind(html, "control")) == sorted({each.id for each in panel.commands})
    assert of_kind(html, "interlock") == [each.id for each in panel.interlocks]
    assert of_kind(html, "condition") == [each.id for each in panel.own_conditions]
    assert of_kind(html, "alarm") == [each.id for each in panel.alarms]
    assert hashlib.sha256(file.read_bytes()).hexdigest() in html
    for text in texts(panel, language):
        assert escaped(text) in html, text
    assert set(re.findall(r'href="#([^"]+)"', html)) <= set(re.findall(r' id="([^"]+)"', html))
    assert not re.search(r'(src|href)="(?!#|data:image/)', html)  # it needs no server
    assert "<script" not in html


def texts(panel: Panel, language: str) -> list[str]:
    shown = [
        *(each.label for each in panel.commands),
        *(each.locked for each in panel.interlocks if each.locked),
        *(
            text
            for each in panel.alarms
            for text in (each.cause, each.consequence, each.action)
            if text
        ),
        *(state.text for state in (panel.state.states if panel.state else ())),
    ]
    steps = [render(each.advice, language).splitlines() for each in panel.interlocks]
    return [*(render(text, language) for text in shown), *(line for lines in steps for line in lines)]


PANEL = """
title = "<b>Cell</b>"
mode = "demo"

[control]
required = true

[[interlock]]
id = "door"
label = "Door <1>"
topic = "/door"
locked = "The door & the gate are open"
help = { text = "Close <it>.\\nReset." }

[[alarm]]
id = "hot"
text = "Hot <i>"
topic = "/temperature"
type = "std_msgs/msg/Float64"
high = 80
unit = "°C"
inhibits = ["go"]
action = "Wait"

[[page]]
id = "main"
title = "Main"

[[page.widget]]
id = "go"
kind = "publish"
label = "Go <script>"
topic = "/go"
type = "std_msgs/msg/String"
message = { data = "<x>" }
interlock = "door"
needs = "maintenance"
confirm_press = true
consequence = "It moves"
"""


def test_a_control_has_what_locks_it_and_texts_are_escaped(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(PANEL)
    html = written(tmp_path / "cell.toml", tmp_path, "en")
    plain = re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", html)).replace(" .", ".")
    for text in (
        "Go &lt;script&gt; The panel asks before it sends. It moves Only for: maintenance",
        "A message to /go",
        "std_msgs/msg/String {&#34;data&#34;: &#34;&lt;x&gt;&#34;}",
        "Permitted while Door &lt;1&gt;",
        "Locked by the alarm Hot &lt;i&gt;",
        "While it locks The door &amp; the gate are open",
        "Close &lt;it&gt;. Reset.",
        "above 80 °C",
        "One browser at a time is in control",
    ):
        assert text.casefold() in plain.casefold(), (text, plain[-3000:])


def test_a_language_that_the_panel_does_not_have_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "manual.html"
    assert main(["manual", str(SHIPPED), "--language", "fr", "-o", str(file)]) == 2
    assert 'is not in the language "fr"' in capsys.readouterr().err
    assert not file.exists()

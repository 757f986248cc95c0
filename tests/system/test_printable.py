"""Text that hides or moves what stands around it is shown by its escapes, wherever it comes from."""

import csv
import io
import json
import re
import unicodedata
from collections.abc import Callable
from pathlib import Path
from urllib.parse import quote

import pytest

from app.ros.messages import plain_text
from app.system.errors import InputError
from app.system.printable import one_line, printable, readable, without_terminal_codes
from app.system.texts import say
from tests.support.builders import INTERFACES
from tests.support.parts import ROOT, Server, until

HIDDEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")
KEY_VALUE = "diagnostic_msgs/msg/KeyValue"
RED = "\x1b[31mhot\x1b[0m"
BAD = "in \u202everted\u202c \x1b[31mred\u2028\u2066line\x85"
ESCAPED = "in \\u202everted\\u202c \\u001b[31mred\\u2028\\u2066line\\u0085"
SHOWN = "in \\u202everted\\u202c red\\u2028\\u2066line\\u0085"


@pytest.mark.parametrize(
    "text",
    [
        "",
        "plain",
        "two\nlines\tand a tab",
        "日本語",
        "🤖\u200d🔧",
        "مرحبا",
        "soft\u00adhyphen",
        "a\\u202eb",
    ],
)
def test_harmless_text_stays_unchanged(text: str) -> None:
    assert printable(text) == text


def test_every_control_character_and_mark_of_direction_becomes_its_escape() -> None:
    marks = {"ALM", "BN", "LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI"}
    characters = [
        char
        for char in map(chr, range(0x10000))
        if unicodedata.category(char) in ("Cc", "Cs", "Zl", "Zp")
        or (unicodedata.bidirectional(char) in marks - {"BN"})
        or char in "\u061c\u200e\u200f"
    ]
    shown = {char: printable(char) for char in characters if char not in "\n\t"}
    assert shown == {char: f"\\u{ord(char):04x}" for char in shown}
    assert len(shown) > 2048 + 65


def test_in_json_an_escape_says_the_same() -> None:
    text = json.dumps({"text": BAD + "\x7f"}, ensure_ascii=False)
    assert json.loads(printable(text)) == {"text": BAD + "\x7f"}


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\x1b[31mred\x1b[0m", "red"),
        ("\x1b[1;38;5;196mbold\x1b[m \x1b(B", "bold "),
        ("\x9b32mgreen", "green"),
        ("\x1b]8;;http://robot\x07link\x1b]8;;\x1b\\", "link"),
        ("cut off \x1b[3", "cut off "),
        ("\x1b]0;no end, so all is shown", "\\u001b]0;no end, so all is shown"),
        ("a bell\x07 and \x1bc", "a bell\\u0007 and \\u001bc"),
        ("[31m is text", "[31m is text"),
    ],
)
def test_codes_of_terminals_are_no_text(text: str, shown: str) -> None:
    assert readable(text) == shown


def test_values_in_a_value_have_no_codes_of_terminals() -> None:
    status = INTERFACES.decode_whole(
        KEY_VALUE, INTERFACES.encode(KEY_VALUE, {"key": RED, "value": RED})
    )
    assert plain_text(status, 100, without_terminal_codes) == "{'key': 'hot', 'value': 'hot'}"
    assert plain_text(RED, 100, without_terminal_codes) == "hot"


def test_within_a_line_there_is_no_line_break_and_no_more_than_a_limit() -> None:
    assert one_line("a\nb\tc\u202e \x1b[31mred") == "a\\u000ab\\u0009c\\u202e red"
    assert one_line("x" * 10, most=4) == "xxxx…"


def test_sentences_and_errors_are_printable() -> None:
    assert str(say("input_not_an_option", label="Speed", options="1, 2", given=BAD)).endswith(
        f"not {SHOWN}"
    )
    assert str(InputError(f'no input "{BAD}"')) == f'no input "{ESCAPED}"'


def test_text_of_robots_and_browsers_is_shown_with_escapes(
    tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    kiosk = servers(Server(ROOT, KIOSK_DATA=str(tmp_path)))
    until(kiosk.ready, "ready")
    assert kiosk.press("operation", BAD, id="bad-1").json()["outcome"] == "published"
    until(lambda: SHOWN in kiosk.widget("last_heard")["text"], "the robot says it again")
    refused = kiosk.press("operation", BAD, id="bad-1", inputs={BAD: 1}).json()
    assert refused["outcome"] == "refused"
    assert ESCAPED in kiosk.http.post("/widgets/operation", json={"inputs": {}, BAD: 1}).json()["error"]
    assert SHOWN[:20] in kiosk.http.get(f"/nothing/{quote(BAD)}").json()["error"]
    pages = {path: kiosk.http.get(path).text for path in ("/", "/log", f"/log?text={quote(BAD[:10])}")}
    for path, text in pages.items():
        assert not HIDDEN.search(text), path
        assert SHOWN[:15] in text, path
    exported = kiosk.http.get("/log.csv?every=true").text.removeprefix("\ufeff")
    assert not HIDDEN.search(exported.replace("\r\n", "\n"))
    rows = list(csv.DictReader(io.StringIO(exported, newline="")))
    assert [json.loads(row["values"]) for row in rows if row["press"] == "bad-1"] == [
        {"message": BAD}
    ] * 2
    until(lambda: "press bad-1" in kiosk.process.text, "it is logged")
    assert not HIDDEN.search(kiosk.process.text.replace("\n", ""))

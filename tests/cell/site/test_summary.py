"""The summary of a cell: what walls accept of it, and what they refuse."""

import json
from typing import Any, Final

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.cell.site.summary import MAX_BYTES, in_languages, read_summary, said_in
from app.system.errors import InputError
from app.system.texts import PanelText, say
from tests.support.cells import alarm, payload, summary

WHOLE: Final = summary("line 2", "cell 1", "fault", alarm_list=[alarm(1, {"en": "Door", "ja": "扉"})])


def read(content: Any) -> Any:
    return read_summary(json.dumps(content).encode(), "line 2", "cell 1")


def test_a_summary_is_read_whole() -> None:
    shown = read(WHOLE)
    assert (shown.state.kind, shown.alarms["1"], shown.figures[0].text) == ("fault", 1, "305 boxes/h")
    assert said_in(shown.alarm_list[0].text, "ja") == "扉"
    assert said_in(shown.alarm_list[0].text, "de") == "Door"
    assert read({**WHOLE, "of_a_newer_version": [1]}) == shown


# key, value: each is refused, and the key is named.
HOSTILE: Final[list[tuple[str, Any]]] = [
    ("url", "javascript:alert(1)"),
    ("url", "data:text/html,x"),
    ("url", "https://a b/"),
    ("url", "https://user@evil.example/"),
    ("url", "https://x\u202e/"),
    ("url", "https://" + "a" * 300),
    ("url", None),
    ("cell", "cell 2"),
    ("site", "line/2"),
    ("state", "running"),
    ("state", {**WHOLE["state"], "kind": "<b>"}),
    ("state", {**WHOLE["state"], "text": "x" * 201}),
    ("state", {**WHOLE["state"], "shape": 'x" onload="'}),
    ("state", {**WHOLE["state"], "text": {"en": 1}}),
    ("state", {**WHOLE["state"], "text": {"not a tag!": "x"}}),
    ("state", {**WHOLE["state"], "text": {f"a{chr(97 + n)}": "x" for n in range(13)}}),
    ("since", "yesterday"),
    ("since", "2026-11-25T14:40:00"),
    ("since", "9999-11-25T14:40:00+00:00"),
    ("alarms", {"1": -1}),
    ("alarms", {"5": 1}),
    ("alarms", {"1": 1e9}),
    ("alarms", {"1": "1"}),
    ("unacknowledged", {"1": True}),
    ("alarm_list", [alarm(1, "x")] * 6),
    ("alarm_list", [alarm(0, "x")]),
    ("alarm_list", [alarm(1, "x", state="shelved")]),
    ("figures", [{**WHOLE["figures"][0]}] * 5),
    ("figures", [{**WHOLE["figures"][0], "state": "shouted"}]),
    ("control", {"required": "yes", "holder": ""}),
    ("links", [{"robot": "r", "state": "ok"}] * 101),
    ("instance", "a b"),
    ("at", "x" * 41),
    ("simulated", 0),
]


@pytest.mark.parametrize(("key", "value"), HOSTILE, ids=[f"{k}{n}" for n, (k, _) in enumerate(HOSTILE)])
def test_each_size_and_type_is_checked(key: str, value: Any) -> None:
    with pytest.raises(InputError, match=rf"^(it is that of another cell|{key})"):
        read({**WHOLE, key: value})


@pytest.mark.parametrize("key", [key for key in WHOLE])
def test_a_key_that_is_missing_is_named(key: str) -> None:
    with pytest.raises(InputError, match=key):
        read({name: value for name, value in WHOLE.items() if name != key})


@pytest.mark.parametrize(
    "content", [b"", b"\xff\x00", b"[]", b"null", b"{" * 5_000, b'{"site":', b" " * (MAX_BYTES + 1)]
)
def test_what_is_no_summary_is_refused(content: bytes) -> None:
    with pytest.raises(InputError):
        read_summary(content, "line 2", "cell 1")


@given(st.binary(max_size=400))
def test_any_bytes_are_read_or_refused(content: bytes) -> None:
    with pytest.raises(InputError):
        read_summary(content, "line 2", "cell 1")


def test_one_that_was_cut_anywhere_is_refused() -> None:
    whole = payload("line 2", "cell 1")
    for end in range(0, len(whole), 7):
        with pytest.raises(InputError):
            read_summary(whole[:end], "line 2", "cell 1")


def test_a_text_is_sent_once_where_its_languages_read_the_same() -> None:
    assert in_languages("RUNNING", ("en", "ja")) == "RUNNING"
    assert in_languages(PanelText({"en": "Door", "ja": "扉"}, "ja"), ("en", "ja")) == {
        "ja": "扉",
        "en": "Door",
    }
    assert set(in_languages(say("online"), ("en", "de"))) == {"en", "de"} or in_languages(
        say("online"), ("en", "de")
    )

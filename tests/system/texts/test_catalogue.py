"""Sentences as values, and their catalogues: every code is there, in every language."""

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.system.clock import format_age
from app.system.settings import PACKAGE, shipped_path
from app.system.texts import (
    ENGLISH,
    Text,
    joined,
    localized,
    render,
    rendered_if_known,
    say,
    sentences,
    text_in,
)
from app.system.texts.catalogue import babel_translations, catalogues_in, files, translations
from app.system.texts.check import faults, placeholders

SPEAKERS = ("say", "said", "locked", "refused")  # functions whose first argument is a code
PREFIXES = (
    "alarms_",
    "diagnostics_",
    "finding_",
    "look_",
    "oee_",
    "users_page_",
    "users_page_new_",
    "users_page_remove_",
    "users_page_sure_",
    "log_page_",
    "places_",
    "recipes_",
    "story_",
)  # of codes that are put together
SENTENCES = sentences(ENGLISH)


def spoken() -> Iterator[tuple[str, str, frozenset[str]]]:
    """(where, code, names given) of every call in the program that names its code."""
    for path in sorted(PACKAGE.rglob("*.py")):
        for call in ast.walk(ast.parse(path.read_text())):
            if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Name) or not call.args:
                continue
            code = call.args[0]
            if call.func.id in SPEAKERS and isinstance(code, ast.Constant):
                names = frozenset(k.arg for k in call.keywords if k.arg)
                yield f"{path.name}:{call.lineno}", str(code.value), names


def test_every_code_that_the_program_says_has_a_sentence() -> None:
    said = list(spoken())
    assert len(said) > 20
    assert [(where, code) for where, code, _ in said if code not in SENTENCES] == []


def test_every_sentence_gets_all_its_parameters() -> None:
    # `refused(code, why)` fills in `why` and `time` itself.
    lacking = [
        (where, code)
        for where, code, names in spoken()
        if not placeholders(SENTENCES[code]) <= names | {"why", "time"}
    ]
    assert lacking == []


def test_every_sentence_is_said_somewhere() -> None:
    sources = [*PACKAGE.rglob("*.py"), PACKAGE.parent / "tests/gallery/page.py"]
    shown = (path for name in ("templates", "static") for path in shipped_path(name).rglob("*.*"))
    sources += [path for path in shown if path.parent.name not in ("fonts", "__pycache__")]
    words = set(re.findall(r"\w+", "\n".join(path.read_text() for path in sources)))
    ends = {
        code: {
            code.removesuffix(doing).removeprefix(prefix)
            for prefix in ("", *PREFIXES)
            for doing in ("", "_do")
        }
        for code in SENTENCES
    }
    assert [code for code, said in ends.items() if not words & said] == []


def test_a_sentence_is_filled_in() -> None:
    assert render(say("interlock_waiting", topic="/estop")) == "Locked: /estop is not known yet."


def test_braces_in_parameters_are_text() -> None:
    assert render(say("refused", why="{topic}", time="now")) == "Not sent at now: {topic}"


@pytest.mark.parametrize(
    "text", [say("no_such_code"), say("refused", other="1"), say("refused", why=say("none"), time="")]
)
def test_a_sentence_that_is_missing_shows_its_code_and_is_logged(
    text: Text, caplog: pytest.LogCaptureFixture
) -> None:
    assert render(text) == text.code
    assert rendered_if_known(text, "de") is None
    assert "no sentence in en" in caplog.text


def test_a_text_is_its_code_and_its_parameters() -> None:
    text = say("interlock_stale", topic="/estop", limit="2")
    assert text == say("interlock_stale", limit="2", topic="/estop")
    assert {text: 1}[say("interlock_stale", topic="/estop", limit="2")] == 1
    assert text != say("interlock_stale", topic="/estop", limit="3")
    assert text != render(text)
    with pytest.raises(AttributeError, match="code: a Text does not change"):
        text.code = "interlock_waiting"


def test_nested_text_is_rendered_with_its_sentence() -> None:
    why = say("interlock_waiting", topic="/estop")
    assert render(say("with_stop", said=say("and_more", names=("/a", why), number=2))) == (
        f"/a, {render(why)} and 2 more."
    )


def test_consecutive_texts_are_joined() -> None:
    first, last = say("ready"), say("stopping")
    both = joined([first, "", last])
    assert isinstance(both, Text)
    assert render(both) == f"{render(first)} {render(last)}"
    assert render(joined([first, last], "between_lines")).splitlines() == [render(first), render(last)]
    assert (joined([first, ""]), joined([])) == (first, "")


def test_hidden_characters_in_a_parameter_are_shown() -> None:
    assert "\\u202e" in render(say("interlock_waiting", topic="/\u202estop"))


def test_a_text_comes_back_from_json() -> None:
    text = say("refused", why=joined([say("interlock_waiting", topic="/a"), "as is"]), time="10:00:00")
    assert text_in(json.dumps(text.as_json())) == text
    with pytest.raises(ValueError, match="no sentence"):
        text_in('{"code": "ready"}')


def test_a_value_is_rendered_with_all_that_is_in_it() -> None:
    values = {"reason": say("ready"), "several": [say("ready"), 1, None], "text": "as it is"}
    ready = render(say("ready"))
    assert localized(values, ENGLISH) == {
        "reason": ready,
        "several": [ready, 1, None],
        "text": "as it is",
    }


# Catalogues.


def catalogue(folder: Path, language: str, entries: dict[str, str]) -> Path:
    """A catalogue with these sentences."""
    path = folder / f"{language}.po"
    lines = (
        f"msgid {json.dumps(code)}\nmsgstr {json.dumps(text, ensure_ascii=False)}\n"
        for code, text in entries.items()
    )
    path.write_text("\n".join(lines))
    return path


def test_every_catalogue_is_whole() -> None:
    assert list(faults(files())) == []


@pytest.mark.parametrize(
    ("changed", "fault"),
    [
        ({"interlock_waiting": ""}, "interlock_waiting is not translated"),
        ({"interlock_waiting": "Gesperrt."}, "interlock_waiting has nothing, and English has {topic}"),
        (
            {"interlock_waiting": "{topic} {node}"},
            "interlock_waiting has {node}, {topic}, and English has {topic}",
        ),
        (
            {"interlock_waiting": "{topic.__class__}"},
            "interlock_waiting has {topic.__class__}, and English has {topic}",
        ),
        (
            {"interlock_waiting": "{topic!r}"},
            "interlock_waiting has {topic!r}, and English has {topic}",
        ),
        (
            {"interlock_waiting": "{topic"},
            "interlock_waiting can't be filled in: expected '}' before end of string",
        ),
        ({"vaiting": "{topic}"}, "vaiting is no code of the English catalogue"),
    ],
)
def test_a_fault_of_a_translation_is_named(tmp_path: Path, changed: dict[str, str], fault: str) -> None:
    path = catalogue(tmp_path, "de", {**SENTENCES, "keypad_decimal": ",", **changed})
    assert list(faults({ENGLISH: files()[ENGLISH], "de": path})) == [f"de.po: {fault}"]


def test_a_code_that_is_there_twice_is_named(tmp_path: Path) -> None:
    path = catalogue(tmp_path, "de", {**SENTENCES, "keypad_decimal": ","})
    path.write_text(path.read_text() + '\nmsgid "keypad_decimal"\nmsgstr "."\n')
    known = list(faults({ENGLISH: files()[ENGLISH], "de": path}))
    assert "de.po: keypad_decimal is there 2 times" in known


def test_a_catalogue_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    path = tmp_path / "de.po"
    path.write_bytes(b'msgid "ready"\nmsgstr "Gr\xfcn"\n')
    (fault,) = faults({ENGLISH: files()[ENGLISH], "de": path})
    assert fault.startswith("de.po: ")


def test_missing_sentence_of_a_language_is_in_english(tmp_path: Path) -> None:
    shipped = list(files())
    own = {"interlock_waiting": "Gesperrt: warte auf {topic}.", "between_names": "{first} / {last}"}
    catalogue(tmp_path, "qps", own)
    with catalogues_in(tmp_path):
        assert render(say("interlock_waiting", topic="/a"), "qps") == "Gesperrt: warte auf /a."
        assert (
            render(say("interlock_waiting", topic=("/a", "/b")), "qps")
            == "Gesperrt: warte auf /a / /b."
        )
        assert render(say("stopping"), "qps") == SENTENCES["stopping"]
        assert render(say("interlock_waiting", topic="/a")) == "Locked: /a is not known yet."
    assert list(files()) == shipped


def test_catalogue_of_a_further_folder_overrides_the_shipped_catalogue(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "~"):  # neither by the order of their names
        folder.mkdir(exist_ok=True)
        catalogue(folder, "de", {"stopping": str(folder)})
        with catalogues_in(folder):
            assert render(say("stopping"), "de") == str(folder)
    assert render(say("stopping"), "de") == "Wird beendet."


def test_english_japanese_and_german_are_shipped() -> None:
    assert set(files()) == {"de", "en", "ja"}


def test_sentences_and_names_follow_one_another_as_the_language_has_it() -> None:
    stopped = joined([say("log_began"), say("log_entries_lost", first=1, last=2)])
    assert [render(stopped, language) for language in ("ja", "de")] == [
        "パネルサーバーが起動しました。No. 1～2 の記録がディスクから失われました。",
        "Der Panel-Server wurde gestartet. "
        "Die Einträge 1 bis 2 sind auf dem Datenträger verloren gegangen.",
    ]
    locked = say("locks_more", names=("起動", "払出し"), number=2)
    assert render(locked, "ja") == "操作不可：起動、払出し、ほか 2 件。"


def test_a_sentence_in_another_one_ends_as_the_language_has_it() -> None:
    why = say(
        "input_outside_limits",
        label="速度",
        given="400 mm/s",
        limits=say("limits_low", low=0, unit=" mm/s"),
    )
    assert render(say("press_not_encoded", why=why, time="10:04:32"), "ja") == (
        "未送信（10:04:32）：「速度」に 400 mm/s は入力できません（入力できる値：0 mm/s 以上）。"
    )
    ended = say("hold_ended", time="10:04:32", seconds="3.2", why=say("hold_by_sliding"))
    assert render(ended, "ja") == (
        "終了しました（10:04:32、3.2 秒間）：指がボタンから外れました。"
        "いったん離してから、もう一度押してください。"
    )


@pytest.mark.parametrize("language", sorted({*files()} - {ENGLISH}))
def test_a_translation_ends_as_its_english_does(language: str) -> None:
    """What is put into another sentence must not bring a full stop of its own, nor lack one."""
    stops = (".", ".)", "。", "。）")
    own = sentences(language)
    assert [
        code
        for code, english in SENTENCES.items()
        if len(english) > 1 and english.endswith(stops) != own[code].endswith(stops)
    ] == []


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0 s"),
        (4.9, "4 s"),
        (59.999, "59 s"),
        (60, "1 min"),
        (3599, "59 min"),
        (3600, "1 h"),
        (360_000, "100 h"),
    ],
)
def test_age_is_rendered_in_words(seconds: float, text: str) -> None:
    assert render(format_age(seconds)) == text


# Sentences that name a topic itself: they tell an engineer what to correct on the robot or in the panel
# file, or are shown on Diagnostics. In the others `topic` is the label that operators know, by
# `Condition.subject`, or their widget's own label stands beside them.
NAME_TOPICS = {
    "editor_curve_nothing",
    "editor_curve_title",
    "look_no_topic",
    "look_not_forwarded",
    "look_title",
    "qos_robot_best_effort",
    "qos_robot_requires_reliable",
    "qos_robot_requires_transient_local",
    "qos_robot_volatile",
    "topic_not_forwarded",
    "topic_wrong_type",
}


@pytest.mark.parametrize("language", ["en", "de", "ja"])
def test_sentences_for_operators_name_no_topic(language: str) -> None:
    with_topic = {code for code, text in sentences(language).items() if "{topic}" in text}
    labelled = {code for code in with_topic if code.startswith(("interlock_", "link_node_stale"))}
    assert with_topic - labelled == NAME_TOPICS


@pytest.mark.parametrize("path", files().values(), ids=lambda path: path.stem)
def test_a_catalogue_is_read_as_babel_reads_it(path: Path) -> None:
    assert translations(path) == babel_translations(path)


HEADER = 'msgid ""\nmsgstr ""\n"Content-Type: text/plain; charset=utf-8\\n"\n\n'


@pytest.mark.parametrize(
    ("entries", "expected"),
    [
        ('#. About\nmsgid "a"\nmsgstr "one\\n"\n"two \\"x\\" \\\\n"\n', {"a": 'one\ntwo "x" \\n'}),
        ('#, fuzzy\nmsgid "a"\nmsgstr "x"\n', {}),
        ('msgid "a"\nmsgstr ""\n\nmsgid "b"\nmsgstr "x"\n', {"b": "x"}),
        ('msgid ""\n"a"\nmsgstr "x"\n', {"a": "x"}),
        ('#~ msgid "a"\n#~ msgstr "x"\n', {}),
        ('msgid "a"\nmsgstr "x" \n', {"a": "x"}),
    ],
)
def test_what_a_translators_tool_writes_is_read(
    entries: str, expected: dict[str, str], tmp_path: Path
) -> None:
    path = tmp_path / "xx.po"
    path.write_text(HEADER + entries)
    assert translations(path) == babel_translations(path) == expected

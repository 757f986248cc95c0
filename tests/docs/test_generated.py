"""What the documentation takes from the code: complete, up to date, and true of panel files."""

import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import pytest
from jsonschema_rs import Draft7Validator

from app.panel.reference import schema
from app.system.settings import VARIABLES
from app.system.texts import BETWEEN, ENGLISH, sentences
from app.system.texts.catalogue import catalogues_in
from docs._generate import locks, places
from docs._generate import settings as variables
from docs._generate.__main__ import filled, out_of_date
from docs._generate.keys import examples_of
from tests.faults import results
from tests.support.parts import ROOT, TESTS

SENTENCES: Final = sentences(ENGLISH)
SCHEMA: Final[dict[str, Any]] = schema.panel_schema()
TABLES: Final = {schema.ROOT: SCHEMA, **SCHEMA["definitions"]}
VALIDATOR: Final = Draft7Validator(SCHEMA)
EVERYTHING: Final = (TESTS / "everything.toml").read_text()
MISTAKES: Final = tomllib.loads((TESTS / "mistakes.toml").read_text())["mistake"]
EXAMPLES: Final = sorted((ROOT / "docs").rglob("*.toml"))
PANELS: Final = [
    ROOT / "app/panel.toml",
    TESTS / "everything.toml",
    *(path for path in EXAMPLES if not path.parent.name.startswith("_")),
]


def keys() -> Iterator[tuple[str, str]]:
    """Every key of the panel file, with its table."""
    for name, table in TABLES.items():
        if name != schema.WIDGET:  # all kinds together
            yield from ((name, key) for key in table["properties"])


def test_the_pages_and_the_schema_are_as_the_code_is() -> None:
    assert out_of_date() == [], "run `make docs`, or `.venv/bin/python -m docs._generate`"


def test_a_page_without_the_section_is_named() -> None:
    with pytest.raises(ValueError, match=r"page\.md has no section between <!-- keys log -->"):
        filled("nothing\n", {"keys log": "| Key |"}, "page.md")


def test_each_model_of_the_panel_file_is_a_table_of_the_reference() -> None:
    assert set(schema.models()) == set(TABLES) - {schema.WIDGET}


def test_each_key_has_a_description_and_an_example_that_it_takes() -> None:
    examples = examples_of(TABLES)
    assert [f"{t}.{key}" for t, key in keys() if schema.about(t, key)[-1] not in ".`"] == []
    assert [f"{table}.{key}" for table, key in keys() if f"{table}.{key}" not in examples] == []
    properties = {f"{table}.{key}": TABLES[table]["properties"][key] for table, key in keys()}
    of_all = Draft7Validator({"definitions": SCHEMA["definitions"], "properties": properties})
    assert [str(error) for error in of_all.iter_errors(examples)] == []


def test_a_key_without_a_description_is_named() -> None:
    with pytest.raises(KeyError, match='does not say what "shade" of "panel" means'):
        schema.about("panel", "shade")


def test_every_described_key_exists() -> None:
    known = {f"{table}.{key}" for table, key in keys()}
    any_table = {key for _, key in keys()}
    for table, described in schema.WORDS.items():
        if table in ("tables", "examples"):
            continue
        for key in described:
            names = (f"{name}.{key}" for name in schema.tables_of(table))
            there = key in any_table if table == schema.ANY else any(name in known for name in names)
            assert there, f"{table}.{key}"
    assert set(schema.WORDS["tables"]) == set(TABLES)
    assert set(schema.WORDS["examples"]) <= known


@pytest.mark.parametrize("path", PANELS, ids=lambda path: path.name)
def test_good_panels_are_good_by_the_schema(path: Path) -> None:
    errors = VALIDATOR.iter_errors(tomllib.loads(path.read_text()))
    assert [str(error) for error in errors] == []


def test_the_shipped_panel_names_the_schema() -> None:
    first = (ROOT / "app/panel.toml").read_text().splitlines()[0]
    named = first.removeprefix("#:schema ")
    assert json.loads((ROOT / "app" / named).read_text()) == SCHEMA


def found_by_schema(mistake: dict[str, str]) -> bool:
    tables = tomllib.loads(EVERYTHING.replace(mistake["old"], mistake["new"]))
    return not VALIDATOR.is_valid(tables)


@pytest.mark.parametrize(
    "words",
    [
        "must not be empty",  # a text's length
        'did you mean "live"?',  # one of some words
        'did you mean "robot"?',  # an unknown key, and what was meant
        "60 or less, not 1000",  # a limit
        'must be a number, not "512"',  # another type
        "is not a ROS 2 service type",
        "is not the absolute name of a ROS 2 node",
        '"text" has no "min", "max", "step" and "u',  # keys of another kind
        'a button is "publish" for a topic, "call" for a service',
        "is missing: of a best-effort topic",
    ],
)
def test_mistakes_of_one_key_are_found_by_the_schema(words: str) -> None:
    (mistake,) = (mistake for mistake in MISTAKES if mistake["words"] == words)
    needs_another_key = "best-effort" in words
    assert found_by_schema(mistake) is not needs_another_key


def test_schema_finds_a_third_of_all_mistakes() -> None:
    found_mistakes = [mistake for mistake in MISTAKES if found_by_schema(mistake)]
    assert len(found_mistakes) > len(MISTAKES) / 3  # the others need the types, or another key


def test_every_table_but_those_of_messages_is_closed() -> None:
    for name, table in TABLES.items():
        if name != schema.WIDGET:  # its kinds are
            assert table["additionalProperties"] is False, name


def test_each_sentence_locks_and_has_advice_or_is_known_to_lock_nothing() -> None:
    assert locks.unexplained() == [], f"say in {locks.FILE.name} what to do about them"


def test_advice_is_for_sentences_that_are_there() -> None:
    advised = {code for group, codes in locks.ADVICE.items() if group != locks.OTHERS for code in codes}
    plain = {code for code in locks.ADVICE[locks.OTHERS]["codes"] if "*" not in code}
    assert advised | plain <= set(SENTENCES)
    assert advised.isdisjoint(plain)


def test_every_lock_code_has_advice() -> None:
    source = "".join(path.read_text() for path in places.modules())
    codes = set(re.findall(r'\b(?:locked\(|Verdict\(False, )"(\w+)"', source)) & set(SENTENCES)
    assert {"link_connecting", "interlock_not_permitted", "press_in_progress"} <= codes
    advised = {code for group, codes in locks.ADVICE.items() if group != locks.OTHERS for code in codes}
    assert codes <= advised


def test_the_japanese_advice_is_for_the_same_sentences_and_names_keys_as_they_are() -> None:
    path = locks.FILE.with_name("locks.ja.toml")
    advice = tomllib.loads(path.read_text(encoding="utf-8"))
    english = {group: list(codes) for group, codes in locks.ADVICE.items() if group != locks.OTHERS}
    assert {group: list(codes) for group, codes in advice.items()} == english
    keys = set(
        re.findall(
            "「(.+?)」", "".join(sentence for codes in advice.values() for sentence in codes.values())
        )
    )
    assert keys
    assert keys <= set(sentences("ja").values())


def test_each_sentence_is_listed_with_its_modules() -> None:
    rows = [row.split(" | ") for row in places.sentences_table().splitlines()[2:]]
    assert len(rows) == len(SENTENCES.keys() - BETWEEN)
    assert [row for row in rows if "`app/" not in row[2]] == []


def test_a_new_sentence_without_advice_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(locks, "SENTENCES", {**SENTENCES, "on_fire": "Locked: {name} is on fire."})
    assert locks.unexplained() == ["on_fire"]


def test_each_setting_is_described() -> None:
    assert set(variables.ABOUT) == set(VARIABLES)


def test_each_dependency_has_its_reason() -> None:
    described = tomllib.loads((ROOT / "pyproject.toml").read_text())
    wanted = [*described["project"]["dependencies"]]
    wanted += [
        requirement for group in described["dependency-groups"].values() for requirement in group
    ]
    names = {
        match[0]
        for requirement in wanted
        if isinstance(requirement, str) and (match := re.match(r"[\w-]+", requirement))
    }
    rows = (ROOT / "docs/architecture.md").read_text().split("## Dependencies")[1]
    assert [name for name in sorted(names) if not re.search(rf"\b{name}\b", rows)] == []


def test_each_path_of_http_is_in_its_reference() -> None:
    page = (ROOT / "docs/reference/http.md").read_text()
    routes = [row.split("`")[1] for row in places.paths_table().splitlines()[2:]]
    assert "POST /widgets/{widget}" in routes
    for route in routes:
        method, path = route.split()
        if not path.startswith("/static/"):  # what pages load
            written = f"`{path}`" if method == "WebSocket" else f"{method} {path}"
            written = written.replace("{alarm:path}", "{alarm}")
            assert written in page or written.replace("{act}", "take") in page, route


def test_measured_fault_times_are_written_to_their_page(tmp_path: Path) -> None:
    page = tmp_path / "reliability.md"
    page.write_text((ROOT / "docs/reliability.md").read_text())
    results.write("| what breaks |", page)
    assert f"\n{results.BEGIN}\n| what breaks |\n{results.END}\n" in page.read_text()


def test_a_page_without_the_faults_stays_as_it_is(tmp_path: Path) -> None:
    page = tmp_path / "README.md"
    page.write_text("nothing here\n")
    with pytest.raises(ValueError, match="has no section"):
        results.write("| what breaks |", page)
    assert page.read_text() == "nothing here\n"


def test_the_page_of_locks_in_another_language_is_whole(tmp_path: Path) -> None:
    def toml(advice: Mapping[str, Mapping[str, str]]) -> Path:
        path = tmp_path / "locks.ja.toml"
        lines = [f"[{g}]\n" + "".join(f'{c} = "対処"\n' for c in codes) for g, codes in advice.items()]
        path.write_text("\n".join(lines), encoding="utf-8")
        return path

    (tmp_path / "ja.po").write_text('msgid "interlock_waiting"\nmsgstr "{topic} を待っています。"\n')
    advice = locks.groups(locks.ADVICE)
    with catalogues_in(tmp_path):
        page = locks.translated_page("ja", toml(advice))
        assert page.startswith("---\norphan: true\n---\n# 操作不可と拒否の理由\n")
        assert "| *{topic}* を待っています。 | `interlock_waiting` | 対処 |" in page
        assert page.count("\n## ") == len(advice)
        links = {
            code: sentence for code, sentence in advice["link"].items() if code != "link_unreachable"
        }
        fewer = {**advice, "link": {**links, "on_fire": ""}}
        with pytest.raises(ValueError, match=r"locks.ja.toml: \[link\] .*: link_unreachable, on_fire"):
            locks.translated_page("ja", toml(fewer))
    assert locks.translations(tmp_path) == {"ja": tmp_path / "locks.ja.toml"}
    with pytest.raises(ValueError, match=r"no \[fr\]"):
        locks.translated_page("fr", tmp_path / "locks.ja.toml")

"""Mistakes in a panel file, one at a time: each is one fault, with its line and its widget, in words of
the file's own. `everything.toml` has every kind of widget and every key, each on a line of its own."""

import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app.errors import Fault, PanelError
from app.panel import load_panel
from app.panel.faults.table_keys import inner_model, known_keys
from app.panel.interlock import CONDITIONS
from app.panel.layout import Page
from app.panel.model import Panel
from app.panel.widgets.kinds import KINDS
from tests.support.form import LONG, several
from tests.support.parts import TESTS

GOOD: Final = (TESTS / "everything.toml").read_text()
LINES: Final = GOOD.splitlines()
TABLES: Final = tomllib.loads(GOOD)
KEY: Final = re.compile(r"([a-z_.]+) = ")
HEADER: Final = re.compile(r'\[+([a-z_.]+)(?:\."[^"]*")?\]+')
WITH_ID: Final = re.compile(
    r"\[\[(?:page|page\.widget|page\.group\.widget|frame\.widget|robot|interlock)\]\]"
)
# What belongs to Python, its libraries and this program, and means nothing to who writes a panel.
INTERNAL: Final = re.compile(
    r"pydantic|valid(ation|ator)|Literal|<class|Traceback|datetime|\bNone\b|\bTrue\b|\bFalse\b|\bdict\b"
    r"|\btuple\b|\bstr\b|[Ii]nput should|should match|pattern|regex|\[a-z|\(\?|\[0-9\]|\^|\$"
)
FaultsOf = Callable[[str], list[Fault]]


@pytest.fixture(scope="module")
def faults_of(tmp_path_factory: pytest.TempPathFactory) -> FaultsOf:
    """The faults of a text as a panel file, beside which the interfaces are that it names."""
    folder: Path = tmp_path_factory.mktemp("cell")
    messages = folder / "msgs/cell_msgs/msg"
    messages.mkdir(parents=True)
    (messages / "Jog.msg").write_text("float64 speed\nuint32 valid_ms\nuint16 number\n")
    (messages / "Wear.msg").write_text("float65 hours\n")
    (folder / "msgs/plan.svg").write_text("<svg/>")
    path = folder / "cell.toml"

    def faults(text: str) -> list[Fault]:
        path.write_text(text)
        try:
            load_panel(path)
        except PanelError as error:
            return list(error.faults)
        return []

    return faults


def the_one(faults_of: FaultsOf, text: str) -> Fault:
    (fault,) = faults_of(text)
    assert INTERNAL.search(str(fault)) is None, str(fault)
    assert len(str(fault)) < 500, str(fault)
    return fault


def with_line(number: int, line: str) -> str:
    """The good panel with another line in the place of one, counted from 1."""
    return "\n".join([*LINES[: number - 1], line, *LINES[number:]])


def id_at(number: int) -> str:
    """The id of what a line belongs to: a widget, a page, an interlock, a robot."""
    header = next((n for n in range(number, 0, -1) if HEADER.fullmatch(LINES[n - 1])), 0)
    while header and not WITH_ID.fullmatch(LINES[header - 1]):
        name = HEADER.fullmatch(LINES[header - 1])
        if name and "." not in name[1]:
            return ""
        if name and name[1] == "page.group":
            return id_at(max(n for n in range(1, header) if LINES[n - 1] == "[[page]]"))
        header -= 1
    return LINES[header].removeprefix('id = "').removesuffix('"') if header else ""


def lacking(table: Mapping[str, Any], model: Any, where: str = "") -> Iterator[str]:
    """Keys of a description that a table lacks; of a list all of its tables together."""
    for key in known_keys(model):
        if key not in table:
            yield f"{where}{key}"
        elif (within := inner_model(model, key)) and key not in ("page", "widget"):
            tables = list(table[key].values()) if key == "demo" else [table[key]]
            parts = table[key] if isinstance(table[key], list) else tables
            yield from lacking({k: v for part in parts for k, v in part.items()}, within, f"{key}.")


def test_the_panel_with_everything_is_good_and_has_everything(faults_of: FaultsOf) -> None:
    assert faults_of(GOOD) == []
    conditions = [f"interlock.{key}" for key in (*CONDITIONS, "unit")]  # not all fit one interlock
    # There are robots, which have their own namespaces.
    assert list(lacking(TABLES, Panel)) == ["namespace", *conditions]
    pages, groups = TABLES["page"], [one for page in TABLES["page"] for one in page.get("group", ())]
    widgets = [widget for part in (*pages, *groups, TABLES["frame"]) for widget in part["widget"]]
    together = {key: value for page in pages for key, value in page.items()}
    # Those are files beside the panel file; test_page_templates.py has them.
    assert list(lacking(together, Page)) == ["template", "styles"]
    for kind, model in KINDS.items():
        own = {k: v for widget in widgets if widget["kind"] == kind for k, v in widget.items()}
        qos = {k: v for w in widgets if w["kind"] == kind for k, v in w.get("qos", {}).items()}
        assert list(lacking(own | ({"qos": qos} if qos else {}), model)) == [], kind


def keys() -> Iterator[tuple[tuple[str, str], int]]:
    """((the table's header, the key), number) of each line with a key."""
    header = ""
    for number, line in enumerate(LINES, 1):
        header = found[1] if (found := HEADER.fullmatch(line)) else header
        if found := KEY.match(line):
            yield (header, found[1]), number


# In the short form one line for each key of each table.
KEYS: Final = [number for _, number in keys()] if LONG else [*dict(keys()).values()]
HEADERS: Final = [number for number, line in enumerate(LINES, 1) if HEADER.fullmatch(line)]


def shown(number: int) -> str:
    return f"{number}: {LINES[number - 1]}"


def key_of(number: int) -> str:
    found = KEY.match(LINES[number - 1]) or HEADER.fullmatch(LINES[number - 1])
    assert found is not None
    return found[1]


@pytest.mark.parametrize("number", KEYS, ids=shown)
def test_a_value_that_is_of_no_use_is_one_fault(faults_of: FaultsOf, number: int) -> None:
    fault = the_one(faults_of, with_line(number, f"{key_of(number)} = 1979-05-27"))
    assert fault.line == number
    assert fault.id == ("" if key_of(number) == "id" else id_at(number))
    assert fault.place.endswith(key_of(number))


OPTIONS: Final = ("value = 1", "value = 2")  # of a select: each may be a table


@pytest.mark.parametrize("number", [n for n in KEYS if LINES[n - 1] not in OPTIONS], ids=shown)
def test_a_table_where_none_belongs_is_one_fault(faults_of: FaultsOf, number: int) -> None:
    fault = the_one(faults_of, with_line(number, f"{key_of(number)} = {{ a = 1 }}"))
    assert fault.line == number
    assert fault.place.removesuffix(".a").endswith(key_of(number))


@pytest.mark.parametrize("number", [*KEYS, *HEADERS], ids=shown)
def test_a_misspelt_key_or_table_is_one_fault(faults_of: FaultsOf, number: int) -> None:
    name = key_of(number)
    fault = the_one(faults_of, with_line(number, LINES[number - 1].replace(name, f"{name}x", 1)))
    assert fault.line == number
    in_message = re.search(r"\.(message|release|request|goal)\.", fault.place)
    hint = "unknown field" if in_message else f'did you mean "{name.rpartition(".")[2]}"?'
    assert hint in fault.message


# Lines without which something else is wrong than that they are missing.
SHOWS_AT: Final[Mapping[str, str]] = {
    'title = "Robot cell 1"': "",
    'interfaces = ["msgs"]': 'type = "cell_msgs/msg/Jog"',
    'pictures = "msgs"': 'src = "plan.svg"',
    'role = "reset"': 'colour = "blue"',
    'durability = "volatile"': 'qos = { durability = "volatile" }',
}


@pytest.mark.parametrize("number", KEYS, ids=shown)
def test_what_is_left_out_is_one_fault_at_most(faults_of: FaultsOf, number: int) -> None:
    found = faults_of(with_line(number, "#"))
    if not found:
        return  # it has a default
    fault = the_one(faults_of, with_line(number, "#"))
    header = max((n for n in HEADERS if n < number), default=0)
    elsewhere = SHOWS_AT.get(LINES[number - 1])
    lines = [header] if elsewhere is None else [LINES.index(elsewhere) + 1 if elsewhere else 0]
    assert fault.line in [*lines, header]


@pytest.mark.parametrize("number", HEADERS, ids=shown)
def test_a_header_that_is_left_out_is_one_fault(faults_of: FaultsOf, number: int) -> None:
    the_one(faults_of, with_line(number, "#"))


def changed(old: str, new: str) -> str:
    """The good panel with a part of it replaced, which is there once."""
    assert GOOD.count(old) == 1, old
    return GOOD.replace(old, new)


MISTAKES: Final = tomllib.loads((TESTS / "mistakes.toml").read_text())["mistake"]


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: mistake["new"][:60])
def test_a_mistake_is_one_fault_in_words(faults_of: FaultsOf, mistake: Mapping[str, str]) -> None:
    text = changed(mistake["old"], mistake["new"])
    fault = the_one(faults_of, text)
    assert fault.place == mistake["place"], str(fault)
    assert mistake["words"] in fault.message
    after = text.splitlines()
    line = next(n for n, (a, b) in enumerate(zip(LINES, after, strict=False), 1) if a != b)
    if at := mistake.get("at"):
        assert text.count(at) == 1
        line = text[: text.index(at)].count("\n") + 1
    assert fault.line == line, str(fault)


def test_it_is_not_toml(faults_of: FaultsOf) -> None:
    for old, new, line in (
        ('title = "Robot cell 1"', "title = Robot cell 1", 2),
        ('label = "Speed"', 'label = "Speed', 102),
        ('kind = "slider"', 'kind = "slider"\nkind = "number"', 102),
        ("min = -1.0", "min : -1.0", 105),
    ):
        fault = the_one(faults_of, changed(old, new))
        assert (fault.place, fault.line) == ("", line)


AT: Final = st.integers(0, len(LINES) - 1)
VALUES: Final = st.sampled_from((
    "1979-05-27", "07:32:00", "[]", "[[]]", "{}", "{ a = { b = 1 } }", "''", "-1", "1e400", "nan",
    "true", "[1, 'a', { b = 2 }]", '"\\u0000"', '"\\u202e"', "'{'", "['{now}']", "1.5", "x",
))  # fmt: skip
DAMAGE: Final = st.one_of(
    st.tuples(st.just("without"), AT),
    st.tuples(st.just("again"), AT, AT),
    st.tuples(st.just("value"), AT, VALUES),
    st.tuples(st.just("mistyped"), AT, st.integers(0, 30), st.sampled_from("aeiou_. ]\"'=#")),
)


@given(st.lists(DAMAGE, min_size=1, max_size=4))
@settings(
    max_examples=several(60, 200),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
def test_whatever_is_wrong_is_reported_in_words(
    faults_of: FaultsOf, damages: list[tuple[Any, ...]]
) -> None:
    lines = list(LINES)
    for what, at, *more in damages:
        match what, *more:
            case ("without",):
                lines[at] = ""
            case "again", other:
                lines[at] += f"\n{lines[other]}"
            case "value", value:
                lines[at] = lines[at].partition("=")[0] + f"= {value}"
            case "mistyped", column, character:
                lines[at] = lines[at][:column] + character + lines[at][column + 1 :]
    for fault in faults_of("\n".join(lines)):
        assert INTERNAL.search(str(fault)) is None, str(fault)
        assert fault.line or "." not in fault.place

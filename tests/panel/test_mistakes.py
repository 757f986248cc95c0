"""Mistakes in a panel file: each is one fault, with its line and its widget, in words of the file's
own, also where there are several. `everything.toml` has every kind of widget and every key, each on a
line of its own."""

import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app.panel import load_panel
from app.panel.condition import COMPARISONS
from app.panel.file.keys import inner_model, known_keys
from app.panel.file.same_widgets import SameWidget
from app.panel.file.toml_file import TABLES as HEADER_NAMES
from app.panel.layout import Page
from app.panel.model import Panel
from app.panel.source import NAME as SOURCE
from app.panel.widgets.families import Command
from app.panel.widgets.kinds import KINDS
from app.system.errors import Fault, PanelError
from tests.support.beside_panel import put_beside
from tests.support.form import LONG, several
from tests.support.parts import TESTS

pytestmark = pytest.mark.promise("panel file")

GOOD: Final = (TESTS / "everything.toml").read_text()
LINES: Final = GOOD.splitlines()
TABLES: Final = tomllib.loads(GOOD)
KEY: Final = re.compile(r"([a-z_.]+) = ")
HEADER: Final = re.compile(r'\[+([a-z_.]+)(?:\."[^"]*")?\]+')
WITH_ID: Final = re.compile(
    r"\[\[(?:page|page\.widget|page\.group\.widget|frame\.widget|robot|interlock|alarm|source)\]\]"
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
    put_beside(folder)
    path = folder / "cell.toml"

    def faults(text: str) -> list[Fault]:
        path.write_text(text)
        try:
            load_panel(path)
        except PanelError as error:
            return list(error.faults)
        return []

    return faults


def in_words(fault: Fault) -> Fault:
    assert INTERNAL.search(str(fault)) is None, str(fault)
    assert len(str(fault)) < 500, str(fault)
    return fault


def the_one(faults_of: FaultsOf, text: str) -> Fault:
    (fault,) = faults_of(text)
    return in_words(fault)


def with_line(number: int, line: str) -> str:
    """The good panel with another line in the place of one, counted from 1."""
    return with_lines({number: line})


def with_lines(others: Mapping[int, str]) -> str:
    """The good panel with other lines in the place of those with these numbers."""
    return "\n".join(others.get(number, line) for number, line in enumerate(LINES, 1))


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
    return re.sub('(?:id|same) = "(.*)"', r"\1", LINES[header]) if header else ""


def lacking(table: Mapping[str, Any], model: Any, where: str = "") -> Iterator[str]:
    """Keys of a description that a table lacks; of a list all of its tables together."""
    for key in known_keys(model):
        if key == SOURCE and model is not Panel:
            continue  # stands in place of the topic
        if key not in table:
            yield f"{where}{key}"
        elif (within := inner_model(model, key)) and key not in ("page", "widget"):
            tables = list(table[key].values()) if key == "demo" else [table[key]]
            parts = table[key] if isinstance(table[key], list) else tables
            yield from lacking({k: v for part in parts for k, v in part.items()}, within, f"{key}.")


def test_the_panel_with_everything_is_good_and_has_everything(faults_of: FaultsOf) -> None:
    assert faults_of(GOOD) == []
    comparisons = [*COMPARISONS, "unit", "scale", "offset", "format"]  # not all fit one condition
    of_interlocks = [f"interlock.{key}" for key in (*comparisons, "robot")]
    conditions = [*of_interlocks, *(f"condition.{key}" for key in comparisons)]
    left_out = ["type", *comparisons[1:]]
    of_alarms = [f"{table}.{key}" for table in ("when", "while") for key in left_out]
    of_one_robot = ["namespace", "dialect", "domain"]  # there are robots, which have their own
    # The catalogue is a file beside the panel file; no type of ROS 2 has a list with a bool `active`.
    files = ["list.active", "list.catalogue"]
    # Those of the last readback count, which is by parameters.
    of_topics = [f"readback.{key}" for key in ("topic", "type", "qos", "max_age_s", "fields")]
    every = [*of_one_robot, *of_alarms, *files, *conditions, *of_topics]
    assert sorted(lacking(TABLES, Panel)) == sorted(every)
    pages, groups = (
        TABLES["page"],
        [group for page in TABLES["page"] for group in page.get("group", ())],
    )
    widgets = [
        widget for part in (*pages, *groups, TABLES["frame"]) for widget in part.get("widget", ())
    ]
    copies = [widget for widget in widgets if "same" in widget]
    assert [list(lacking(copy, SameWidget)) for copy in copies] == [[]]
    widgets = [widget for widget in widgets if widget not in copies]
    together = {key: value for page in pages for key, value in page.items()}
    # Those are files beside the panel file; test_page_templates.py has them.
    assert list(lacking(together | {"robot": "r1"}, Page)) == ["template", "styles"]
    for kind, (model, *_) in KINDS.items():
        own: dict[str, Any] = {}
        for key, value in (item for w in widgets if w["kind"] == kind for item in w.items()):
            if isinstance(value, list) and isinstance(own.get(key), list):
                own[key] = [*own[key], *value]
            else:
                own[key] = {**own.get(key, {}), **value} if isinstance(value, dict) else value
        own |= {"grow": True, "show_label": False, "robot": "r1"}  # of any kind, but of few widgets
        own |= {"needs": "operator"} if issubclass(model, Command) else {}
        qos = {k: v for w in widgets if w["kind"] == kind for k, v in w.get("qos", {}).items()}
        # Options are the file's or the robot's.
        refused = {
            "select": ["options_from"],
            "trend": ["right_min", "right_max"],  # its pen is on the left
        }.get(kind, [])
        assert list(lacking(own | ({"qos": qos} if qos else {}), model)) == refused, kind


def keys() -> Iterator[tuple[tuple[str, str], int]]:
    """((the table's header, the key), number) of each line with a key."""
    header = ""
    for number, line in enumerate(LINES, 1):
        header = match[1] if (match := HEADER.fullmatch(line)) else header
        if match := KEY.match(line):
            yield (header, match[1]), number


# In the short form one line for each key of each table, several at once: as many mistakes, as many
# faults. In the long form every line, each alone.
KEYS: Final = [number for _, number in keys()] if LONG else [*dict(keys()).values()]
AT_ONCE: Final = several(20, 1)
ALL_HEADERS: Final = [number for number, line in enumerate(LINES, 1) if HEADER.fullmatch(line)]
HEADERS: Final = ALL_HEADERS if LONG else [*{LINES[n - 1]: n for n in ALL_HEADERS}.values()]
# Without them no types are known, and what the simulated robot says is judged where all else is right.
ALONE: Final = {
    *(number for number, line in enumerate(LINES, 1) if line.startswith(("distro", "interfaces"))),
    *range(LINES.index('[demo."/battery"]'), len(LINES) + 1),
    # Faults of sources come first.
    *range(LINES.index("[[source]]") + 1, LINES.index("[alarms]") + 1),
    *(number for number, line in enumerate(LINES, 1) if line.startswith("source = ")),
}


def apart(numbers: Sequence[int]) -> list[list[int]]:
    """The numbers in groups, each of different widgets, pages, interlocks, robots or tables."""
    groups: list[dict[str | int, int]] = []
    for number in numbers:
        place = id_at(number) or header_of(number)
        fits = (
            members
            for members in groups
            if place not in members and len(members) < AT_ONCE and not ALONE & {*members.values()}
        )
        group = None if number in ALONE else next(fits, None)
        if group is None:
            groups.append(group := {})
        group[place] = number
    return [list(group.values()) for group in groups]


def every_third(cases: Sequence[Any]) -> list[Any]:
    """The cases, of which `make test` has every third."""
    rest = pytest.mark.long("table")
    return [pytest.param(case, marks=rest if n % 3 else ()) for n, case in enumerate(cases)]


def header_of(number: int) -> int:
    """The line of the header above a line; 0 where there is none."""
    return max((n for n in ALL_HEADERS if n < number), default=0)


def shown(numbers: Sequence[int]) -> str:
    return " ".join(str(number) for number in numbers)


def key_of(number: int) -> str:
    match = KEY.match(LINES[number - 1]) or HEADER.fullmatch(LINES[number - 1])
    assert match is not None
    return match[1]


def one_each(faults_of: FaultsOf, mistakes: Mapping[int, str]) -> dict[int, Fault]:
    """The fault of each line: there is one in each of these lines, and no other."""
    reported = [in_words(fault) for fault in faults_of(with_lines(mistakes))]
    assert sorted(fault.line for fault in reported) == sorted(mistakes), "\n".join(map(str, reported))
    return {fault.line: fault for fault in reported}


@pytest.mark.parametrize("numbers", every_third(apart(KEYS)), ids=shown)
def test_a_value_that_is_of_no_use_is_one_fault(faults_of: FaultsOf, numbers: Sequence[int]) -> None:
    faults = one_each(faults_of, {n: f"{key_of(n)} = 1979-05-27" for n in numbers})
    for number, fault in faults.items():
        own_id = key_of(number) in ("id", "same") and WITH_ID.fullmatch(LINES[number - 2])
        assert fault.id == ("" if own_id else id_at(number)), str(fault)
        assert fault.place.endswith(key_of(number)), str(fault)


OPTIONS: Final = ("value = 1", "value = 2")  # of a select: each may be a table
NO_OPTIONS: Final = [number for number in KEYS if LINES[number - 1] not in OPTIONS]


@pytest.mark.long("table")
@pytest.mark.parametrize("numbers", apart(NO_OPTIONS), ids=shown)
def test_a_table_where_none_belongs_is_one_fault(faults_of: FaultsOf, numbers: Sequence[int]) -> None:
    faults = one_each(faults_of, {n: f"{key_of(n)} = {{ a = 1 }}" for n in numbers})
    for number, fault in faults.items():
        assert fault.place.removesuffix(".a").endswith(key_of(number)), str(fault)


def test_each_header_is_one_of_the_tables_that_a_misspelt_header_may_mean() -> None:
    """Where TOML refuses what comes below a misspelt header."""
    headers = [LINES[number - 1].strip("[]") for number in ALL_HEADERS]
    names = {part for header in headers for part in header.split(".") if part.isidentifier()}
    assert names <= {*HEADER_NAMES}


@pytest.mark.long("table")
@pytest.mark.parametrize("numbers", [*apart(KEYS), *([number] for number in HEADERS)], ids=shown)
def test_a_misspelt_key_or_table_is_one_fault(faults_of: FaultsOf, numbers: Sequence[int]) -> None:
    misspelt = {n: LINES[n - 1].replace(key_of(n), f"{key_of(n)}x", 1) for n in numbers}
    for number, fault in one_each(faults_of, misspelt).items():
        in_message = re.search(r"\.(message|release|request|goal)\.", fault.place)
        name = key_of(number).rpartition(".")[2]
        hint = f'did you mean "{name}"?' if len(name) > 1 else f'is it the "{name}" that is missing?'
        assert ("unknown field" if in_message else hint) in fault.message, str(fault)


# Lines without which something else is wrong than that they are missing.
SHOWS_AT: Final[Mapping[str, str]] = {
    'title = "Robot cell 1"': "",
    'interfaces = ["msgs"]': 'type = "cell_msgs/msg/Jog"',
    'pictures = "msgs"': 'src = "plan.svg"',
    'action = "Switch on the fan"': 'alarms = ["oven"]',
    'group = "Oven"': 'group = ["Oven"]',
    'dialect = "rmw_zenoh"': "domain = 7",
    "overview = true": 'total = "All robots"',
    'ack_command = "tell"': 'ack_input = "note"',
    'role = "reset"': 'colour = "blue"',
    'durability = "volatile"': 'qos = { durability = "volatile" }',
    "save = true": "needs = 'engineer'",
    'topic = "/waypoints"': LINES[LINES.index('topic = "/waypoints"') + 1],  # its qos
}


def shows_at(number: int) -> set[int]:
    """Where it may be said that a line is missing."""
    header = header_of(number)
    if LINES[number - 1].startswith("states = [{"):  # of a source: a lamp lacks them
        return {header, header_of(LINES.index('id = "level_lamp"') + 1)}
    if LINES[number - 1].startswith("counter = [{"):  # a cycle needs parts
        return {header, LINES.index("ideal_cycle_s = 12.0") + 1}
    elsewhere = SHOWS_AT.get(LINES[number - 1])
    if LINES[number - 1].startswith("durability"):  # a topic has one QoS: another place has another
        tables = {n for n, line in enumerate(LINES, 1) if line == "[page.widget.qos]"}
        return {header, LINES.index(elsewhere or "") + 1, *tables}
    return {header} if elsewhere is None else {header, LINES.index(elsewhere) + 1 if elsewhere else 0}


@pytest.mark.long("table")
@pytest.mark.parametrize("numbers", apart(KEYS), ids=shown)
def test_omitted_line_is_at_most_one_fault(faults_of: FaultsOf, numbers: Sequence[int]) -> None:
    left = list(numbers)
    for fault in faults_of(with_lines(dict.fromkeys(numbers, "#"))):
        line = next((n for n in left if in_words(fault).line in shows_at(n)), None)
        assert line is not None, f"{fault}, without the lines {left}"
        left.remove(line)  # those that remain have a default


@pytest.mark.long("table")
@pytest.mark.parametrize("number", HEADERS)
def test_a_header_that_is_left_out_is_one_fault(faults_of: FaultsOf, number: int) -> None:
    the_one(faults_of, with_line(number, "#"))


def changed(old: str, new: str) -> str:
    """The good panel with a part of it replaced, which is there once."""
    assert GOOD.count(old) == 1, old
    return GOOD.replace(old, new)


MISTAKES: Final = tomllib.loads((TESTS / "mistakes.toml").read_text())["mistake"]


@pytest.mark.parametrize("mistake", every_third(MISTAKES), ids=lambda mistake: mistake["new"][:60])
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


def test_invalid_toml_is_one_fault_with_its_line(faults_of: FaultsOf) -> None:
    for old, new, further in (
        ('title = "Robot cell 1"', "title = Robot cell 1", 0),
        ('label = "Speed"', 'label = "Speed', 0),
        ('kind = "slider"', 'kind = "slider"\nkind = "number"', 1),
        ("min = -1.0", "min : -1.0", 0),
    ):
        fault = the_one(faults_of, changed(old, new))
        assert (fault.place, fault.line) == ("", LINES.index(old) + 1 + further)


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
    max_examples=several(15, 200),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
def test_random_damage_is_reported_in_words(
    faults_of: FaultsOf, damages: list[tuple[Any, ...]]
) -> None:
    lines = list(LINES)
    for kind, at, *more in damages:
        match kind, *more:
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

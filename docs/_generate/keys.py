"""The tables of keys in docs/reference/panel-file.md, made from the schema of the panel file."""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from app.panel.base import TEXTS
from app.panel.reference.schema import (
    ANY,
    REF,
    ROOT,
    SAME,
    WIDGET,
    WORDS,
    Schema,
    kinds_of,
    of_kind,
    panel_schema,
    said_at,
)
from app.system.toml_values import key_text

EVERYTHING: Final = Path(__file__).parents[2] / "tests/everything.toml"
EXACT: Final = 2**53  # the limit of every number in a browser: it is described once, not at each key
SHARED: Final = "keys that several tables take"
EVERY_WIDGET: Final = "keys of every widget"
# The table that says what the keys of a class mean, where several tables are of the class.
HOMES: Final = {
    "Condition": "interlock",
    "Numeric": "number",
    "HoldCommand": "hold",
    "PublishCommand": "publish",
    "Axis": "x_axis",
    "AlarmView": "alarm_list",
    "RecoveryStep": "steps",
    "NumberBeside": "target",
}
NOUNS: Final = {"string": "text", "number": "number", "integer": "integer", "object": "table"}
LEAST: Final = (("minimum", "≥"), ("exclusiveMinimum", ">"), ("minLength", "≥"))
MOST: Final = (("maximum", "≤"), ("exclusiveMaximum", "<"), ("maxLength", "≤"))


def key_tables() -> dict[str, str]:
    """The Markdown of each table's keys, by the table's name."""
    schema = panel_schema()
    tables = {ROOT: schema, **schema["definitions"]}
    del tables[WIDGET]
    examples = examples_of(tables)
    rows = {name: _rows(name, table, examples) for name, table in tables.items()}
    kinds = {name: rows[name] for name in kinds_of(tables)}
    shared: dict[str, list[Row]] = {}
    for row in (row for table in rows.values() for row in table if row.section == ANY):
        shared.setdefault(row.key, []).append(row)
    of_widgets = {
        key: _usual(known) if key != "kind" else known[0]._replace(value="kind of widget", example="")
        for key, known in shared.items()
        if all(any(row.key == key for row in table) for table in kinds.values())
    }
    homes = dict.fromkeys(shared, SHARED) | dict.fromkeys(of_widgets, EVERY_WIDGET)

    def lines(name: str) -> str:
        known = of_widgets if name in kinds else {}
        own = (
            row
            for row in rows[name]
            if row.key != "kind" and (row.key not in known or row.said != known[row.key].said)
        )
        return _lines([row.linked(name, homes) for row in own])

    return {
        f"keys {SHARED}": _lines([_usual(shared[key]) for key in sorted({*shared} - {*of_widgets})]),
        f"keys {EVERY_WIDGET}": _lines(list(of_widgets.values())),
        **{f"keys {name}": lines(name) for name in rows},
    }


def _usual(rows: Sequence["Row"]) -> "Row":
    """The row that most tables have."""
    said = [row.said for row in rows]
    return max(rows, key=lambda row: said.count(row.said))


def examples_of(tables: Mapping[str, Schema]) -> dict[str, Any]:
    """A value of every key, by "table.key": those of tests/everything.toml, then those of our own."""
    examples: dict[str, Any] = {}

    def walk(name: str, table: Mapping[str, Any]) -> None:
        for key, value in table.items():
            examples.setdefault(f"{name}.{key}", value)
            inner = value if isinstance(value, list) else [value]
            if _by_name(tables[name]["properties"].get(key, {})):
                inner = list(value.values())
            for field in inner:
                if isinstance(field, dict):
                    kind = of_kind(field.get("kind")) if key == WIDGET else None
                    part = SAME if SAME in field else kind or key
                    walk(part, field) if part in tables else None

    walk(ROOT, tomllib.loads(EVERYTHING.read_text(encoding="utf-8")))
    own: dict[str, Any] = WORDS["examples"]
    grow = {f"{name}.grow": True for name, table in tables.items() if "grow" in table["properties"]}
    source = {
        f"{name}.source": "oven" for name, table in tables.items() if "source" in table["properties"]
    }
    with_label = (name for name, table in tables.items() if "show_label" in table["properties"])
    label = {f"{name}.show_label": False for name in with_label}
    robot = {f"{name}.robot": "r1" for name, table in tables.items() if "robot" in table["properties"]}
    needs = {
        f"{name}.needs": "operator" for name, table in tables.items() if "needs" in table["properties"]
    }
    return needs | grow | label | source | robot | examples | own


class Row(NamedTuple):
    """A key of a table, as its page has it. `section` says what it means."""

    key: str
    value: str
    example: str
    default: str
    meaning: str
    section: str

    @property
    def said(self) -> tuple[str, ...]:
        """What is said of the key, without the example."""
        return self.value, self.default, self.meaning

    def linked(self, table: str, homes: Mapping[str, str]) -> "Row":
        """The row in a table: with a link in place of a meaning that stands elsewhere. `homes` are the
        sections of keys of several tables."""
        home = homes[self.key].replace(" ", "-") if self.section == ANY else HOMES.get(self.section)
        if home in (None, table):
            return self
        return self._replace(key=f"[`{self.key}`](#{home})", example="", meaning="")


def _lines(rows: Sequence[Row]) -> str:
    """The table of rows: the id first, those with a link last."""
    cells = [["Key", "Value", "Default", "What it means"], ["---"] * 4]
    for row in sorted(rows, key=lambda row: (row.key != "id", row.key[0] == "[")):
        key = row.key if row.key[0] == "[" else f"`{row.key}`"
        value = f"{row.value}: {row.example}" if row.example else row.value
        cells.append([key, value, row.default, row.meaning])
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in line).rstrip() + " |" for line in cells
    )


def _rows(name: str, table: Schema, examples: Mapping[str, Any]) -> list[Row]:
    rows = []
    for key, prop in table["properties"].items():
        needed = key in table.get("required", ())
        default = "**required**" if needed else _code(prop["default"]) if "default" in prop else "–"
        example = "" if _is_table(prop) or _is_plain(prop) else _code(examples[f"{name}.{key}"])
        section = said_at(name, key)
        rows.append(Row(key, words(prop), example, default, prop["description"], section))
    return rows


def _is_plain(prop: Schema) -> bool:
    """Whether its values need no example."""
    return "const" in prop or "enum" in prop or prop.get("type") in ("boolean", "integer", "number")


def _is_table(prop: Schema) -> bool:
    """Whether it has a section of its own, with an example."""
    return "$ref" in prop or "$ref" in prop.get("items", {}) or _by_name(prop)


def _by_name(prop: Schema) -> bool:
    """Whether it is a table of tables, by their names."""
    inner = prop.get("additionalProperties")
    return isinstance(inner, dict) and "$ref" in inner


def words(prop: Schema) -> str:
    """What a key takes, with its limits."""
    if "const" in prop:
        return f"`{toml(prop['const'])}`"
    if "enum" in prop:
        return ", ".join(f"`{toml(choice)}`" for choice in prop["enum"])
    if "$ref" in prop:
        return f"[table](#{_anchor(prop['$ref'])})"
    if "anyOf" in prop:
        choices = list(map(words, prop["anyOf"]))
        if choices[1:] == [TEXTS] and choices[0].startswith("text"):
            return choices[0].replace("text", "[texts](#values)", 1)
        return " or ".join(choices)
    if _by_name(prop):
        return f"[tables](#{_anchor(prop['additionalProperties']['$ref'])}), by name"
    match prop.get("type"):
        case None:
            return "any value"
        case "boolean":
            return "boolean"
        case "array" if "$ref" in prop["items"]:
            return f"[list of tables](#{_anchor(prop['items']['$ref'])})"
        case "array":
            return f"list: {words(prop['items'])}"
        case kind:
            noun = prop.get("title", NOUNS[kind])
            return f"{noun} {', '.join(_limits(prop))}".rstrip()


def _anchor(ref: str) -> str:
    return "widgets" if ref == REF + WIDGET else ref.removeprefix(REF)


def _limits(prop: Schema) -> Iterator[str]:
    """The range of a number, or of a text's length."""
    if "minimum" in prop and "maximum" in prop and abs(prop["minimum"]) != EXACT != prop["maximum"]:
        yield f"{toml(prop['minimum'])} … {toml(prop['maximum'])}"
        return
    for name, sign in (*LEAST, *MOST):
        limit = prop.get(name)
        if limit is not None and abs(limit) != EXACT and (name, limit) != ("minLength", 1):
            yield f"{sign} {toml(limit)}"


def _code(value: Any) -> str:
    return f"`{toml(value)}`"


def toml(value: Any) -> str:
    """A value as TOML has it, on one line."""
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            escaped = value.replace("\\", "\\\\").replace('"', '\\"')
            return f'"{escaped}"'
        case list():
            return f"[{', '.join(map(toml, value))}]"
        case dict():
            return (
                f"{{ {', '.join(f'{key_text(key)} = {toml(item)}' for key, item in value.items())} }}"
            )
    return f"{value}"

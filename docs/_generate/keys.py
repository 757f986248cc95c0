"""The tables of keys in docs/reference/panel-file.md, made from the schema of the panel file."""

import tomllib
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from app.panel.base import TEXTS
from app.system.toml_values import key_text
from docs._generate.schema import REF, ROOT, SAME, WIDGET, WORDS, Schema, of_kind, panel_schema

EVERYTHING: Final = Path(__file__).parents[2] / "tests/everything.toml"
EXACT: Final = 2**53  # the limit of every number in a browser: it is described once, not at each key
COMMON: Final = 2  # a key that so many tables describe in the same words is described once
COMMON_KEYS: Final = "common keys"
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
    count = Counter(row.said for table in rows.values() for row in table)
    often = {said[0]: said for said, number in reversed(count.most_common()) if number >= COMMON}
    common = {*often.values()}  # of each key what most tables say
    first = {row.said: row for table in reversed(rows.values()) for row in table if row.said in common}
    return {
        f"keys {COMMON_KEYS}": _lines(sorted(first.values(), key=lambda row: row.key)),
        **{f"keys {name}": _with_common(table, common) for name, table in rows.items()},
    }


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
                    part = SAME if SAME in field else of_kind(field.get("kind")) or key
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
    """A key of a table, as its page has it."""

    key: str
    value: str
    default: str
    example: str
    meaning: str

    @property
    def said(self) -> tuple[str, ...]:
        """What is said of the key, without the example."""
        return self.key, self.value, self.default, self.meaning


def _with_common(rows: Sequence[Row], common: Collection[tuple[str, ...]]) -> str:
    """The table's own keys, then the names of those that are described once for all."""
    names = [f"`{row.key}`" for row in rows if row.said in common]
    own = [row for row in rows if row.said not in common]
    parts = [_lines(own)] if own else []
    if names:
        parts.append(f"[Common keys](#common-keys): {', '.join(names)}.")
    return "\n\n".join(parts)


def _lines(rows: Sequence[Row]) -> str:
    cells = [["Key", "Value", "Default", "Example", "What it means"], ["---"] * 5]
    cells += [[f"`{row.key}`", *row[1:]] for row in rows]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in cells
    )


def _rows(name: str, table: Schema, examples: Mapping[str, Any]) -> list[Row]:
    rows = []
    for key, prop in sorted(table["properties"].items(), key=lambda row: row[0] != "id"):
        needed = key in table.get("required", ())
        default = "**required**" if needed else _code(prop["default"]) if "default" in prop else "–"
        example = "–" if _is_table(prop) else _code(examples[f"{name}.{key}"])
        rows.append(Row(key, words(prop), default, example, prop["description"]))
    return rows


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

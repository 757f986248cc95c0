"""The tables of keys in docs/reference/panel-file.md, made from the schema of the panel file."""

import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from docs._generate.schema import REF, ROOT, SAME, WIDGET, WORDS, Schema, of_kind, panel_schema

EVERYTHING: Final = Path(__file__).parents[2] / "tests/everything.toml"
EXACT: Final = 2**53  # the limit of every number in a browser: it is described once, not at each key
NOUNS: Final = {"string": "text", "number": "number", "integer": "whole number", "object": "table"}
LIMITS: Final = {
    "minimum": "{} or more",
    "exclusiveMinimum": "more than {}",
    "maximum": "{} or less",
    "exclusiveMaximum": "less than {}",
    "minLength": "{} or more characters",
    "maxLength": "{} characters or less",
}


def key_tables() -> dict[str, str]:
    """The Markdown of each table's keys, by the table's name."""
    schema = panel_schema()
    tables = {ROOT: schema, **schema["definitions"]}
    del tables[WIDGET]
    examples = examples_of(tables)
    return {f"keys {name}": _table(name, table, examples) for name, table in tables.items()}


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


def _table(name: str, table: Schema, examples: Mapping[str, Any]) -> str:
    lines = [["Key", "Value", "Default", "Example", "What it means"], ["---"] * 5]
    for key, prop in sorted(table["properties"].items(), key=lambda row: row[0] != "id"):
        needed = key in table.get("required", ())
        default = "**required**" if needed else _code(prop["default"]) if "default" in prop else "–"
        example = "–" if _is_table(prop) else _code(examples[f"{name}.{key}"])
        lines.append([f"`{key}`", words(prop), default, example, prop["description"]])
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines
    )


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
        return " or ".join(map(words, prop["anyOf"]))
    if _by_name(prop):
        return f"[tables](#{_anchor(prop['additionalProperties']['$ref'])}), by name"
    match prop.get("type"):
        case None:
            return "any value"
        case "boolean":
            return "`true` or `false`"
        case "array" if "$ref" in prop["items"]:
            return f"[list of tables](#{_anchor(prop['items']['$ref'])})"
        case "array":
            return f"list: {words(prop['items'])}"
        case kind:
            noun = prop.get("title", NOUNS[kind])
            return ", ".join([noun, *_limits(prop)])


def _anchor(ref: str) -> str:
    return "widgets" if ref == REF + WIDGET else ref.removeprefix(REF)


def _limits(prop: Schema) -> Iterator[str]:
    for limit, words in LIMITS.items():
        value = prop.get(limit)
        if value is not None and abs(value) != EXACT and (limit, value) != ("minLength", 1):
            yield words.format(toml(value))


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
            return f"{{ {', '.join(f'{key} = {toml(item)}' for key, item in value.items())} }}"
    return f"{value}"

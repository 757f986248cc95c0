"""The JSON Schema of a panel file, made from its models, with the descriptions of panel_keys.toml.

It is for editors: it finds what is wrong with one key. What other keys or the robot's types tell,
`python -m app.check` finds.
"""

import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, Final, get_args

from pydantic import BaseModel

from app.panel import Panel
from app.panel.file.load import NOT_WRITTEN
from app.panel.file.same_widgets import SameWidget
from app.panel.keys import PanelKeys
from app.panel.widgets.families import PublishCommand
from app.panel.widgets.kinds import KINDS
from app.panel.widgets.trend import DURATION
from app.ros.messages.names import ACTION_TYPE, MESSAGE_TYPE, SERVICE_TYPE, TOPIC

Schema = dict[str, Any]

WORDS: Final[Mapping[str, Any]] = tomllib.loads(
    Path(__file__).with_name("panel_keys.toml").read_text(encoding="utf-8")
)
ROOT: Final = "panel"
WIDGET: Final = "widget"
REF: Final = "#/definitions/"
SOURCE: Final = "source"
SAME: Final = "same"
ANY: Final = "any"  # what a key means in each table
PUBLISHED: Final = [kind for kind, row in KINDS.items() if issubclass(row.model, PublishCommand)]

# What a text is, by "table.key" or "key" alone, and its pattern where the name alone decides.
FORMATS: Final[Mapping[str, tuple[str, str]]] = {
    "id": ("id", ""),
    "topic": ("topic name", TOPIC.pattern),
    "topics": ("topic name", TOPIC.pattern),
    "service": ("service name", TOPIC.pattern),
    "action.action": ("action name", TOPIC.pattern),
    "node": ("node name", TOPIC.pattern),
    "type": ("message type", MESSAGE_TYPE.pattern),
    "switch.type": ("message or service type", ""),
    "options_from.type": ("message or service type", ""),
    "recipe.type": ("message or service type", ""),
    "recipe.fields": ("id of an input", ""),
    "call.type": ("service type", SERVICE_TYPE.pattern),
    "action.type": ("action type", ACTION_TYPE.pattern),
    "parameter.type": ("", ""),
    "log_widget.node": ("", ""),
    "namespace": ("namespace", ""),
    "connect": ("Zenoh endpoint", ""),
    "interfaces": ("folder", ""),
    "screens": ("width x height", ""),
    "icon": ("name of an icon", ""),
    "window": ("duration", DURATION),
    "windows": ("duration", DURATION),
    "keep": ("duration", DURATION),
    "template": ("file", ""),
    "styles": ("file", ""),
    "field": ("field path", ""),
    "list.code": ("field path", ""),
    "list.text": ("field path", ""),
    "list.level": ("field path", ""),
    "list.active": ("field path", ""),
    "catalogue": ("file", ""),
    "zone_file.file": ("file", ""),
    "routes.file": ("file", ""),
    "inhibits": ("id of a control", ""),
    "robot": ("id of a robot", ""),
    "panel.robot": ("", ""),
    "panel.texts": ("table of texts by code or text of the robot", ""),
    "same": ("id of a widget", ""),
    "diagnostics": ("pattern of names", ""),
    "success": ("field path", ""),
    "call.message": ("field path", ""),
    "progress": ("field path", ""),
    "deadline_field": ("field path", ""),
    "counter_field": ("field path", ""),
}


def panel_schema() -> Schema:
    """The whole schema, as draft 7 has it: that is what the editors' plugins know."""
    root = Panel.model_json_schema(ref_template=REF + "{model}")
    definitions = root.pop("$defs")
    for key in NOT_WRITTEN:
        root["properties"].pop(key, None)
    tables = named_tables(root, definitions)
    for name, table in tables.items():
        _with_source(name, table)
        _finish(name, table)
    by_name = {name: table for name, table in tables.items() if name != ROOT}
    models = {id(table): name for name, table in by_name.items()}
    names = {REF + model: REF + models[id(table)] for model, table in definitions.items()}
    kinds = kinds_of(tables)
    for owner in ("page", "group", "frame"):
        by_name[owner]["properties"]["widget"]["items"] = {"$ref": REF + WIDGET}
    by_name[SAME] = SameWidget.model_json_schema()
    _finish(SAME, by_name[SAME])
    by_name[WIDGET] = _widget(kinds, by_name[SAME])
    whole = {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "A panel file",
        **tables[ROOT],
    }
    renamed: Schema = _renamed(whole | {"definitions": dict(sorted(by_name.items()))}, names)
    return renamed


def named_tables(root: Schema, definitions: Mapping[str, Schema]) -> dict[str, Schema]:
    """The tables by the names that the file gives them: a widget's is its kind."""
    known = {ROOT: root}

    def walk(table: Schema) -> None:
        for key, prop in table["properties"].items():
            for ref in _refs(prop):
                inner = definitions[ref.removeprefix(REF)]
                name = of_kind(inner["properties"].get("kind", {}).get("const")) or key
                if name not in known:
                    known[name] = inner
                    walk(inner)
                elif known[name] is not inner:
                    raise ValueError(f'two tables that differ are called "{name}"')

    walk(root)
    return known


def of_kind(kind: str | None) -> str | None:
    """The name of a widget's table: its kind, unless another table has that name."""
    return f"{kind}_{WIDGET}" if kind in ("log", "conditions", "place") else kind


def kinds_of(tables: Mapping[str, Schema]) -> dict[str, Schema]:
    return {name: table for name, table in tables.items() if "const" in _kind(table)}


def _kind(table: Schema) -> Schema:
    kind: Schema = table["properties"].get("kind", {})
    return kind


def _refs(node: Any) -> Iterator[str]:
    if isinstance(node, Mapping):
        if "$ref" in node:
            yield node["$ref"]
        for key, value in node.items():
            if key != "discriminator":
                yield from _refs(value)
    elif isinstance(node, list):
        for value in node:
            yield from _refs(value)


def _with_source(name: str, table: Schema) -> None:
    """A table that reads a topic may name a source in place of the topic and its type."""
    properties = table["properties"]
    if name in (SOURCE, "recipe", *PUBLISHED) or not {"topic", "type"} <= {*properties}:
        return
    properties[SOURCE] = {"type": "string", "title": "id of a source"}
    needed = [key for key in table.get("required", ()) if key in ("topic", "type", "states")]
    if needed:
        table["required"] = [key for key in table["required"] if key not in needed]
        table["anyOf"] = [{"required": [SOURCE]}, {"required": needed}]


def _finish(name: str, table: Schema) -> None:
    """Descriptions, names of formats, and no more than an editor needs."""
    properties = table["properties"]
    table["title"], table["description"] = name, WORDS["tables"][name]
    for key, prop in properties.items():
        properties[key] = {**_plain(name, key, prop), "description": about(name, key)}


def about(table: str, key: str) -> str:
    """What a key means; KeyError if panel_keys.toml does not say it."""
    return str(WORDS[said_at(table, key)][key])


def said_at(table: str, key: str) -> str:
    """The section that says it: of the table itself, else of a class that its model is of, else of all
    tables."""
    model = models().get(table)
    classes = (each.__name__ for each in model.__mro__) if model else ()
    for section in (table, *classes, ANY):
        if key in WORDS.get(section, {}):
            return str(section)
    raise KeyError(f'app/panel/reference/panel_keys.toml does not say what "{key}" of "{table}" means')


@cache
def models() -> dict[str, type[BaseModel]]:
    """The classes of the tables, by the names that the file gives them."""
    known: dict[str, type[BaseModel]] = {ROOT: PanelKeys}

    def walk(model: type[BaseModel]) -> None:
        for key, field in model.model_fields.items():
            for inner in () if field.exclude else _models_in(field.annotation):
                kind = inner.model_fields.get("kind")
                kinds = get_args(kind.annotation) if kind else ()
                name = of_kind(kinds[0] if len(kinds) == 1 else None) or field.alias or key
                if name not in known:
                    known[name] = inner
                    walk(inner)

    walk(PanelKeys)
    return known | {SAME: SameWidget}


def tables_of(section: str) -> list[str]:
    """The tables that a section of panel_keys.toml is about: itself, or those of its class."""
    classes = {name: [each.__name__ for each in model.__mro__] for name, model in models().items()}
    return [section, *(name for name, names in classes.items() if section in names)]


def _models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for inner in get_args(annotation):
        yield from _models_in(inner)


def _plain(table: str, key: str, prop: Schema) -> Schema:
    """Without null, which TOML does not have, and without titles that repeat the key."""
    made = {name: value for name, value in prop.items() if name != "title"}
    one_of = [option for option in made.pop("anyOf", []) if option != {"type": "null"}]
    if {"type": "integer"} in one_of and {"type": "number"} in one_of:
        one_of.remove({"type": "integer"})
    made |= one_of[0] if len(one_of) == 1 else {"anyOf": one_of} if one_of else {}
    if made.get("default") is None or made["default"] == [] or isinstance(made["default"], dict):
        made.pop("default", None)
    if table != ROOT and key == "interlock":
        return _one_or_more({"type": "string", "title": "id of an interlock"})
    title, pattern = FORMATS.get(f"{table}.{key}", FORMATS.get(key, ("", "")))
    text = made["items"] if made.get("type") == "array" else made
    text.pop("format", None)  # of a folder, which must be there
    if title:
        text["title"] = title
    if pattern:
        text["pattern"] = f"^{pattern}$"
    if (table, key) in (("select", "options"), ("indicator", "states"), ("trend", "pen")):
        made["minItems"] = 1
    return made


def _one_or_more(schema: Schema) -> Schema:
    several = {"type": "array", "items": schema, "minItems": 1, "uniqueItems": True}
    return {"anyOf": [schema, several]}


def _widget(kinds: Mapping[str, Schema], same: Schema) -> Schema:
    """One kind's table, chosen by `kind`, or that of a widget of another page. The keys of all kinds
    stand beside that: editors complete what is a property, but do not look into conditions."""
    keys: dict[str, list[Schema]] = {}
    for table in kinds.values():
        for key, prop in table["properties"].items():
            known = keys.setdefault(key, [])
            if _bare(prop) not in map(_bare, known):
                known.append(prop)
    properties = {key: _any_of(props) for key, props in keys.items()}
    said = {name: table["properties"]["kind"]["const"] for name, table in kinds.items()}
    properties["kind"] = {"enum": list(said.values()), "description": about(WIDGET, "kind")}
    properties[SAME] = same["properties"][SAME]
    chosen = [
        {
            "if": {"properties": {"kind": {"const": kind}}, "required": ["kind"]},
            "then": {"$ref": REF + name},
        }
        for name, kind in said.items()
    ]
    chosen.append({"if": {"required": [SAME]}, "then": {"$ref": REF + SAME}})
    return {
        "title": WIDGET,
        "description": WORDS["tables"][WIDGET],
        "type": "object",
        "properties": properties,
        "oneOf": [{"required": ["id", "kind", "label"]}, {"required": [SAME]}],
        "allOf": chosen,
    }


def _bare(prop: Schema) -> Schema:
    return {key: value for key, value in prop.items() if key not in ("description", "default")}


def _any_of(props: list[Schema]) -> Schema:
    """A key of several kinds: the conditions say which it is."""
    texts = list(dict.fromkeys(prop["description"] for prop in props))
    bare = [_bare(prop) for prop in props]
    return {"description": "\n\n".join(texts), **(bare[0] if len(bare) == 1 else {"anyOf": bare})}


def _renamed(node: Any, names: Mapping[str, str]) -> Any:
    if isinstance(node, list):
        return [_renamed(value, names) for value in node]
    if not isinstance(node, dict):
        return node
    return {key: names.get(v, v) if key == "$ref" else _renamed(v, names) for key, v in node.items()}

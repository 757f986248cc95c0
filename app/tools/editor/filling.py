"""What is written along with the name and the type of a topic, service or action that a form got: the
whole name of the type, and the keys that its widget needs, as `operator-panel scaffold` writes them.
Pure."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any, Final

from app.panel.file.toml_lines import Path
from app.ros.graph.model import EndpointQos, Server, SurveyedTopic, TopicEndpoint
from app.ros.messages import Interfaces
from app.tools.editor.document import Edit, SetValue
from app.tools.editor.forms import NoTableError, schema, table_at, types_of, value_at
from app.tools.editor.suggestions import Item, suggestions_for

NAMES: Final = ("topic", "service", "action")  # the keys beside `type` that say what has the type
FILLED: Final = ("states", "message", "request", "goal")
USUAL: Final = ("std_msgs/", "std_srvs/")  # of types with the same name, these are meant


def filled(
    edits: Iterable[Edit], tables: Mapping[str, Any], interfaces: Interfaces | None
) -> list[Edit]:
    """The edits of one step with a short name of a type made whole ("Bool"), and at their end those
    which fill in the states of a lamp and what a button sends, where the table has none and its type
    has just become known."""
    if interfaces is None:
        return [*edits]
    whole = [_whole(edit, tables, interfaces) for edit in edits]
    named = {edit.path[:-1] for edit in whole if _names(edit)}
    return [*whole, *(more for path in named for more in _keys(path, whole, tables, interfaces))]


def _names(edit: Edit) -> bool:
    return isinstance(edit, SetValue) and edit.path[-1:] in {("type",), *((key,) for key in NAMES)}


def _whole(edit: Edit, tables: Mapping[str, Any], interfaces: Interfaces) -> Edit:
    """An edit that sets a type, with the only type of this name, as "std_msgs/msg/Bool" for "Bool" or
    "std_msgs/Bool"."""
    if not isinstance(edit, SetValue) or edit.path[-1:] != ("type",):
        return edit
    try:
        known = schema()[table_at(tables, edit.path[:-1])]["properties"].get("type", {})
    except NoTableError:
        return edit
    types = [*types_of(interfaces, str(known.get("title", "")))]
    package, _, name = str(edit.value).strip().rpartition("/")
    if not name or str(edit.value) in types:
        return edit
    alike = [each for each in types if each.endswith(f"/{name}") and each.startswith(package)]
    alike = [each for each in alike if each.startswith(USUAL)] or alike
    return replace(edit, value=alike[0]) if len(alike) == 1 else edit


def _keys(
    path: Path, edits: Iterable[Edit], tables: Mapping[str, Any], interfaces: Interfaces
) -> Iterator[Edit]:
    there = value_at(tables, path)
    if not isinstance(there, dict) or "widget" not in path[-2:]:
        return
    own = [edit for edit in edits if edit.path[:-1] == path]
    table = {**there, **{edit.path[-1]: edit.value for edit in own if isinstance(edit, SetValue)}}
    known = schema()[table_at(tables, path)]["properties"]
    missing = [key for key in FILLED if key in known and key not in table]
    item = _item(table) if missing and "source" not in table else None
    if item is None:
        return
    for choice in suggestions_for(item, interfaces).choices:
        suggested = choice.table
        is_same = suggested.get("field", "data") == table.get("field", "data")
        if choice.where == "widget" and choice.kind == table.get("kind") and is_same:
            yield from (SetValue((*path, key), suggested[key]) for key in missing if key in suggested)
            return


def _item(table: Mapping[str, Any]) -> Item | None:
    """What a widget shows or acts on, as the robot's list would have it; None if its name or its type
    is missing."""
    key = next((key for key in NAMES if isinstance(table.get(key), str)), "")
    type_name = table.get("type")
    if not key or not isinstance(type_name, str) or "/" not in type_name:
        return None
    name = table[key]
    if key != "topic":
        return Server(name=name, key=name.strip("/"), type=type_name)
    end = (TopicEndpoint(type=type_name, qos=EndpointQos(reliable=True)),)
    return SurveyedTopic(name=name, key=name.strip("/"), publishers=end, subscribers=end)

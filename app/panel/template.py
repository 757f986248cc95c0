"""Message templates, such as `{ data = "{message}" }`: filled with the values of inputs, and
`"{now}"`."""

import re
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache
from string import Formatter
from typing import Any, Final

from app.panel.values import negated
from app.panel.widgets.families import Command
from app.system.errors import FieldError

NOW: Final = "now"  # reserved: the time of sending, of the type TIME
TIME: Final = "builtin_interfaces/msg/Time"
NS_PER_S: Final = 10**9
WITH_PART: Final = 2  # names of a placeholder: the input and its part


def add_now(values: Mapping[str, Any], now_ns: int | None = None) -> dict[str, Any]:
    """The values of inputs with a time as `{now}`, in nanoseconds; by default the panel's clock."""
    seconds, rest = divmod(time.time_ns() if now_ns is None else now_ns, NS_PER_S)
    return {**values, NOW: {"sec": seconds, "nanosec": rest}}


def uses_now(template: Any) -> bool:
    """Whether a template contains `{now}`."""
    return any(name == NOW for _, name in placeholders(template))


def fill_to_send(template: Any, values: Mapping[str, Any], now_ns: Callable[[], int]) -> Any:
    """The template filled with the values of inputs, and `{now}` by a clock, which is read only for
    it."""
    return fill(template, add_now(values, now_ns()) if uses_now(template) else values)


def fill(template: Any, inputs: Mapping[str, Any], where: str = "") -> Any:
    """The template with each `{id}` replaced by that input's value.

    A string that is nothing but `{id}` becomes the value itself, with its type, and `-{id}` its
    negative in a field of numbers; `{{` and `}}` stand for braces. Values are put in once: braces in
    them are only text.
    """
    if isinstance(template, Mapping):
        return {k: fill(v, inputs, f"{where}.{k}".strip(".")) for k, v in template.items()}
    if isinstance(template, list | tuple):
        return [fill(item, inputs, f"{where}[{i}]") for i, item in enumerate(template)]
    if not isinstance(template, str):
        return template
    parts = _parse_text(template, where)
    if len(parts) == 1 and parts[0][0] == "" and parts[0][1] is not None:
        return _value(inputs, parts[0][1])
    if len(parts) == 1 and parts[0][0] == "-" and parts[0][1] is not None:
        value = _value(inputs, parts[0][1])
        if isinstance(value, int | float) and not isinstance(value, bool):
            return negated(value)
    return "".join(
        text + ("" if name is None else _text(_value(inputs, name), where)) for text, name in parts
    )


def _value(inputs: Mapping[str, Any], name: str) -> Any:
    """The value of an input, or of its part: `{goal.x}`."""
    input_id, _, part = name.partition(".")
    return inputs[name] if name in inputs or not part else inputs[input_id][part]


def input_of(name: str) -> str:
    """The id of the input of a placeholder's name: "goal" of "goal.x"."""
    return name.partition(".")[0]


def set_field(fields: Any, path: str, value: Any) -> Any:
    """A copy of a message's fields with a value at a path such as "header.seq" or "data[2]". FieldError
    if a list in the path is too short."""
    return _set_at(fields, re.findall(r"[^.\[\]]+|\[[0-9]+\]", path), path, value)


def _set_at(fields: Any, steps: list[str], path: str, value: Any) -> Any:
    if not steps:
        return value
    step, rest = steps[0], steps[1:]
    if not step.startswith("["):
        known = dict(fields) if isinstance(fields, Mapping) else {}
        return known | {step: _set_at(known.get(step, {}), rest, path, value)}
    index, known_items = int(step[1:-1]), list(fields) if isinstance(fields, list | tuple) else []
    if index >= len(known_items):
        raise FieldError(path, f"there is no {step}: the message has {len(known_items)} elements")
    known_items[index] = _set_at(known_items[index], rest, path, value)
    return known_items


def value_at(template: Any, where: str) -> Any:
    """The value in a template at a field such as "poses[0].x", or at the nearest one around it."""
    inner = template
    for name, index in re.findall(r"([^.\[\]]+)|\[([0-9]+)\]", where):
        if isinstance(inner, Mapping) and name in inner:
            inner = inner[name]
        elif isinstance(inner, list) and index and int(index) < len(inner):
            inner = inner[int(index)]
        else:
            break
    return inner


def _text(value: Any, where: str) -> str:
    """A value within a text, as TOML writes it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str | int | float):
        return str(value)
    raise FieldError(where, "a list or a table can't stand in a text: write the input's id alone")


def placeholders(template: Any, where: str = "") -> Iterator[tuple[str, str]]:
    """(place, name) of each placeholder, the id of an input or `id.part`; FieldError for unmatched
    braces."""
    if isinstance(template, Mapping):
        for key, value in template.items():
            yield from placeholders(value, f"{where}.{key}".strip("."))
    elif isinstance(template, list | tuple):
        for i, item in enumerate(template):
            yield from placeholders(item, f"{where}[{i}]")
    elif isinstance(template, str):
        yield from ((where, name) for _, name in _parse_text(template, where) if name is not None)


def input_ids(widget: Command) -> list[str]:
    """The ids of the inputs that a command needs."""
    return placeholder_ids(widget.templates())


def needed_inputs(widget: Command, inputs: Mapping[str, Any]) -> dict[str, Any]:
    """The inputs of a press or a hold that the widget needs."""
    return {name: inputs[name] for name in input_ids(widget) if name in inputs}


def placeholder_ids(templates: Iterable[Any]) -> list[str]:
    """The ids of the inputs in templates, each once."""
    every = (input_of(name) for template in templates for _, name in placeholders(template))
    return [name for name in dict.fromkeys(every) if name != NOW]


@lru_cache(1000)
def _parse_text(text: str, where: str) -> tuple[tuple[str, str | None], ...]:
    """((literal text, input id after it or None), …)"""
    try:
        parsed = list(Formatter().parse(text))
    except ValueError:
        why = "a brace has no partner; write {{ and }} for braces"
        raise FieldError(where, f'"{text}": {why}') from None
    for _, name, format_spec, conversion in parsed:
        if name is not None and (not _is_name(name) or format_spec or conversion):
            raise FieldError(where, f'"{text}": between braces stands the id of an input, alone')
    return tuple((literal, name) for literal, name, _, _ in parsed)


def _is_name(name: str) -> bool:
    """Whether it is an id, or an id and the name of a part."""
    parts = name.split(".")
    return len(parts) <= WITH_PART and all(part.isidentifier() for part in parts)

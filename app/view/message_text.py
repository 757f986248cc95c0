"""Decoded messages as text: YAML as `ros2 topic echo` writes it, CSV, JSON. Pure."""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, is_dataclass
from typing import Any, Final

from app.interfaces.json_values import message_fields
from app.printable import printable

CUT: Final = "..."
_PLAIN: Final = re.compile(r"(?!\.[0-9.])[A-Za-z_/.][\w/.\- ]*(?<! )", re.ASCII)
_WORDS: Final = frozenset(("true", "false", "yes", "no", "on", "off", "null", "y", "n", ".nan", ".inf"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """How much of a message is written: `most` elements of a list and characters of a text (None: all);
    lists, or texts, left out. `counted`: what is cut is counted, which ROS 2's command does not."""

    most: int | None = 128
    lists: bool = True
    texts: bool = True
    counted: bool = False

    def cut(self, length: int) -> str:
        """Stands for the rest of a list or text of this length."""
        return f"{CUT} {length - (self.most or 0)} more" if self.counted else CUT


def yaml_text(value: Any, shape: Shape) -> str:
    """A message, or any value in one, as YAML, without a line break at its end."""
    return "\n".join(_lines(value, shape, ""))


def _lines(value: Any, shape: Shape, indent: str) -> Iterator[str]:
    if is_dataclass(value):
        fields = list(message_fields(value))
        for name, field in fields:
            yield from _entry(f"{indent}{name}:", field, shape, indent)
        if not fields:
            yield f"{indent}{{}}"
    elif _is_list(value):
        yield from _elements(value, shape, indent)
    else:
        yield f"{indent}{_scalar(value, shape)}"


def _entry(head: str, value: Any, shape: Shape, indent: str) -> Iterator[str]:
    if is_dataclass(value) and list(message_fields(value)):
        yield head
        yield from _lines(value, shape, f"{indent}  ")
    elif _is_list(value) and shape.lists and len(value):
        yield head
        yield from _elements(value, shape, indent)
    else:
        yield f"{head} {_one_line(value, shape)}"


def _elements(value: Any, shape: Shape, indent: str) -> Iterator[str]:
    """Each element behind a "-"; that of a message in the lines below it, further in."""
    if not shape.lists or not len(value):
        yield f"{indent}{_one_line(value, shape)}"
        return
    for element in value[: shape.most]:
        first, *rest = _lines(element, shape, f"{indent}  ")
        yield f"{indent}- {first[len(indent) + 2 :]}"
        yield from rest
    if shape.most is not None and len(value) > shape.most:
        yield f"{indent}- '{shape.cut(len(value))}'"


def _one_line(value: Any, shape: Shape) -> str:
    if _is_list(value):
        return "[]" if not len(value) else f"'<{len(value)} elements>'"
    return "{}" if is_dataclass(value) else _scalar(value, shape)


def _is_list(value: Any) -> bool:
    return isinstance(value, list | tuple | bytes | bytearray | memoryview)


def _scalar(value: Any, shape: Shape) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return _float(repr(value))
    if not isinstance(value, str):
        return str(value)
    text = _text(value, shape)
    if _PLAIN.fullmatch(text) and text.lower() not in _WORDS:
        return text
    return printable(json.dumps(text, ensure_ascii=False)) if text else "''"


def _float(text: str) -> str:
    """As YAML 1.1 has it: with a point, else "1e-05" is a text."""
    if "e" in text and "." not in text:
        return text.replace("e", ".0e")
    return {"nan": ".nan", "inf": ".inf", "-inf": "-.inf"}.get(text, text)


def _text(value: str, shape: Shape) -> str:
    if not shape.texts:
        return f"<{len(value)} characters>"
    cut = shape.most is not None and len(value) > shape.most
    return value[: shape.most] + shape.cut(len(value)) if cut else value


def csv_line(value: Any, shape: Shape) -> str:
    """All values of a message in the order of their definition (RFC 4180), with no header, as
    `ros2 topic echo --csv` writes them: lists have any length, and an empty one has an empty cell."""
    return ",".join(map(_csv_cell, _scalars(value, shape)))


def _scalars(value: Any, shape: Shape) -> Iterator[Any]:
    if is_dataclass(value):
        for _, field in message_fields(value):
            yield from _scalars(field, shape)
    elif not _is_list(value):
        yield _text(value, shape) if isinstance(value, str) else value
    elif not shape.lists or not len(value):
        yield f"<{len(value)} elements>" if len(value) else ""
    else:
        for element in value[: shape.most]:
            yield from _scalars(element, shape)
        if shape.most is not None and len(value) > shape.most:
            yield CUT


def _csv_cell(value: Any) -> str:
    if isinstance(value, bool):
        return str(value)  # True and False, as ros2 writes them
    text = printable(str(value))
    return '"' + text.replace('"', '""') + '"' if re.search(r'[",\r\n]', text) else text

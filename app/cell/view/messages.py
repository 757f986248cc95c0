"""Messages as text: YAML as `ros2 topic echo` writes it, CSV, JSON; undecoded ones in hexadecimal.
Pure."""

import json
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass, is_dataclass
from typing import Any, Final

from app.cell.robot.definitions import differs
from app.ros.messages import Interfaces
from app.ros.messages.json_values import message_fields
from app.system.errors import DecodeError, InterfaceError
from app.system.printable import printable, readable
from app.system.texts import TextLike, say

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


# One message of any topic as text: decoded if its definition is known, and hexadecimal. Bounded: what
# is cut is counted. Pure.

MOST_LINES: Final = 100
MOST_LINE: Final = 300  # characters
MOST_BYTES: Final = 512  # in hexadecimal
DECODED_MOST: Final = 1_000_000  # bytes of a message
SHAPE: Final = Shape(most=24, counted=True)
HEX_LINE: Final = 16  # bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class MessageLook:
    """A message of `size` bytes: its fields as `lines`, without the last `cut_lines`; none if it is not
    decoded, for `reason`. `hex_lines` are its bytes without the last `cut_bytes`."""

    size: int
    lines: tuple[str, ...] = ()
    cut_lines: int = 0
    reason: TextLike = ""
    hex_lines: tuple[str, ...] = ()
    cut_bytes: int = 0


def message_look(
    interfaces: Interfaces, types: Collection[str], hashes: Collection[str], data: bytes
) -> MessageLook:
    """`types` and `hashes` are those of the topic's publishers."""
    lines, reason = _decoded(interfaces, types, hashes, data)
    return MessageLook(
        size=len(data),
        lines=tuple(map(_shortened, lines[:MOST_LINES])),
        cut_lines=max(len(lines) - MOST_LINES, 0),
        reason=reason,
        hex_lines=hex_lines(data[:MOST_BYTES]),
        cut_bytes=max(len(data) - MOST_BYTES, 0),
    )


def _decoded(
    interfaces: Interfaces, types: Collection[str], hashes: Collection[str], data: bytes
) -> tuple[list[str], TextLike]:
    """The lines, or why there are none."""
    if len(types) != 1:
        return [], say("look_types", types=tuple(types)) if types else say("look_no_type")
    (type_name,) = types
    if len(data) > DECODED_MOST:
        return [], say("look_large", size=len(data), most=DECODED_MOST)
    try:
        interfaces.require(type_name)
        own = interfaces.type_hash(type_name)
        if hashes and all(differs(theirs, own) for theirs in hashes):
            return [], say("look_differs", type=type_name)
        text = yaml_text(interfaces.decode(type_name, data), SHAPE)
    except InterfaceError as error:
        return [], say("look_unknown", why=str(error))
    except DecodeError as error:
        return [], say("look_undecodable", why=str(error))
    return readable(text).split("\n"), ""


def _shortened(line: str) -> str:
    return line if len(line) <= MOST_LINE else f"{line[:MOST_LINE]}… {len(line) - MOST_LINE} more"


def hex_lines(data: bytes) -> tuple[str, ...]:
    """Offset, bytes, and what of them is ASCII, 16 bytes a line."""
    return tuple(
        _hex_line(start, data[start : start + HEX_LINE]) for start in range(0, len(data), HEX_LINE)
    )


def _hex_line(start: int, data: bytes) -> str:
    text = "".join(chr(byte) if 32 <= byte < 127 else "." for byte in data)
    return f"{start:04x}  {data.hex(' '):<{3 * HEX_LINE - 1}}  {text}"

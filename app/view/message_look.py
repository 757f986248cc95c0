"""One message of any topic as text: decoded if its definition is known, and hexadecimal. Bounded: what
is cut is counted. Pure."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

from app.errors import DecodeError, InterfaceError
from app.i18n import TextLike, say
from app.interfaces import Interfaces
from app.printable import readable
from app.robot.definitions import differs
from app.view.message_text import Shape, yaml_text

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

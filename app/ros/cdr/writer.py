"""Encodes checked values as little-endian CDR. A writer is compiled once for each structure."""

from collections.abc import Callable, Sequence
from struct import Struct, pack, unpack
from typing import Any, Final

from app.ros.cdr.reader import FORMATS, HEADER_BYTES, LENGTH_BYTES, SIZES, group_runs, is_number
from app.ros.messages.definitions import Field, Type

Write = Callable[[bytearray, Any], None]  # (output, value to append)

_COUNT: Final = Struct("<I")


def message_writer(fields: Sequence[Field], nested: Callable[[str], Write]) -> Write:
    """The writer of a message object; `nested` returns the writer of a structure by name."""
    steps = [_field_step(run, nested) for run in group_runs(fields)]

    def write(out: bytearray, message: Any) -> None:
        for step in steps:
            step(out, message)

    return write


def _field_step(run: Sequence[Field], nested: Callable[[str], Write]) -> Write:
    kind, names = run[0].type, [step.attribute for step in run]
    if is_number(kind) and kind.container == "one":
        return _numbers_writer([step.type for step in run], names)
    write, name = _field_writer(kind, nested), names[0]
    return lambda out, message: write(out, getattr(message, name))


def _numbers_writer(kinds: Sequence[Type], names: Sequence[str]) -> Write:
    size = SIZES[kinds[0].name]
    form = Struct("<" + "".join(FORMATS[kind.name] for kind in kinds))

    def numbers(out: bytearray, message: Any) -> None:
        _align(out, size)
        out += form.pack(*[getattr(message, name) for name in names])

    return numbers


def _field_writer(kind: Type, nested: Callable[[str], Write]) -> Write:
    if is_number(kind):
        return _number_list_writer(kind)
    write_element = (
        nested(kind.name)
        if kind.is_nested
        else _write_string
        if kind.name == "string"
        else _write_wstring
    )
    return write_element if kind.container == "one" else _sequence_writer(kind, write_element)


def _sequence_writer(kind: Type, write: Write) -> Write:
    def many(out: bytearray, values: Sequence[Any]) -> None:
        if kind.container == "sequence":
            _write_count(out, len(values))
        for value in values:
            write(out, value)

    return many


def _number_list_writer(kind: Type) -> Write:
    form, size = FORMATS[kind.name], SIZES[kind.name]

    def many(out: bytearray, values: Sequence[Any]) -> None:
        if kind.container == "sequence":
            _write_count(out, len(values))
        if values:
            _align(out, size)
            out += values if isinstance(values, bytes) else pack(f"<{len(values)}{form}", *values)

    return many


def _write_string(out: bytearray, text: str) -> None:
    content = text.encode()
    _write_count(out, len(content) + 1)
    out += content
    out.append(0)


def _write_wstring(out: bytearray, text: str) -> None:
    """Four bytes for each UTF-16 unit, see `reader`."""
    content = text.encode("utf-16-le")
    count = len(content) // 2
    _write_count(out, count)
    out += pack(f"<{count}I", *unpack(f"<{count}H", content))


def _write_count(out: bytearray, count: int) -> None:
    _align(out, LENGTH_BYTES)
    out += _COUNT.pack(count)


def _align(out: bytearray, size: int) -> None:
    """Pads with zeros to the next multiple of `size` after the header."""
    out.extend(bytes((HEADER_BYTES - len(out)) % size))

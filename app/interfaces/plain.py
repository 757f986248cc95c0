"""Decoded messages as plain values for JSON and the browser."""

import math
from dataclasses import fields
from functools import lru_cache
from typing import Any, Final

import numpy

from app.interfaces.definitions import PLACEHOLDER

# JavaScript's numbers are doubles: beyond this, neighbouring integers become one.
MOST: Final = 2**53
EIGHT_BYTES: Final = 8


def to_plain(message: Any) -> Any:
    """A decoded message, or any value in one, as JSON's types.

    A message becomes a dict of its fields in their order, an array or `bytes` a list. What JSON
    or a browser's numbers can't hold becomes text: integers beyond ±2^53 ("9007199254740993"),
    "NaN", "Infinity" and "-Infinity".
    """
    if message is None or isinstance(message, bool | str):
        return message
    if isinstance(message, int):
        return message if -MOST <= message <= MOST else str(message)
    if isinstance(message, float):
        return message if math.isfinite(message) else _unusual(message)
    if isinstance(message, numpy.generic):
        return to_plain(message.item())
    if isinstance(message, numpy.ndarray):
        return _array(message)
    if isinstance(message, list | tuple | bytes | bytearray):
        return [to_plain(item) for item in message]
    return {name: to_plain(getattr(message, each)) for each, name in _names(message.__class__)}


def _unusual(value: float) -> str:
    return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"


def _array(values: "numpy.ndarray[Any, Any]") -> list[Any]:
    """All at once where every element is plain as it is."""
    listed: list[Any] = values.tolist()
    if values.dtype.kind == "f" and not numpy.isfinite(values).all():
        return [to_plain(item) for item in listed]
    if values.dtype.kind in "iu" and values.dtype.itemsize == EIGHT_BYTES:
        return [to_plain(item) for item in listed]
    return listed


@lru_cache(4096)
def _names(of: type[Any]) -> tuple[tuple[str, str], ...]:
    """(attribute, field name) of a message class; no ROS name ends with "_" by itself."""
    own = [one.name for one in fields(of) if one.name != PLACEHOLDER]
    return tuple((name, name.removesuffix("_")) for name in own)

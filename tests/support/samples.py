"""Sample values for any interface: random ones, and the limits of each definition."""

import math
import random
from collections.abc import Mapping
from typing import Any, Final, Literal

import numpy

from app.ros.messages.definitions import INTEGER_RANGES, Structure, Type

Edge = Literal["random", "least", "most"]

LETTERS: Final = "aZ09 _\n\"'\\éß漢字🤖𝄞"
LONGEST: Final = 5  # elements of an unbounded list
FLOATS: Final = (0.0, -0.0, 1.5, -1e-40, 1e30, math.inf, -math.inf, math.nan)
LARGEST: Final[Mapping[str, float]] = {
    "float32": float(numpy.finfo(numpy.float32).max),
    "float64": float(numpy.finfo(numpy.float64).max),
}
# Texts that a way to the robot could spoil.
TEXTS: Final = [
    "",
    "hello",
    "日本語",
    "🤖👩‍🏭",
    "\"quotes\" 'and' `ticks`",
    "<script>alert(1)</script>",
    "{braces} {{double}} {message}",
    "x" * 80,
    "\\ % \t ~ $HOME",
]
# A sensor_msgs/msg/BatteryState that says nothing.
BATTERY: Final[Mapping[str, Any]] = {
    "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
    **dict.fromkeys(("voltage", "temperature", "current", "charge", "capacity"), 0.0),
    **dict.fromkeys(("design_capacity", "percentage"), 0.0),
    **dict.fromkeys(("power_supply_status", "power_supply_health", "power_supply_technology"), 0),
    "present": True,
    "cell_voltage": [],
    "cell_temperature": [],
    "location": "",
    "serial_number": "",
}


class Samples:
    """Sample fields for any structure, reproducible by seed.

    "least" has the lowest values and the shortest lists and texts, "most" the highest and longest.
    """

    def __init__(self, structures: Mapping[str, Structure], seed: int = 0) -> None:
        self._structures = structures
        self._chance = random.Random(seed)

    def fields(self, type_name: str, edge: Edge = "random") -> dict[str, Any]:
        fields = self._structures[type_name].fields
        return {field.name: self._value(field.type, edge) for field in fields}

    def _value(self, kind: Type, edge: Edge) -> Any:
        if kind.container != "one":
            return [self._value(kind.element, edge) for _ in range(self._length(kind, edge))]
        if kind.is_nested:
            return self.fields(kind.name, edge)
        if kind.name == "bool":
            return edge == "most" or (edge == "random" and self._chance.random() < 0.5)
        if kind.name in INTEGER_RANGES:
            return self._integer(*INTEGER_RANGES[kind.name], edge)
        return self._float(kind.name, edge) if kind.name in LARGEST else self._text(kind, edge)

    def _length(self, kind: Type, edge: Edge) -> int:
        if kind.container == "array":
            return kind.size
        most = min(kind.size or LONGEST, LONGEST)
        return {"least": 0, "most": most}.get(edge, self._chance.randint(0, min(most, 3)))

    def _integer(self, low: int, high: int, edge: Edge) -> int:
        if edge != "random":
            return low if edge == "least" else high
        return self._chance.choice((low, high, 0, 1, self._chance.randint(low, high)))

    def _float(self, name: str, edge: Edge) -> float:
        if edge != "random":
            return -LARGEST[name] if edge == "least" else LARGEST[name]
        value = self._chance.choice((*FLOATS, self._chance.gauss(0, 1000)))
        return float(numpy.float32(value)) if name == "float32" else value

    def _text(self, kind: Type, edge: Edge) -> str:
        if edge == "least":
            return ""
        if edge == "most":
            return "x" * (kind.bound or 300)
        text = "".join(self._chance.choices(LETTERS, k=self._chance.randint(0, 9)))
        return text[: kind.bound // 4] if kind.bound else text

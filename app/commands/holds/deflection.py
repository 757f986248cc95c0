"""Shapes a joystick's deflection for its messages: shape, dead zone, ramp. Pure.

A deflection is (x, y), each from -1 to 1: x to the right, y to the front, as the finger is.
"""

import math
from typing import Final

from app.panel.widgets.hold import HoldCommand
from app.panel.widgets.joystick import Joystick

Deflection = tuple[float, float]

CENTRE: Final[Deflection] = (0.0, 0.0)


def moved(widget: HoldCommand, before: Deflection, deflection: Deflection) -> Deflection:
    """The deflection in the next message, if `before` was in the last one; none of a key."""
    if not isinstance(widget, Joystick):
        return CENTRE
    x, y = shaped(widget, deflection)
    step = widget.period_s / widget.ramp_s if widget.ramp_s else math.inf
    return ramped(before[0], x, step), ramped(before[1], y, step)


def shaped(joystick: Joystick, deflection: Deflection) -> Deflection:
    """The deflection limited to the shape. It is zero in the dead zone and begins with zero outside."""
    x, y = (max(-1.0, min(1.0, axis)) for axis in deflection)
    if joystick.shape == "square":
        return _beyond(x, joystick.dead_zone), _beyond(y, joystick.dead_zone)
    far = math.hypot(x, y)
    if far <= joystick.dead_zone:
        return CENTRE
    factor = _beyond(min(far, 1.0), joystick.dead_zone) / far
    return x * factor, y * factor


def ramped(before: float, wanted: float, step: float) -> float:
    """The next value on the way to `wanted`: faster by `step` at most, slower at once."""
    if before * wanted <= 0:
        before = 0.0
    if abs(wanted) <= abs(before) + step:
        return wanted
    return math.copysign(abs(before) + step, wanted)


def _beyond(axis: float, dead_zone: float) -> float:
    if abs(axis) <= dead_zone:
        return 0.0
    return math.copysign((abs(axis) - dead_zone) / (1 - dead_zone), axis)

"""The `[control]` table: whether one browser at a time has control of a robot."""

from app.panel.description import Description, Seconds


class ControlRules(Description):
    """`takeover_after_s` without a touch by the holder lets a request through; `local`: browsers on
    the kiosk's own machine may always take over."""

    required: bool
    takeover_after_s: Seconds = 30.0
    local: bool = True

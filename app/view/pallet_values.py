"""What a plan of a pallet shows: pure, from (widget, robot, time)."""

from typing import Any

from app.i18n import TextLike, say
from app.panel.widgets.pallet import Pallet
from app.robot.state import RobotState
from app.view.display_values import NOTHING, field_state


def pallet(widget: Pallet, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of a plan, and when they change: `state`, `note` and `text` (the layer and the place
    of the next box); `filled` is the area of the boxes in the layer, as the path of an SVG whose unit
    is a box, and `next` the place of the next box, "2 1", "" where there is none."""
    field = field_state(widget, robot, now)
    text: TextLike = NOTHING
    filled = place = ""
    if field.value is not None:
        text, filled, place = _layer(widget, int(field.value))
    shown = {"state": field.state, "note": field.note, "text": text, "filled": filled, "next": place}
    return shown, field.until


def _layer(widget: Pallet, count: int) -> tuple[TextLike, str, str]:
    places, layers, across = widget.in_layer, widget.layers, widget.across
    if count >= places * layers:
        return say("pallet_full"), f"M0 0H{across}V{widget.along}H0z", ""
    layer, on_it = divmod(max(count, 0), places)
    rows, boxes = divmod(on_it, across)
    filled = f"M0 0H{across}V{rows}H0z" if rows else ""
    filled += f"M0 {rows}H{boxes}V{rows + 1}H0z" if boxes else ""
    text = say("pallet_layer", layer=layer + 1, layers=layers, place=on_it + 1, places=places)
    return text, filled, f"{boxes} {rows}"

"""Previews of the messages of each press: with default values of fields that are not given, and with
the ids of inputs in place of their values; as lines of text, similar to `ros2 topic echo`."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from app.panel.constants import resolve_names
from app.panel.model import Panel
from app.panel.template import NOW, input_of, placeholders
from app.panel.widgets.families import Command, Input
from app.panel.widgets.map_view import MapView
from app.ros.messages import Interfaces, Type
from app.system.errors import FieldError, Remark
from app.system.texts import render

ESTIMATE: Final = "geometry_msgs/msg/PoseWithCovarianceStamped"
MAX_EQUAL_WRITTEN: Final = 9  # elements of a list of equal values
Comments = Mapping[str, str]  # by input ids ("speed"), and by places of fields (".poses[0].x")


def previews(panel: Panel, interfaces: Interfaces) -> Iterator[Remark]:
    """A remark for each widget that can be pressed or held, and for each map."""
    for p, page in enumerate(panel.pages):
        comments = {w.id: w.comment for w in page.widgets if isinstance(w, Input)}
        comments[NOW] = "the time of sending"
        for place, widget in page.placed():
            if isinstance(widget, Command) and f"page[{p}].{place}" not in panel.copies:
                lines = _preview_lines(widget, interfaces, comments)
                yield Remark(f"page[{p}].{place}", "\n".join(lines))
            elif isinstance(widget, MapView):
                yield Remark(f"page[{p}].{place}", "\n".join(_map_lines(widget, panel)))
    for w, widget in enumerate(panel.frame.widgets):
        if isinstance(widget, Command):
            yield Remark(f"frame.widget[{w}]", "\n".join(_preview_lines(widget, interfaces, {})))
    for r, load in enumerate(panel.recipe_loads):
        comments = {field.id: field.comment for field in load.fields}
        comments[NOW] = "the time of sending"
        yield Remark(f"recipe[{r}]", "\n".join(_preview_lines(load, interfaces, comments)))


def _map_lines(widget: MapView, panel: Panel) -> Iterator[str]:
    """What depends on the robot's messages, and the doctor compares with them."""
    topics = " and ".join(level.topic for level in widget.maps)
    drawn = f"shows {topics} with the rotation of its origin"
    yield f"{drawn}; Nav2's costmap and AMCL ignore that rotation"
    pose = widget.pose
    if pose is not None and pose.type == ESTIMATE:
        yield (
            f"the robot is old on it {widget.max_age_s:g} s after the last {pose.topic}: "
            "AMCL publishes only while the robot moves"
        )
    elif pose is None and not widget.levels:
        yield f"the robot is on it while transforms lead from its frame to {widget.base_frame}"
    if any(level.qos.durability == "volatile" for level in widget.maps):
        yield "its QoS is volatile: a panel that starts after the map gets none"
    levels = {None, *(level.id for level in widget.maps)}
    for version in dict.fromkeys(
        zone.map_version for zone in panel.zones if zone.map_version and zone.level in levels
    ):
        zones = [
            render(zone.label)
            for zone in panel.zones
            if zone.map_version == version and zone.kind == "keep_out"
        ]
        if not zones:
            continue
        yield f"closed to goals on its version {version} only: {', '.join(zones)}"


def _preview_lines(widget: Command, interfaces: Interfaces, comments: Comments) -> Iterator[str]:
    for sent in widget.sent_messages(interfaces):
        yield sent.when
        if sent.type_name:
            kind = Type(sent.type_name)
            named = resolve_names(sent.fields, kind, interfaces)
            fields = complete_value(named, kind, interfaces)
            every = {**comments, **sent.comments}
            yield from (f"  {line}" for line in message_lines(fields, every))


def complete_value(value: Any, kind: Type, interfaces: Interfaces) -> Any:
    """A value of a template with default values added; texts with input ids are unchanged."""
    if isinstance(value, list | tuple) and kind.container != "one":
        return [complete_value(element, kind.element, interfaces) for element in value]
    if isinstance(value, Mapping) and kind.is_nested:
        fields = interfaces.structures[kind.name].fields
        return {
            f.name: complete_value(value.get(f.name, f.default_value), f.type, interfaces)
            for f in fields
        }
    number = isinstance(value, int) and not isinstance(value, bool)
    return float(value) if number and kind.name.startswith("float") else value


def message_lines(fields: Mapping[str, Any], comments: Comments, place: str = "") -> Iterator[str]:
    """A line for each field, with comments about inputs and fields."""
    for name, value in fields.items():
        yield from _field_lines(name, value, comments, f"{place}.{name}")


def _field_lines(name: str, value: Any, comments: Comments, place: str) -> Iterator[str]:
    if isinstance(value, Mapping) and value:
        yield f"{name}:"
        yield from (f"  {line}" for line in message_lines(value, comments, place))
    elif isinstance(value, list) and any(isinstance(item, Mapping) for item in value):
        yield f"{name}:"
        for index, item in enumerate(value):
            yield from _item_lines(item, comments, f"{place}[{index}]")
    else:
        about = _comment(value, comments, place)
        yield f"{name}: {_format(value)}{f'  # {about}' if about else ''}"


def _item_lines(value: Any, comments: Comments, place: str) -> Iterator[str]:
    """An element of a list of tables: its first line has a dash."""
    if not isinstance(value, Mapping) or not value:
        yield f"- {_format(value)}"
        return
    for number, line in enumerate(message_lines(value, comments, place)):
        yield f"  {line}" if number else f"- {line}"


def _comment(value: Any, comments: Comments, place: str) -> str:
    try:
        names = [input_of(name) for _, name in placeholders(value)]
    except FieldError:  # braces in a value that an input gave
        names = []
    about = [comments[key] for key in (place, *dict.fromkeys(names)) if key in comments]
    return "; ".join([*about, *([f"{len(value)} of them"] if _all_equal(value) else [])])


def _all_equal(value: Any) -> bool:
    return (
        isinstance(value, Sequence) and len(value) > MAX_EQUAL_WRITTEN and len({*map(str, value)}) == 1
    )


def _format(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and not math.isfinite(value):
        return ".nan" if math.isnan(value) else ".inf" if value > 0 else "-.inf"
    if isinstance(value, list):
        shown = [*map(_format, value[:2]), "…"] if _all_equal(value) else map(_format, value)
        return f"[{', '.join(shown)}]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str | dict) else str(value)

"""What can be wrong in a parameter's description whose shape is right: its own limits."""

from collections.abc import Iterator

from app.errors import Fault
from app.panel.inputs import digits
from app.panel.model import Panel
from app.panel.parameter import Parameter
from app.panel.ranges import Range


def parameter_faults(place: str, of: Parameter) -> Iterator[Fault]:
    given = {key: getattr(of, key) for key in ("min", "max", "step") if getattr(of, key) is not None}
    if not of.numeric:
        for key in (*given, *(["unit"] if of.unit else [])):
            what = f'is for numbers; the type is "{of.type}"'
            yield Fault(f"{place}.{key}", what, cause=f"number {place}")
        return
    if of.type == "integer":
        broken = {key: one for key, one in given.items() if not one.is_integer()}
        for key, one in broken.items():
            what = f"{digits(one)} must be whole: the type is integer"
            yield Fault(f"{place}.{key}", what, cause=f"number {place}")
        if broken:
            return
    if of.min is None or of.max is None:
        return
    low, high = digits(of.min), digits(of.max)
    if of.max <= of.min:
        yield Fault(f"{place}.max", f"{high} must be more than min ({low})")
    elif of.step is not None and not Range(of.min, None, of.step).on_step(of.max):
        step = digits(of.step)
        yield Fault(f"{place}.step", f"no whole number of steps of {step} leads from {low} to {high}")


def type_faults(panel: Panel) -> Iterator[Fault]:
    """A parameter has one type, wherever the panel names it."""
    firsts: dict[tuple[str, str], str] = {}
    for p, page in enumerate(panel.pages):
        for w, widget in enumerate(page.widgets):
            if isinstance(widget, Parameter):
                first = firsts.setdefault((widget.node, widget.parameter), widget.type)
                if first != widget.type:
                    what = (
                        f"{widget.parameter} of {widget.node} is {widget.type} here but {first} above"
                    )
                    cause = f"parameter {widget.node} {widget.parameter}"
                    yield Fault(f"page[{p}].widget[{w}].type", what, cause=cause)

"""The parameter whose texts are the options of a select: it is read as those that widgets show."""

from app.panel.widgets.inputs import SelectInput
from app.panel.widgets.parameter import Parameter


def listed_parameter(select: SelectInput) -> Parameter | None:
    """The parameter of a select with `options_from`, under an id that no widget has; None for another
    source."""
    listed = select.options_from.listed if select.options_from is not None else None
    if listed is None:
        return None
    return Parameter.model_construct(
        None,
        id=options_id(select),
        kind="parameter",
        label=select.label,
        node=listed.node,
        parameter=listed.name,
        type="integer" if listed.of_range else "string[]",
    )


def options_id(select: SelectInput) -> str:
    """The id under which the parameter of a select is known."""
    return f"{select.id}.options"

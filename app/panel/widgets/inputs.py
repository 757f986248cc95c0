"""The descriptions of text, select and toggle inputs, and checks of their values."""

import json
import re
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import AfterValidator, Field

from app.panel.base import Description, Label, SaidLabel, Span, catalogue_default, non_empty
from app.panel.values import same_value
from app.panel.widgets.families import CheckContext, DisplayWidget, Input, TopicSource
from app.panel.widgets.robot_options import KEY, RobotOptions
from app.ros.dialects.dialect import Role
from app.ros.messages.validation import format_value
from app.system.errors import Fault, InputError
from app.system.texts import Text, say
from app.system.texts.text import alike

MISSING: Final = (
    'is missing: write options, like [{ value = 1, label = "One" }], or options_from, like '
    '{ topic = "/stations", type = "cell_msgs/msg/Names", field = "names" }'
)
WHOLE: Final = re.compile(r"-?[0-9]{1,19}")
BOOL_TEXTS: Final = {"true": True, "false": False}


class TextInput(Input):
    """With `scan`, what a bar code reader types while no input has the focus goes here."""

    kind: Literal["text"]
    max_length: Annotated[int, Field(ge=1, le=1000)] = 80
    default: Annotated[str, Field(pattern=r"^[^\x00]*$")] = ""
    scan: bool = False

    @property
    def value_description(self) -> str:
        return "text"

    def describe_value(self, value: Any, *, narrow: bool) -> str:
        return f"up to {self.max_length} characters" if narrow else self.value_description

    @property
    def comment(self) -> str:
        return f"text, {format_value(self.default)} at first"

    @property
    def too_long(self) -> Text:
        """What is shown for a code that is longer than the input."""
        return say("input_scan_too_long", max=self.max_length)

    @property
    def default_value(self) -> str | None:
        return self.default if "default" in self.model_fields_set else None

    def examples(self) -> list[Any]:
        return ["x" * self.max_length]

    def check_value(self, value: Any) -> str:
        """The text; lengths are in characters."""
        if not isinstance(value, str):
            raise InputError(
                say("input_not_text", label=self.label, id=self.id, given=format_value(value))
            )
        if len(value) > self.max_length:
            raise InputError(
                say("input_text_too_long", label=self.label, count=len(value), most=self.max_length)
            )
        return value

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        if len(self.default) > self.max_length:
            yield Fault(f"{place}.default", f"is longer than max_length ({self.max_length})")


def _check_json_value(value: Any) -> Any:
    """An option's value: anything of TOML that JSON has too."""
    try:
        json.dumps(value)
    except TypeError:
        raise ValueError("must be text, a number, true or false, a list or a table") from None
    return value


class Option(Description):
    """An option of a select; `key` is its value in a form."""

    value: Annotated[Any, AfterValidator(_check_json_value)]
    label: Label

    @property
    def key(self) -> str:
        return self.value if isinstance(self.value, str) else json.dumps(self.value)


class SelectInput(DisplayWidget, Input):
    """Its options are those of the panel file, or with `options_from` the robot's: texts, or whole
    numbers."""

    on_phone: ClassVar[bool] = False

    kind: Literal["select"]
    span: Span = 6
    options: Annotated[tuple[Option, ...], Field(strict=False), AfterValidator(non_empty)] | None = None
    options_from: RobotOptions | None = None
    default: Any = None

    def sources(self) -> Iterator[TopicSource]:
        if self.options_from is not None and (source := self.options_from.source) is not None:
            yield source

    def endpoints(self) -> Iterator[tuple[Role, str]]:
        if self.options_from is not None:
            yield from self.options_from.endpoints()

    @property
    def own_options(self) -> tuple[Option, ...]:
        """The options of the panel file."""
        return self.options or ()

    @property
    def initial_text(self) -> str:
        """The key of the option that is selected initially; "" where the robot has the options, and
        none is the default."""
        if self.options_from is not None:
            return "" if self.default is None else str(self.default)
        first = (option for option in self.own_options if same_value(option.value, self.default))
        return next(first, self.own_options[0]).key

    @property
    def value_description(self) -> str:
        if self.options_from is None:
            return "the values of its options"
        return "whole number" if self.options_from.range else "text"

    def describe_value(self, value: Any, *, narrow: bool) -> str:
        return self.value_description if self.options_from else format_value(value)

    @property
    def comment(self) -> str:
        if self.options_from is not None:
            if self.options_from.range:
                return f"one of the numbers in the range of {self.options_from.list_name}"
            return f"one of the texts that {self.options_from.list_name} lists"
        return f"one of {', '.join(format_value(option.value) for option in self.own_options)}"

    @property
    def default_value(self) -> Any:
        return self.default

    def examples(self) -> list[Any]:
        if self.options_from is None:
            return [option.value for option in self.own_options]
        return [1] if self.options_from.range else ["text"]

    def check_value(self, value: Any) -> Any:
        """The value of the option with the given value or key; forms and browsers send keys. Of the
        robot's options any text, which a press compares with the list."""
        if self.options_from is not None:
            return self._robots_value(value, self.options_from)
        for option in self.own_options:
            if same_value(option.value, value) or option.key == value:
                return option.value
        options = tuple(option.label for option in self.own_options)
        raise InputError(
            say("input_not_an_option", label=self.label, options=options, given=format_value(value))
        )

    def _robots_value(self, value: Any, source: RobotOptions) -> Any:
        """A text of the robot's list, or a number of its range, which a page sends as text."""
        if source.range:
            is_whole = isinstance(value, int) and not isinstance(value, bool)
            if is_whole or (isinstance(value, str) and WHOLE.fullmatch(value)):
                return int(value)
        elif isinstance(value, str) and value:
            return value
        raise InputError(say("input_not_chosen", label=self.label))

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        if (self.options is None) == (self.options_from is None):
            both = "stands beside options: write the one or the other" if self.options else MISSING
            yield Fault(f"{place}.{KEY if self.options else 'options'}", both)
            return
        if self.options_from is not None:
            yield from self.options_from.faults(f"{place}.{KEY}", checking.interfaces)
            kind, name = (int, "whole number") if self.options_from.range else (str, "text")
            if self.default is not None and type(self.default) is not kind:
                yield Fault(f"{place}.default", f"must be a {name}, as the robot's options are")
            return
        yield from option_faults(place, self.own_options)
        if self.default is not None and not any(
            same_value(o.value, self.default) for o in self.own_options
        ):
            there = ", ".join(format_value(option.value) for option in self.own_options)
            yield Fault(
                f"{place}.default", f"{format_value(self.default)} is no option; there is {there}"
            )


class ToggleInput(Input):
    kind: Literal["toggle"]
    span: Span = 6
    on: SaidLabel = catalogue_default("on")
    off: SaidLabel = catalogue_default("off")
    default: bool = False

    @property
    def value_description(self) -> str:
        return "true or false"

    @property
    def comment(self) -> str:
        return f"true or false, {format_value(self.default)} at first"

    @property
    def default_value(self) -> bool | None:
        return self.default if "default" in self.model_fields_set else None

    def examples(self) -> list[Any]:
        return [False, True]

    def parse_text(self, text: str, language: str) -> bool | str:
        return BOOL_TEXTS.get(text, text)

    def check_value(self, value: Any) -> bool:
        if isinstance(value, bool):
            return value
        message = say(
            "input_not_a_boolean", label=self.label, on=self.on, off=self.off, given=format_value(value)
        )
        raise InputError(message)


def option_faults(place: str, options: Sequence[Option]) -> Iterator[Fault]:
    """Faults of options with equal keys or labels."""
    keys = [option.key for option in options]
    labels = [option.label for option in options]
    for i, (key, label) in enumerate(zip(keys, labels, strict=True)):
        if key in keys[:i]:
            yield Fault(f"{place}.options[{i}].value", f"{key} is already options[{keys.index(key)}]")
        if (first := next((n for n in range(i) if alike(labels[n], label)), None)) is not None:
            message = f'"{label}" is already the label of options[{first}]'
            yield Fault(f"{place}.options[{i}].label", message)

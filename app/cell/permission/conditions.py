"""Whether a condition is met: the value that its field has now, what it must be, and the verdict.

Pure functions from (condition, robot, time). Unknown means not met: a value that was never received, is
stale or cut off has a reason of its own.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from app.cell.permission.verdict import PERMITTED, Verdict, locked, topic_mismatch
from app.cell.robot.state import Reading, RobotState
from app.cell.robot.topics import kept_s
from app.panel.condition import VALUE, Condition
from app.panel.numbers import decimal_text, formatted, shortest_float, shown_number
from app.panel.shared_keys import stale_at
from app.panel.values import same_value
from app.ros.messages import Absence, has_key
from app.system.texts import PanelText, Text, TextLike, joined, number, render, say
from app.system.texts.text import after_space, each_language, filled_in, together, with_unit

# Messages that arrive this soon after joining may be replayed, with values of any age.
HISTORY_S: Final = 1.0
LONGEST_TEXT: Final = 40  # characters of a text that stands in a reason
DIGITS: Final = (6, 9)  # a float32 has nine at most
# The codes of locks by the status of a reading that has no message.
READING_LOCKS: Final[Mapping[str, str]] = {
    "waiting": "interlock_waiting",
    "cut": "interlock_connection_lost",
    "ended": "interlock_publisher_ended",
    "unreadable": "interlock_unreadable",
    "reading": "interlock_reading",
    "foreign": "interlock_foreign",
}
# Why a function of fields has no value.
ABSENCES: Final[Mapping[Absence, Text]] = {
    "empty": say("absence_empty"),
    "no_rotation": say("absence_no_rotation"),
    "no_time": say("absence_no_time"),
    "other_clock": say("absence_other_clock"),
    "other_time": say("absence_other_time"),
}

HOLDS: Final[Mapping[str, Callable[[Any, Any], bool]]] = {
    "equals": same_value,
    "not_equals": lambda value, other: value == value and not same_value(value, other),
    "min": lambda value, lowest: value >= lowest,
    "max": lambda value, highest: value <= highest,
    "one_of": lambda value, values: any(same_value(value, other) for other in values),
}


@dataclass(frozen=True, slots=True)
class ConditionState:
    """A condition at one moment: the value as text, "" if it is unknown; the `need`, which is what it
    must be; and the verdict, which is not permitted while the condition is not known to be met."""

    value: TextLike
    need: TextLike
    verdict: Verdict


def condition_state(
    condition: Condition, robot: RobotState, now: float, link: Verdict
) -> ConditionState:
    """The value, need and verdict at `now` (monotonic seconds). `link` is the link's verdict."""
    verdict, wanted = condition_verdict(condition, robot, now, link), need(condition)
    reading = _reading(condition, robot)
    value = reading.value(condition.field) if reading.status == "message" else None
    text = "" if value is None else _received_text(condition, value, wanted)
    return ConditionState(text, wanted, verdict)


def condition_verdict(condition: Condition, robot: RobotState, now: float, link: Verdict) -> Verdict:
    """Whether a condition is met at `now`: the robot can be reached, the topic has the type and QoS,
    and the value is fresh and meets the comparisons. `until` is when time alone changes that."""
    if not link.permitted:
        return link
    return topic_mismatch("MS", condition, robot) or value_verdict(condition, robot, now)


def value_verdict(
    condition: Condition, robot: RobotState, now: float, *, single_publisher: bool = False
) -> Verdict:
    """Whether the latest value meets the condition, for a robot and a topic that can be read.
    `single_publisher`: each message has every element that the topic has."""
    subject, key = condition.subject, robot.key(condition.topic)
    reading = _reading(condition, robot, single_publisher=single_publisher)
    if reading.status != "message":
        return unread(reading, subject, condition.type)
    if robot.silent_publishers.has_silent(key, robot.peers_of(key)):
        reason = say("interlock_new_publisher", topic=subject)
        which = robot.publishers(key).sentence(subject) if robot.graph.has_endpoint("MP", key) else ""
        return Verdict(False, "interlock_new_publisher", joined([reason, which]))
    value = reading.value(condition.field)
    if not permits(condition, value):
        if value is None and (absence := reading.absence(condition.field)) is not None:
            return no_value(subject, condition.field, absence)
        return refusal(condition, value, is_ambiguous=reading.is_ambiguous(condition.field))
    if condition.max_age_s is None:
        return PERMITTED
    if reading.at < fresh_since(robot, key):
        return locked("interlock_waiting", topic=subject)
    until = stale_at(reading.at, condition.max_age_s)
    if now >= until:
        return stale(subject, condition.field, condition.max_age_s)
    return Verdict(True, until=until)


def unread(reading: Reading, subject: TextLike, type_name: str) -> Verdict:
    """The lock for a topic of which no message can be used now; `subject` is what sentences call it."""
    return locked(READING_LOCKS[reading.status], topic=subject, wanted=type_name)


def no_value(subject: TextLike, field: str, absence: Absence) -> Verdict:
    """The lock for a function of fields that has no value."""
    return locked("interlock_field_no_value", field=field, topic=subject, reason=ABSENCES[absence])


def refusal(condition: Condition, value: Any, *, is_ambiguous: bool = False) -> Verdict:
    """The verdict for a value that does not meet the condition, None for one that is missing.
    `is_ambiguous`: several elements have the key of its field."""
    if is_ambiguous:
        return locked("interlock_field_ambiguous", field=condition.field, topic=condition.subject)
    if value is None:
        return locked("interlock_field_missing", field=condition.field, topic=condition.subject)
    sentence = _own_sentence(condition, value)
    if condition.comparisons:
        return Verdict(False, "interlock_condition_unmet", sentence or unmet(condition, value))
    if sentence is not None:
        return Verdict(False, "interlock_not_permitted", sentence)
    return locked("interlock_not_permitted", name=condition.name)


def _own_sentence(condition: Condition, value: Any) -> TextLike | None:
    """The panel file's sentence for a value that does not meet the condition, if it has one."""
    sentence = condition.own_sentence
    if sentence is None or not any(VALUE in text for text in each_language(sentence).values()):
        return sentence
    value_text = _received_text(condition, value, need(condition))

    def fill(text: str) -> TextLike:
        before, place, after = text.partition(VALUE)
        return together([before, value_text, after]) if place else text

    return filled_in(sentence, fill) if isinstance(sentence, PanelText) else fill(sentence)


def stale(subject: TextLike, field: str, max_age_s: float) -> Verdict:
    """The lock for a value that is too old; one with a key may be older than the last message."""
    limit = number(f"{max_age_s:g}")
    if has_key(field):
        return locked("interlock_stale_field", topic=subject, field=field, limit=limit)
    return locked("interlock_stale", topic=subject, limit=limit)


def _reading(condition: Condition, robot: RobotState, *, single_publisher: bool = False) -> Reading:
    lacking_s = kept_s(condition.max_age_s, single_publisher=single_publisher)
    return robot.reading(condition.topic).of_field(condition.field, lacking_s)


def fresh_since(robot: RobotState, key: str) -> float:
    """From when on a received message is a new one, not one that was replayed on joining. Where a
    publisher is, or may be, transient local, that is known only some time after its first message."""
    joined_at = robot.settled_at + HISTORY_S
    is_volatile = robot.graph.is_volatile(key)
    return joined_at if is_volatile else max(joined_at, robot.replayed.known_since(key))


def permits(condition: Condition, value: Any) -> bool:
    """Whether this value meets the condition. None, a value that is missing, never does; nor does
    NaN."""
    comparisons = condition.comparisons
    if not comparisons:
        return value is True
    return value is not None and all(HOLDS[key](value, other) for key, other in comparisons.items())


def unmet(condition: Condition, value: Any) -> Text:
    """The sentence for a value that does not meet the comparisons."""
    wanted = need(condition)
    value_text = _received_text(condition, value, wanted)
    return say("interlock_condition_unmet", name=condition.name, value=value_text, wanted=wanted)


def need(condition: Condition) -> TextLike:
    """What the value must be, as text: "5 bar or more", "CHARGING or FULL"."""
    if not condition.comparisons:
        return _written(condition, True)
    first, *others = _needs(condition)
    return say("condition_both", one=first, other=others[0]) if others else first


def not_finite(value: float) -> Text:
    """What stands for NaN and infinities in a sentence."""
    return say("condition_nan") if math.isnan(value) else say("condition_infinite")


def _needs(condition: Condition) -> Iterator[TextLike]:
    wanted = condition.written
    if "equals" in wanted:
        yield _value_text(condition, wanted["equals"], condition.unit)
    if "one_of" in wanted:
        *all_but_last, last = (
            _value_text(condition, value, condition.unit) for value in wanted["one_of"]
        )
        yield say("condition_either", first=tuple(all_but_last), last=last) if all_but_last else last
    if "min" in wanted or "max" in wanted:
        yield _limits(condition)
    if "not_equals" in wanted:
        yield say("condition_not", value=_value_text(condition, wanted["not_equals"], condition.unit))


def _limits(condition: Condition) -> Text:
    low, high = (
        "" if limit is None else _value_text(condition, limit, "")
        for limit in (condition.written.get("min"), condition.written.get("max"))
    )
    code = "limits_both" if low and high else "limits_low" if low else "limits_high"
    return say(code, low=low, high=high, unit=after_space(condition.unit))


def _received_text(condition: Condition, value: Any, wanted: TextLike) -> TextLike:
    """The value that was received as it is shown: in the condition's format, else in as few digits as
    distinguish it from the one that is needed."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        value = shown_number(condition, value)
        if condition.format is not None and math.isfinite(value):
            text = number(formatted(value, condition.format), condition.unit)
            if condition.comparisons and render(text) not in render(wanted):
                return text
    if not isinstance(value, float):
        return _value_text(condition, value, condition.unit)
    if math.isnan(value):
        return not_finite(value)
    rounded = (float(f"{value:.{digits}g}") for digits in DIGITS)
    candidates = [_value_text(condition, near, condition.unit) for near in (*rounded, value)]
    written = render(wanted)  # its numbers have the same digits in every language
    return next((text for text in candidates if render(text) not in written), candidates[-1])


def _value_text(condition: Condition, value: Any, unit: str | PanelText) -> TextLike:
    text = _written(condition, value)
    known = isinstance(value, bool | str) or value in condition.constants
    return with_unit(text, unit) if known else number(text, unit)


def _written(condition: Condition, value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"' if len(value) <= LONGEST_TEXT else f'"{value[: LONGEST_TEXT - 1]}…"'
    if value in condition.constants:
        return condition.constants[value]
    return decimal_text(shortest_float(value) if isinstance(value, float) else value)

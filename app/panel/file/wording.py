"""Messages about values of a panel file."""

import re
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import Any, Final

from app.panel.values import number_text
from app.ros.messages.validation import format_value
from app.ros.messages.validation import list_names as list_names

NAME_SIMILARITY: Final = 0.7
NO_ID: Final = 'is not an id: a-z, 0-9 and "_", a letter first, 64 at most'
_PICTURE: Final = (
    'is not the name of a picture: it must be like "press.svg", with svg, png, jpg or webp'
)
_VARIABLE: Final = "is not the name of an environment variable: it must be like PANEL_MQTT_PASSWORD"
_CLAIM: Final = 'is not the name of a claim: it must be like "preferred_username"'
# The rule of a text, by its key: each key with a pattern has a row.
PATTERNS: Final[Mapping[str, str]] = {
    **dict.fromkeys(
        (
            "id",
            "robot",
            "needs",
            "groups",
            "interlock",
            "page",
            "fields",
            "condition",
            "places",
            "effects",
        ),
        NO_ID,
    ),
    **dict.fromkeys(("map", "level", "alarms", "action", "ack_command", "ack_input", "effects"), NO_ID),
    **dict.fromkeys(("logo", "src", "picture"), _PICTURE),
    **dict.fromkeys(("password_env", "secret_env"), _VARIABLE),
    **dict.fromkeys(("user_claim", "groups_claim"), _CLAIM),
    "acr_values": "is not an authentication class: it has no spaces, and 200 characters at most",
    "colour": 'is not a colour: it must be like "#1e5aa8"',
    "origins": 'is not the origin of a site: it must be like "https://intranet.example.com"',
    "url": 'is not the address of a panel: it must be like "https://cell1.plant.example/"',
    "figures": NO_ID,
    "screens": 'is not a size of a screen: it must be like "1280x800"',
    "field": "is not a field: it must be like status or pose.position",
    "parameters": "has the name of a parameter with spaces",
    "format": 'is not a format: it must be like ".1f", "+.2e" or ",d"',
    "constants": 'is not how names of constants start: it must be like STATUS_, or "" for all',
    "parameter": "is not the name of a parameter: it has no spaces",
    "name": "is not a name that a message can have: it has control characters",
    "names": 'is not the name of a field: it has a-z, 0-9 and "_"',
    "frame": "is not the name of a frame: it must be like map, without a slash before it",
    "map_version": "is not the version of a map: it has 16 digits, of 0-9 and a-f",
    "base_frame": "is not the name of a frame: it must be like base_link, without a slash before it",
    "breaks": 'is not a break: it must be like "09:30-09:45"',
    "default": "has a NUL character, at which a ROS string ends",
}
# The elements of a list, by its key.
LIST_WORDS: Final[Mapping[str, str]] = {
    "interfaces": 'folders: write ["folder"]',
    "connect": 'Zenoh endpoints: write ["tcp/robot1:7447"]',
    "topics": 'topics: write ["/battery"]',
    "options": 'tables, like [{ value = 1, label = "One" }]',
    "states": 'tables, like [{ value = 0, text = "Idle", shape = "circle" }]',
    "joint": "tables: write [[page.widget.joint]]",
    "column": "tables: write [[page.widget.column]]",
    "page": "tables: write [[page]]",
    "group": "tables: write [[page.group]]",
    "widget": "tables: write [[page.widget]]",
    "place": "tables: write [[place]]",
    "places": 'ids of places: write ["dock"]',
    "points": "points, like [[0.0, 0.0], [2.0, 0.0], [2.0, 1.5]]",
    "zone": "tables: write [[zone]]",
    "zone_file": "tables: write [[zone_file]]",
    "holes": "lists of points, like [[[0.0, 0.0], [2.0, 0.0], [2.0, 1.5]]]",
    "screens": 'sizes in CSS pixels: write ["1280x800"]',
    "robot": "tables: write [[robot]]",
    "interlock": "tables: write [[interlock]]",
    "alarm": "tables: write [[alarm]]",
    "font": "tables: write [[font]]",
    "source": "tables: write [[source]]",
    "condition": "tables: write [[condition]]",
    "recipe": "tables: write [[recipe]]",
    "pen": "tables: write [[page.widget.pen]]",
    "detail": "tables: write [[state.detail]]",
    "reason": "tables: write [[oee.reason]]",
    "counter": "tables: write [[oee.counter]]",
    "inhibits": 'ids of controls: write ["start"]',
}
# What the numbers of a key mean.
NUMBERS_OF: Final[Mapping[str, str]] = {
    "priority": "a number: 1 high, 2 medium, 3 low, 4 diagnostic",
    "critical_priority": "a number: 1 high, 2 medium, 3 low, 4 diagnostic",
}
# The limits of a number, by pydantic's names.
LIMITS: Final[Mapping[str, str]] = {
    "ge": "{} or more",
    "gt": "more than {}",
    "le": "{} or less",
    "lt": "less than {}",
}


def describe_error(error: Mapping[str, Any], key: str, header: str = "") -> str:
    """The message about an error of pydantic; never pydantic's own text. `header` is that of the
    table's list in the file, like "frame.widget"."""
    kind, value, about = error["type"], format_value(error["input"]), error.get("ctx", {})
    match kind:
        case "value_error":
            return str(about["error"])
        case "string_pattern_mismatch":
            return f"{value} {PATTERNS.get(key, 'is not written as it must be')}"
        case "literal_error":
            return one_of(re.findall("'([^']*)'", about["expected"]), error["input"])
        case "tuple_type":
            words = LIST_WORDS.get(key, "values")
            listed = f"tables: write [[{header}]]" if words.startswith("tables: write [[") else words
            return f"must be a list of {listed}, not {value}"
        case "dict_type":
            return f'must be a table, like {{ field = "value" }}, not {value}'
        case "string_too_short" if key == "label":
            return "must not be empty: show_label = false leaves the label of a widget out"
        case "string_too_short" | "too_short":
            return "must not be empty"
        case "string_too_long" | "too_long":
            length, most = len(error["input"]), about["max_length"]
            if isinstance(error["input"], str):
                return f"must be {most} characters at most; it has {length}"
            return f"must have {most} {_elements(key)} at most; it has {length}"
    if key in NUMBERS_OF:
        return f"must be {NUMBERS_OF[key]}, not {value}"
    for name, words in LIMITS.items():
        if name in about:
            return f"must be {words.format(number_text(float(about[name])))}, not {value}"
    if kind == "string_type" and isinstance(error["input"], list):
        return _text_of_list(key, error["input"])
    return f"{_must_be(kind)}, not {value}"


def _text_of_list(key: str, values: list[Any]) -> str:
    if len(values) == 1 and isinstance(values[0], str):
        return f'must be a text, not a list: write {key} = "{values[0]}"'
    return f"must be a text, not a list of {len(values)} values"


def _elements(key: str) -> str:
    """The plural of what a list's key names."""
    if key not in LIST_WORDS:
        return "values"
    return key if key.endswith("s") else f"{key}s"


def closest_name(name: str, known: Iterable[str]) -> str:
    """The most similar name; "" if none is similar enough: many keys are short and alike."""
    return next(iter(get_close_matches(name, list(known), n=1, cutoff=NAME_SIMILARITY)), "")


def no_such(kind: str, name: str, known: Iterable[str], where: str = "") -> str:
    """The message about a name of nothing that the panel has."""
    return f'no {kind} "{name}"{where}; {known_hint(name, known)}'


def known_hint(name: str, known: Iterable[str]) -> str:
    """Which name of the known ones is meant, or all of them."""
    names = list(known)
    meant = closest_name(name, names)
    return f'did you mean "{meant}"?' if meant else f"there is {list_names(names)}"


def one_of(known: list[str], value: Any) -> str:
    """The message about a value that is none of the known ones."""
    *others, last = (f'"{name}"' for name in known)
    listed = f"{', '.join(others)} or {last}" if others else last
    meant = closest_name(str(value).lower(), known)
    hint = f': did you mean "{meant}"?' if meant else ""
    return f"must be {listed}, not {format_value(value)}{hint}"


def _must_be(kind: str) -> str:
    for part, phrase in (
        ("string", "text"),
        ("bool", "true or false"),
        ("int", "a whole number"),
        ("finite", "a finite number"),
        ("float", "a number"),
        ("model", "a table"),
    ):
        if kind.startswith(part):
            return f"must be {phrase}"
    return "can't be used here"

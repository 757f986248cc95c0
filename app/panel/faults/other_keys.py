"""What other programs call a key, and what is written here."""

from collections.abc import Mapping
from typing import Final

_LIMIT: Final = "a limit is high, high_high, low or low_low, such as high = 80"
_USERS: Final = "users are not in the panel file: `operator-panel users add` adds them"
_CONNECT: Final = 'where it is reached is connect = ["tcp/robot1:7447"]'
_FONT: Final = 'a font is two files, regular = "corp.ttf" and bold = "corp-bold.ttf"'
_KIND: Final = "a page has no kind; that of the robots' tiles has overview = true"

# The table's name → the key of other programs → the sentence about what is written here.
OTHER_KEYS: Final[Mapping[str, Mapping[str, str]]] = {
    "alarm": {
        **dict.fromkeys(
            ("severity", "level", "urgency", "class"),
            "its urgency is priority, such as priority = 2: 1 high, 2 medium, 3 low, 4 diagnostic",
        ),
        **dict.fromkeys(
            ("message", "title", "label", "name", "description"),
            'what the operator reads is text, such as text = "Motor hot"',
        ),
        **dict.fromkeys(
            ("delay", "delay_s", "on_delay", "debounce", "debounce_s"),
            "it is raised after on_delay_s, such as on_delay_s = 2.0",
        ),
        **dict.fromkeys(
            ("max", "min", "above", "below", "limit", "limits", "threshold", "upper", "lower"), _LIMIT
        ),
        **dict.fromkeys(
            ("hysteresis", "dead_band"), "the hysteresis of a limit is deadband, such as deadband = 2"
        ),
        **dict.fromkeys(
            ("condition", "equals", "value", "trigger", "active", "if"),
            "a value that raises it is in a table of its own: [alarm.when] with topic, type and equals",
        ),
        **dict.fromkeys(
            ("locks", "lock", "interlock", "blocks"),
            'the controls that it locks are inhibits, such as inhibits = ["start"]',
        ),
    },
    "access": {
        **dict.fromkeys(
            ("timeout", "timeout_s", "timeout_min", "idle", "idle_min", "idle_minutes", "logout_s"),
            "after how long a user is signed out is idle_s, in seconds, such as idle_s = 600",
        ),
        **dict.fromkeys(("user", "users", "password", "passwords", "pin", "pins", "login"), _USERS),
    },
    "font": dict.fromkeys(("family", "name", "file", "files", "path", "src", "url"), _FONT),
    "robot": {
        **dict.fromkeys(("ip", "host", "hostname", "address", "endpoint", "url", "port"), _CONNECT),
        **dict.fromkeys(("prefix", "ns"), 'its namespace is namespace, such as namespace = "/robot1"'),
    },
    "overview": dict.fromkeys(
        ("widget", "widgets", "value", "figure"),
        "its figure is topic, type and field, or source, as those of a readout",
    ),
    "page": dict.fromkeys(("kind", "type"), _KIND),
}
# The keys that such a sentence names: none of them is reported as missing too.
ANSWERED: Final[Mapping[str, tuple[str, ...]]] = {
    "font": ("regular", "bold"),
    "overview": ("topic", "type"),
}


def other_key(table: str, key: str) -> str:
    """The sentence about a key that is not known in a table; "" for keys that no one writes there."""
    return OTHER_KEYS.get(table, {}).get(key.lower(), "")

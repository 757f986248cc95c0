"""What may leave the machine in a support bundle: values of known keys, in a form that is known to be
harmless. All else is left out, however it is written: a password has no form of its own. Pure."""

import json
import re
from collections.abc import Mapping
from typing import Any, Final

LEFT_OUT: Final = "(left out)"
DEEPEST: Final = 20  # of nested values
LONGEST: Final = 300  # of a value

# What a key's value may be. None: a table or list with keys of its own, no value. TEXT: the key alone.
Rule = re.Pattern[str] | None
TEXT: Final = re.compile(r"(?!)")
Rules = dict[str, Rule]


def words(text: str) -> re.Pattern[str]:
    """One of these words."""
    return re.compile("|".join(map(re.escape, text.split())))


def rules(*rows: tuple[str, Rule]) -> Rules:
    """Key → rule, from rows of keys with spaces between."""
    return {key: rule for keys, rule in rows for key in keys.split()}


NUMBER: Final = re.compile(
    r"[+\-]?(?:\d{1,20}(?:\.\d{0,20})?|\.\d{1,20})(?:[eE][+\-]?\d{1,3})?|true|false|null|[+\-]?(?:inf|nan)"
)
DURATION: Final = re.compile(rf"[1-9]\d{{0,5}}[smhd]|{NUMBER.pattern}")
ID: Final = re.compile(r"[a-z][a-z0-9_]{0,63}")
ROS_NAME: Final = re.compile(r"(?:/{1,2}[A-Za-z_]\w*(?:/\w+)*/?)?", re.ASCII)
ROS_KEY: Final = re.compile(rf"[A-Za-z_]\w*(?:/\w+)*|{ROS_NAME.pattern}", re.ASCII)
ROS_TYPE: Final = re.compile(
    r"[a-z]\w*(?:/(?:msg|srv|action))?/[A-Z]\w*|(?:bool|integer|double|string)(?:\[\])?", re.ASCII
)
_PATH: Final = r"[a-z]\w*(?:\.[a-z]\w*|\[\d{1,6}\])*"
FIELD: Final = re.compile(rf"{_PATH}|[a-z]{{3,6}}\({_PATH}(?:, ?{_PATH})?\)", re.ASCII)
HEX: Final = re.compile(r"[0-9a-f.\-]{1,64}")
VERSION: Final = re.compile(r"v?\d[\w.+\-]{0,60}", re.ASCII)
TIME: Final = re.compile(r"[\dT:.+\- Z]{4,40}")
ADDRESS: Final = re.compile(r"[0-9a-fA-F:.]{2,45}|localhost")
# A locator of Zenoh, without the settings that may follow it.
ENDPOINT: Final = re.compile(
    r"(?:tcp|udp|tls|quic|ws|wss|vsock|serial|unixsock-stream|unixpipe)/[\w.:\[\]%\-]{1,200}", re.ASCII
)
# The files of an installation; where a user has files is not said.
PLACE: Final = re.compile(r"/(?:etc|opt|var/lib|run)/operator-panel(?:/[\w.\-]{1,80}){0,6}", re.ASCII)


def harmless(text: str, rule: Rule) -> str:
    """The text if it is what the rule expects, else LEFT_OUT."""
    if rule is None or len(text) > LONGEST:
        return LEFT_OUT
    if rule is ENDPOINT:
        text = re.split("[?#]", text, maxsplit=1)[0]
    return text if rule.fullmatch(text) else LEFT_OUT


def harmless_value(value: Any, keys: Rules, rule: Rule = None, depth: int = 0) -> Any:
    """The same for JSON values: of a table the known keys, of a list each value by its key's rule.
    Numbers are harmless where a rule is."""
    if depth > DEEPEST or rule is TEXT:
        return LEFT_OUT
    if isinstance(value, Mapping):
        return {
            key: harmless_value(inner, keys, keys[key], depth + 1)
            for key, inner in value.items()
            if key in keys
        }
    if isinstance(value, list | tuple):
        return [harmless_value(inner, keys, rule, depth + 1) for inner in value]
    if value is None or isinstance(value, bool):
        return value
    text = value if isinstance(value, str) else json.dumps(value, default=str)
    kept = harmless(text, rule)
    return value if kept == text else kept

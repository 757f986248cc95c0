"""What a command sends, as previews and checks see it."""

from collections.abc import Mapping
from typing import Any, NamedTuple


class SentMessage(NamedTuple):
    """A message that a command sends: when, its type ("" if the panel file names none), and its fields
    with input ids; `comments` are by field (".seq")."""

    when: str
    type_name: str = ""
    fields: Mapping[str, Any] = {}
    comments: Mapping[str, str] = {}

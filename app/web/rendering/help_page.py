"""What the page of help shows: the signs of pages, in parts, each with what it means."""

from collections.abc import Mapping
from typing import Final, NamedTuple

from app.i18n import Text, say


class Sign(NamedTuple):
    """`kind` is how it is drawn (in `help.html`), `name` which of that kind."""

    kind: str
    name: str
    meaning: Text


_SIGNS: Final[Mapping[Text, tuple[Sign, ...]]] = {
    say("help_buttons"): (
        Sign("key", "locked", say("help_locked")),
        Sign("key", "hold", say("help_hold")),
        Sign("key", "stop", say("help_stop")),
        Sign("icon", "ellipsis", say("help_more")),
    ),
    say("help_values"): (
        Sign("value", "old", say("help_old")),
        Sign("lamp", "waiting", say("help_waiting")),
        Sign("lamp", "unknown", say("help_unknown")),
        Sign("lamp", "unreadable", say("help_unreadable")),
    ),
    say("help_links"): (
        Sign("link", "ok", say("help_link_ok")),
        Sign("link", "wait", say("help_link_wait")),
        Sign("link", "bad", say("help_link_bad")),
        Sign("banner", "", say("help_simulated")),
    ),
}
_ALARMS: Final[Mapping[Text, tuple[Sign, ...]]] = {
    say("help_alarms"): (
        Sign("alarm", "1", say("help_alarm_1")),
        Sign("alarm", "2", say("help_alarm_2")),
        Sign("alarm", "3", say("help_alarm_3")),
        Sign("alarm", "4", say("help_alarm_4")),
    ),
}


def signs(has_alarms: bool) -> Mapping[Text, tuple[Sign, ...]]:
    """The signs by the title of their part; those of alarms of a panel that has some."""
    return {**_SIGNS, **_ALARMS} if has_alarms else _SIGNS

"""The sheet of an alarm's row: for how long and why it is shelved, or why it is out of service."""

from typing import Any, Final

from app.commands.alarm_acts import ALARM_ACTS
from app.i18n import Text, number, say
from app.permission.principal import Principal
from app.permission.role_locks import role_verdict

SHELF_MINUTES: Final = (15, 60, 120)
REASONS: Final = ("maintenance", "repair", "sensor", "known")
WORDS: Final = (
    "alarms_more_acts",
    "alarms_for",
    "alarms_reason",
    "alarms_taken_since",
    "alarms_until",
    "alarms_who",
    "alarms_shelve",
    "alarms_unshelve",
    "alarms_out_of_service",
    "alarms_in_service",
    "alarms_not_high",
)


def sheet_words(who: Principal) -> dict[str, Any]:
    """What the sheet shows a client. `shelve_lock`: why it may not shelve, "" if its role is enough."""
    verdict = role_verdict((ALARM_ACTS["shelve"].needs,), who)
    return {
        **{word: say(word) for word in WORDS},
        "shelf_times": shelf_times(),
        "shelf_reasons": [say(f"alarms_reason_{name}") for name in REASONS],
        "shelve_lock": (verdict.reason if verdict else None) or "",
    }


def shelf_times() -> list[tuple[int, Text]]:
    """The times to choose from: seconds, and the text."""
    return [
        (60 * minutes, say("alarms_minutes", count=number(str(minutes)))) for minutes in SHELF_MINUTES
    ]

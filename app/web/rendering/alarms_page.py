"""The page of alarms: its list, and the details of one alarm."""

from app.alarms.rows import AlarmRow
from app.alarms.shown import MAX_ROWS, more_text
from app.i18n import Text, TextLike, render, say
from app.panel.alarm_places import AlarmPlace, alarm_place
from app.web.app_state import AppState
from app.web.rendering.alarm_choice import AlarmChoice, ChoiceContext, choice_context, chosen_rows
from app.web.rendering.alarm_curve import ShownCurve, shown_curve


class AlarmsContext(ChoiceContext):
    """The variables of `alarms.html`, beside those of the frame. `rows_query` asks for the rows as
    JSON. `details` is the address of an alarm's details, up to its id, and `list_address` that of the
    list. `chosen` is the alarm whose details are shown, None for none; `gone`: it was asked for and is
    no longer listed. `place` is where a page shows what it is about, `curve` that of its value.
    `firsts` are the ids of alarms that others followed, `followers` those that followed the chosen
    one. `with_sheet`: the sheet of its row is open."""

    rows: list[AlarmRow]
    rows_query: str
    details: str
    list_address: str
    chosen: AlarmRow | None
    gone: bool
    place: AlarmPlace | None
    place_address: str
    curve: ShownCurve | None
    firsts: set[str]
    followers: list[AlarmRow]
    more: TextLike
    steps: list[str]
    with_sheet: bool


def word(name: str) -> Text:
    return say(f"alarms_{name}")


def alarms_context(
    state: AppState, choice: AlarmChoice, language: str, *, with_sheet: bool = False
) -> AlarmsContext:
    """The alarms as they are now. `with_sheet`: the sheet of the chosen alarm's row is open."""
    rows = state.fleet.alarms.rows()
    row = next((row for row in rows if row["id"] == choice.alarm), None)
    listed = chosen_rows(choice, rows, language, MAX_ROWS)
    address = choice.address(alarm="")
    alarm = state.fleet.alarms.engine.alarms.get(choice.alarm) if row else None
    place = (
        alarm_place(state.fleet.panel, alarm.definition.alarm, alarm.definition.robot)
        if alarm
        else None
    )
    curve = state.fleet.alarms.curves.of_alarm(alarm) if alarm else None
    return AlarmsContext(
        **choice_context(state.fleet.panel, choice, listed.taken),
        rows=listed.rows,
        rows_query="&".join(filter(None, (choice.address(), f"limit={MAX_ROWS}"))),
        details=f"alarms?{address}{'&' if address else ''}alarm=",
        list_address=f"alarms?{address}" if address else "alarms",
        chosen=row,
        gone=bool(choice.alarm) and row is None,
        place=place,
        place_address=_address(state, place, row["robot"]) if place and row else "",
        curve=shown_curve(alarm, curve) if alarm and curve else None,
        firsts={follower["follows"] for follower in rows},
        followers=[follower for follower in rows if follower["follows"] == row["id"]] if row else [],
        more=more_text(listed.more),
        steps=_lines(row["action"], language) if row else [],
        with_sheet=with_sheet and row is not None,
    )


def _address(state: AppState, place: AlarmPlace, robot: str) -> str:
    """The path of a widget on its page, of a robot."""
    base = state.fleet.of_robot(robot).base
    return f"{base}/pages/{place.page.id}#at-{place.widget.id}"


def _lines(text: TextLike, language: str) -> list[str]:
    """The lines of what to do: its steps."""
    return [line.strip() for line in render(text, language).splitlines() if line.strip()]

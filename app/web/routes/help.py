"""The page of help: the signs of pages, each with what it means, and the version."""

from collections.abc import Mapping
from typing import Annotated, Final, NamedTuple

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, Response

from app.system.texts import Text, say
from app.web.app_state import CurrentState
from app.web.pages.context import FramedPage, framed_page
from app.web.requests import errors


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


router = APIRouter()


@router.get(
    "/help",
    response_class=HTMLResponse,
    summary="What the signs of pages mean, and the version",
    responses=errors(403, 404, 422),
)
async def page(
    request: Request, state: CurrentState, robot: Annotated[str, Query(max_length=64)] = ""
) -> Response:
    shown = signs(state.fleet.panel.may_raise)
    framed = FramedPage("help.html", say("help_title"), "/help", robot=robot)
    key = say("help_log_key", key=state.log.key) if state.log.key else ""
    return framed_page(request, state, framed, {"signs": shown, "log_key": key})

"""A page that is none of the panel's own, such as the operator's log, in the frame of the panel."""

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

from fastapi import Request
from fastapi.responses import HTMLResponse, Response

from app.i18n import Text
from app.panel.layout import FRAME_ONLY, Page
from app.panel.widgets.families import BaseWidget
from app.web.app_state import AppState
from app.web.client_cookie import opened_by_person, principal_with_new_token, set_client_cookie
from app.web.language import language_of
from app.web.rendering.page_context import page_context

REFRESH_S: Final = 10  # a page without scripts counts as gone when it has not been loaded for so long


class FramedPage(NamedTuple):
    """`robot` is the id of the robot whose frame is around the page, "" for the first. `alarms_page` is
    the path and query of a page of the alarms, `diagnostics_query` the query of the diagnostics; None
    for another page. `is_help`: it is the page of help. `vary` names the request header by which the
    address has another content. `recipes_page` is the path and query of the page of recipes, `entries`
    is what is entered on it. `own_path` is the path of another page, such as that of sign-in."""

    template: str
    title: Text
    robot: str = ""
    alarms_page: str | None = None
    diagnostics_query: str | None = None
    is_help: bool = False
    vary: str = ""
    recipes_page: str | None = None
    entries: Sequence[BaseWidget] = ()
    own_path: str = ""


def framed_page(
    request: Request, state: AppState, page: FramedPage, context: Mapping[str, Any]
) -> Response:
    """The page with the variables `context`, in the language of the request."""
    session = state.fleet.of_robot(page.robot)
    who, token = principal_with_new_token(request, state, embedded=False)
    if session.control.rules.required:
        session.control.loaded(who, REFRESH_S, opened_by_person(request))
        session.show()
    frame = page_context(
        request,
        state,
        session,
        Page.model_construct(None, id=FRAME_ONLY, title=page.title, own=tuple(page.entries), groups=()),
        who,
        REFRESH_S,
        alarms_page=page.alarms_page,
        diagnostics_query=page.diagnostics_query,
        is_help=page.is_help,
        recipes_page=page.recipes_page,
        own_path=page.own_path,
    )
    html = state.templates.render(page.template, language_of(request), **frame, **context)
    headers = {"cache-control": "no-store"} | ({"vary": page.vary} if page.vary else {})
    return set_client_cookie(HTMLResponse(html, headers=headers), request, token)

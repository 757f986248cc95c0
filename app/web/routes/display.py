"""How the pages look in one browser: a choice from the menu, kept in a cookie."""

import re
from typing import Final

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response

from app.web.app_state import CurrentState
from app.web.pages.display_choice import CHOICES, COOKIE, KEPT_S, LANGUAGE
from app.web.requests import TEXT, body_of, described_body, errors, form_of

router = APIRouter()

OWN_PAGE: Final = re.compile(
    r"(/robots/[a-z0-9_]+)?/(pages|places|recipes)/[a-z0-9_]+|/log|/alarms(/history|/report)?"
    r"|/stops(/(state|alarm|goal|link)-[0-9]+)?|/oee|/diagnostics|/help|/signin|/sessions|/users"
)
# What is none of these is ignored: a page that is still open may be of another version.
BODY: Final = {
    "type": "object",
    "properties": {
        "page": {**TEXT, "description": "the path of the panel's page to go back to; without one, /"},
        **{
            name: {**TEXT, "description": f"one of {', '.join(values)}"}
            for name, values in CHOICES.items()
        },
        LANGUAGE: {**TEXT, "description": "one of the panel's languages, such as en"},
    },
    "additionalProperties": TEXT,
}


@router.post(
    "/display",
    status_code=303,
    response_class=RedirectResponse,
    summary="Choose how the pages look in this browser",
    responses=errors(403, 408, 413, 422),
    openapi_extra=described_body(None, BODY, required=False),
)
async def choose(request: Request, state: CurrentState) -> Response:
    """Keeps each choice that the form has; the others stay. Back to the form's `page`."""
    form = form_of(await body_of(request))
    page = form.get("page", "").removeprefix(state.root)
    back = state.root + (page if OWN_PAGE.fullmatch(page) else "/")
    answer = RedirectResponse(back, status_code=303)
    known = {**CHOICES, LANGUAGE: state.fleet.panel.readers_languages}
    for name, values in known.items():
        if form.get(name) in values:
            cookie, path = COOKIE.format(name), state.root or "/"
            answer.set_cookie(cookie, form[name], max_age=KEPT_S, path=path, samesite="strict")
    return answer

"""In development: a page with every widget in every state, in each theme. It needs no robot."""

from itertools import count
from typing import Any, Final
from urllib.parse import urlencode

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, Response
from jinja2 import Template
from markupsafe import Markup

from app.cell.view.link_status import PRESENCE_WORDS
from app.system.texts import number, say
from app.web.app_state import CurrentState
from app.web.caller import caller_of
from app.web.pages.alarms import WORDS as SHEET_WORDS
from app.web.pages.display_choice import CHOICES, Choice, DisplaySettings, choices
from app.web.pages.words import ALARM_WORDS, TREND_WORDS, UNREADABLE, WORDS
from tests.gallery import PARTS, PICTURE
from tests.gallery.displays import LINES, sample_plot
from tests.gallery.examples import Example
from tests.gallery.overview import overview

router = APIRouter(include_in_schema=False)

LINKS: Final = (("server", "ok", "ok"), ("bridge", "wait", "pending"), ("robot", "bad", "lost"))


@router.get("/gallery", response_class=HTMLResponse)
async def gallery(request: Request, state: CurrentState) -> Response:
    """The query may have a `theme`, a `text_size` and a `hand`, as the menu has them."""
    chosen = {
        name: value for name, value in request.query_params.items() if value in CHOICES.get(name, ())
    }
    display = caller_of(request).display._replace(**chosen)
    language = caller_of(request).language
    cell = state.templates.environment(language).get_template("_cell.html")
    numbers, words, robots = count(), _words(), overview()
    words |= {
        "robot_names": {},
        "tile_pages": robots.tile_pages,
        "robot_pages": robots.tile_pages,
        "overview_robots": say("overview_robots", count=number(str(len(robots.robots)))),
    }
    html = state.templates.render(
        "gallery.html",
        language,
        site=state,
        panel=state.fleet.panel,
        display=display,
        switches=[(choice, _urls(choice, display)) for choice in choices(display)],
        overview=robots,
        parts=[
            (
                part.title,
                part.columns,
                [
                    (example.title, _html(example, next(numbers), cell, words))
                    for example in part.examples
                ],
            )
            for part in PARTS
        ],
        states=[{"state": state, "text": say(word)} for state, word in PRESENCE_WORDS.items()],
        links={
            name: {"name": say(name), "state": lamp, "text": say(text)} for name, lamp, text in LINKS
        },
        words=words,
    )
    return HTMLResponse(html, headers={"cache-control": "no-store"})


@router.get("/gallery/box.svg")
async def box() -> Response:
    """The picture of the gallery's `image`."""
    return Response(PICTURE, media_type="image/svg+xml")


def _words() -> dict[str, Any]:
    """The words of a page that its widgets use."""
    return {word: say(word) for word in (*WORDS, *TREND_WORDS, *ALARM_WORDS, *SHEET_WORDS)} | {
        **UNREADABLE,
        "base": "",
        "embed": "",
        "root": "",
        "may_act": True,
        "pictures": "/gallery",
        "asks": {},
        "scopes": {},
        "stop_lost": "",
        "place_crosshair_at": say("place_crosshair_at", x="{x}", y="{y}", degrees="{degrees}"),
        "lines": lambda _: LINES,
        "plot": sample_plot,
    }


def _html(example: Example, number: int, cell: Template, words: dict[str, Any]) -> Markup:
    """One widget, by the macro of its kind."""
    widget = example.widget(number)
    inputs = {} if example.entered is None else {widget.id: example.entered}
    html = cell.render(
        widget=widget,
        view={"widgets": {widget.id: example.shown}},
        inputs=inputs,
        receipt=example.receipt_of(widget),
        words=words,
        placed="",
    )
    for part, made in example.marks.items():
        assert part in html, (example.title, part)
        html = html.replace(part, made, 1)
    return Markup(html)


def _urls(choice: Choice, display: DisplaySettings) -> list[str]:
    """The address of each option of a choice, with the others as they are."""
    now = {name: getattr(display, name) for name in CHOICES}
    return [f"?{urlencode(now | {choice['name']: option['value']})}" for option in choice["options"]]

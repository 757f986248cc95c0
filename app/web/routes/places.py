"""The card of a place or of a pose that is touched on a map: what would be sent, and why it would be
refused."""

import time
from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import JSONResponse, Response
from pydantic import BaseModel, Field

from app.cell.view.place_values import card_of
from app.panel.widgets.place import MAX_TEXT, PlaceInput
from app.system.texts import render
from app.web.app_state import CurrentSession
from app.web.caller import caller_of
from app.web.requests import errors

router = APIRouter()


class PlaceRow(BaseModel):
    """A line of a card; a line without a name goes on with the one before it."""

    name: str
    text: str


class PlaceCard(BaseModel):
    """What a press with this value sends."""

    value: Annotated[str, Field(description="the value of the input in a press")]
    name: Annotated[str, Field(description="the place's label, or the position")]
    rows: list[PlaceRow]
    pose: Annotated[
        tuple[float, float, float],
        Field(description="x and y in metres and yaw in radians, in the map's frame"),
    ]
    level: Annotated[str, Field(description="the id of its level; empty on a map without levels")]
    reason: Annotated[str, Field(description="why it would be refused now; empty if it would not")]


@router.get(
    "/widgets/{widget}/place",
    response_model=PlaceCard,
    summary="What a press would send for a place or a touched pose, and whether it may be sent",
    responses=errors(403, 404, 422),
)
async def place(
    widget: str,
    request: Request,
    session: CurrentSession,
    value: Annotated[
        str,
        Query(
            max_length=MAX_TEXT,
            description="the id of a place, or `x=12.40 y=6.85 yaw=0.00 map=<version of the map>`",
        ),
    ],
) -> Response:
    chosen = session.panel.widget(widget, PlaceInput)
    card = card_of(chosen, value, session.robot, time.monotonic())
    language = caller_of(request).language
    answer = PlaceCard(
        value=value,
        name=render(card.name, language),
        rows=[
            PlaceRow(name=render(row.name, language), text=render(row.text, language))
            for row in card.rows
        ],
        pose=(card.pose.x, card.pose.y, card.pose.yaw),
        level=card.level,
        reason=render(card.refusal, language),
    )
    return JSONResponse(answer.model_dump(), headers={"cache-control": "no-store"})

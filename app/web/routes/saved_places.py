"""The places that operators save for an input: their page, and the acts on them. JSON for programs,
forms for the page."""

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, TypedDict
from urllib.parse import urlencode

from fastapi import APIRouter, Path, Query, Request
from fastapi.responses import HTMLResponse, Response
from pydantic import BaseModel, ConfigDict, Field

from app.cell.commands.place_acts import (
    PLACE_ACTS,
    RobotPlaces,
    needs_of_places,
    save_refusal,
    where_of,
)
from app.cell.commands.press import PRESS_ID
from app.cell.permission.goal_places import MapPoint, metres
from app.cell.permission.roles import role_verdict
from app.cell.places.saved import MAX_SAVED
from app.cell.recipes.recipe import LONGEST_NAME
from app.cell.session.session import PlaceActs, RobotSession
from app.cell.view.place_values import CardRow, turned
from app.panel.base import ID
from app.panel.places import Place
from app.panel.widgets.place import MAX_TEXT, PlaceInput
from app.system.errors import InputError, NotFound
from app.system.texts import Text, TextLike, say
from app.web.acts import ActBody, act_responses, refused_form, said_of, sent_act
from app.web.answers import ActAnswer
from app.web.app_state import CurrentSession, CurrentState
from app.web.caller import caller_of
from app.web.pages.context import FramedPage, framed_page
from app.web.requests import SINCE, FormFields, described_body, errors

router = APIRouter()

Mode = Literal["show", "save", "delete"]
WidgetId = Annotated[str, Path(pattern=ID, description="the id of a `place` with `save`")]
ActName = Annotated[str, Path(json_schema_extra={"enum": list(PLACE_ACTS)})]
PlaceId = Annotated[str, Field(max_length=64)]
PoseText = Annotated[
    str,
    Field(max_length=MAX_TEXT, description="a touched pose; empty for where the robot is"),
]
MapVersion = Annotated[str, Field(pattern="^([0-9a-f]{16})?$")]
LONGEST: Final = 500
ACT_FORM: Final = FormFields(
    {
        "id": {"pattern": PRESS_ID},
        "name": {"maxLength": LONGEST},
        "value": {"maxLength": MAX_TEXT},
        "map": {"pattern": "^([0-9a-f]{16})?$"},
        "place": {"maxLength": 64},
        "_since": SINCE,
    }
)


class PlacesQuery(BaseModel):
    """What the page shows; `act` is the id of an act, whose receipt is shown."""

    model_config = ConfigDict(extra="forbid")

    mode: Mode = "show"
    value: PoseText = ""
    place: PlaceId = ""
    act: Annotated[str, Field(max_length=400)] = ""
    control: Annotated[str, Field(max_length=400)] = ""
    reloaded: bool = False


class PlaceActBody(ActBody):
    """Of save, the `name`, the touched pose (`value`) and the version of the `map` that the screen
    showed; of delete, the id of the `place`. The same `id` again is the same act."""

    name: Annotated[str, Field(max_length=LONGEST)] = ""
    value: PoseText = ""
    map: MapVersion = ""
    place: PlaceId = ""

    @property
    def inputs(self) -> dict[str, str]:
        """What the act needs, and the log keeps."""
        return self.model_dump(include={"name", "value", "map", "place"}, exclude_defaults=True)


class PlaceReceipt(ActAnswer):
    """The receipt of an act, as that of a press; `done`: it was applied."""


class PlacesContext(TypedDict):
    """The variables of `places.html`, beside those of the frame. `lock` is why no place can be saved
    or deleted here, `refusal` why this one can't be saved now."""

    input: PlaceInput
    mode: Mode
    rows: tuple[Place, ...]
    count: Text
    chosen: Place | None
    facts: list[CardRow]
    typed_name: str
    value: str
    version: str
    lock: TextLike
    refusal: TextLike
    fault: TextLike
    longest: int
    page_back: str
    said: TextLike


def word(name: str, /, **about: Any) -> Text:
    return say(f"places_{name}", **about)


def places_context(
    session: RobotSession,
    widget: PlaceInput,
    query: PlacesQuery,
    lock: TextLike,
    said: TextLike,
    typed: Mapping[str, str],
) -> PlacesContext:
    """What the page shows now; `typed` is what a refused form had."""
    places = places_of(session)
    saved = places.file.saved
    own = saved.of_robot(places.robot.id)
    chosen = next((place for place in own if place.id == query.place), None)
    mode: Mode = "show" if query.mode == "delete" and chosen is None else query.mode
    facts: list[CardRow] = []
    refusal: TextLike = ""
    version = ""
    if mode == "save":
        facts, refusal, version = _to_be_saved(session, widget, query.value)
    elif chosen is not None:
        facts = [
            CardRow(say("place_row_place"), where_of(chosen)),
            CardRow(say("place_row_turned"), turned(chosen.yaw)),
        ]
    return PlacesContext(
        input=widget,
        mode=mode,
        rows=own,
        count=word("count", count=str(len(saved.places)), most=str(MAX_SAVED)),
        chosen=chosen,
        facts=facts,
        typed_name=typed.get("name", ""),
        value=query.value,
        version=version,
        lock=lock,
        refusal=refusal,
        fault=say("place_file_broken", why=saved.fault) if saved.fault else "",
        longest=LONGEST_NAME,
        page_back=_page_of(session, widget),
        said=said,
    )


def places_of(session: RobotSession) -> RobotPlaces:
    """The saved places of a session's robot."""
    return _acts(session).places


def _acts(session: RobotSession) -> PlaceActs:
    if session.place_acts is None:
        raise NotFound("no place can be saved on this panel")
    return session.place_acts


def _to_be_saved(
    session: RobotSession, widget: PlaceInput, value: str
) -> tuple[list[CardRow], TextLike, str]:
    """The pose that would be saved now, why it would be refused, and the version of its map."""
    try:
        point = save_refusal(places_of(session), widget, value, "")
    except InputError as error:
        return [], error.text, ""
    if not isinstance(point, MapPoint):
        return [], point, ""
    pose = point.pose
    where = say("place_at", x=metres(pose.x), y=metres(pose.y))
    rows = [
        CardRow(word("touched") if value else word("robot_here"), where),
        CardRow(say("place_row_turned"), turned(pose.yaw)),
    ]
    return rows, "", point.version


def _page_of(session: RobotSession, widget: PlaceInput) -> str:
    """The path of the first page that has the input."""
    pages = (page.id for page in session.panel.pages if any(w.id == widget.id for w in page.widgets))
    return f"{session.base}/pages/{page}" if (page := next(pages, "")) else f"{session.base}/"


@router.get(
    "/places/{widget}",
    response_class=HTMLResponse,
    summary="The page of the places that operators save",
    responses=errors(403, 404, 422),
)
async def page(
    widget: WidgetId,
    request: Request,
    state: CurrentState,
    session: CurrentSession,
    query: Annotated[PlacesQuery, Query()],
) -> Response:
    chosen, its = _input(state, session, widget)
    needs = {PLACE_ACTS["save"].needs, *needs_of_places(state.fleet.panel, widget)}
    role = role_verdict(needs, caller_of(request).principal)
    said = said_of(query.act, [its.place_acts.runner] if its.place_acts else ())
    lock, typed = (role.reason or "") if role else "", refused_form(request, state).typed
    context = places_context(its, chosen, query, lock, said, typed)
    shown = query.model_dump(exclude_defaults=True, include={"mode", "value", "place"})
    path = f"/places/{widget}" + (f"?{urlencode(shown)}" if shown else "")
    robot = its.entry.id if its.entry else ""
    framed = FramedPage("places.html", word("title"), path, "places", robot)
    here = f"{its.base}/places/{widget}"
    return framed_page(request, state, framed, {**context, "word": word, "here": here})


@router.post(
    "/places/{widget}/{act}",
    response_model=PlaceReceipt,
    summary="Save or delete a place",
    responses=act_responses(PlaceReceipt),
    openapi_extra=described_body(PlaceActBody, ACT_FORM.schema, required=False),
)
async def act(
    widget: WidgetId, act: ActName, request: Request, state: CurrentState, session: CurrentSession
) -> Response:
    _, its = _input(state, session, widget)
    runner = _acts(its).runner
    sent = await sent_act(request, state, PlaceActBody, ACT_FORM)
    body = sent.body
    asked = sent.asked(act, widget, body.inputs)
    receipt = await sent.run(runner, asked, sent.act_id(act))
    query = {} if receipt.done else {"place": body.place, "value": body.value}
    if not receipt.done:
        query["mode"] = act
    shown = urlencode({name: text for name, text in query.items() if text})
    return sent.answer(receipt, f"{its.base}/places/{widget}" + (f"?{shown}" if shown else ""))


def _input(state: CurrentState, session: RobotSession, widget: str) -> tuple[PlaceInput, RobotSession]:
    """The input, and the session of its robot; NotFound for another id."""
    its = state.fleet.session_for(session, widget)
    chosen = its.place_acts.places.input(widget) if its.place_acts else None
    if chosen is None:
        raise NotFound(f'there is no input "{widget:.64}" with save = true on this panel')
    return chosen, its

"""Recipes: their page, the acts on them, and CSV. JSON for programs, forms for pages. Loading a recipe
is a press of its set (`POST /widgets/{set}`)."""

import re
import secrets
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Annotated, Any, Final
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, JsonValue, WithJsonSchema

from app.commands.act_receipt import ActReceipt
from app.commands.acts import ActRequest
from app.commands.press import PRESS_ID
from app.commands.press_limits import RETRY_AFTER_S
from app.errors import InputError, NotFound
from app.i18n import Text, TextLike, localized, say
from app.recipes.book import RecipeBook
from app.recipes.csv_text import csv_text
from app.recipes.recipe import clean_name
from app.runtime.robot_session import RobotSession
from app.web.app_state import AppState, CurrentSession, CurrentState
from app.web.client_cookie import principal_with_new_token, set_client_cookie
from app.web.framed_page import FramedPage, framed_page
from app.web.language import language_of
from app.web.openapi_parts import FORM, JSON, TEXT, described_body, errors, fields, refusals
from app.web.rendering.recipe_ask import recipe_ask
from app.web.rendering.recipes_page import Mode, entries_of, recipes_context, word
from app.web.request_body import as_model, body_of, form_of, json_of, kind_of
from app.web.routes.confirm_forms import entered_fields
from app.web.routes.press_forms import is_second_tap
from app.web.routes.presses import STATUS
from app.web.routes.recipe_confirm import ActName, Edit, SetId, confirmed_edit

router = APIRouter()

TOO_OFTEN: Final = say("control_too_often")
TOO_SOON: Final = say("press_too_soon")
CSV: Final = "text/csv"
RecipeId = Annotated[str, Field(max_length=64)]
# Fields of a form that are not the value of an input: "-" stands before them, as before no input.
OWN_FIELDS: Final = ("id", "recipe", "version", "to", "name", "csv")


VALUES: Final = {"type": "object", "description": "values by the ids of inputs"}


class RecipesQuery(BaseModel):
    """What the page shows; `act` is the id of an act, `receipt` that of a press, whose receipt is
    shown."""

    model_config = ConfigDict(extra="forbid")

    recipe: RecipeId = ""
    mode: Mode = "show"
    act: Annotated[str, Field(max_length=400)] = ""
    receipt: Annotated[str, Field(max_length=400)] = ""
    control: Annotated[str, Field(max_length=400)] = ""
    reloaded: bool = False


class RecipeActBody(BaseModel):
    """`version` is that which the screen showed, `to` the one to restore. The same `id` again is the
    same act. `at` is when it was touched, in the server's own time."""

    model_config = ConfigDict(extra="forbid")

    recipe: RecipeId = ""
    version: Annotated[int, Field(ge=0, lt=2**53)] | None = None
    to: Annotated[int, Field(ge=0, lt=2**53)] | None = None
    name: Annotated[str, Field(max_length=500)] | None = None
    values: Annotated[dict[str, JsonValue], WithJsonSchema(VALUES)] | None = None
    csv: str | None = None
    id: Annotated[str, Field(pattern=PRESS_ID)] | None = None
    at: AwareDatetime | None = None

    @property
    def inputs(self) -> dict[str, Any]:
        """What the act needs, and the log keeps."""
        return self.model_dump(include={"version", "to", "name", "values", "csv"}, exclude_none=True)


class RecipeReceipt(BaseModel):
    """The receipt of an act, as that of a press; `done`: it was applied."""

    id: str
    act: str
    outcome: str
    code: str
    reason: str
    at: str
    done: bool


FORM_PARTS: Final[Mapping[str, dict[str, Any]]] = {
    "-id": {"pattern": PRESS_ID},
    "-recipe": {},
    "-version": {"pattern": "^[0-9]{1,15}$"},
    "-to": {"pattern": "^[0-9]{1,15}$"},
    "-name": {"maxLength": 500},
    "-csv": {},
    "_since": {"description": "when the page was rendered, in the server's own time"},
}


@router.get("/recipes", summary="The page of the first set of recipes", responses=errors(403, 404))
async def first(state: CurrentState, session: CurrentSession) -> Response:
    loads = session.panel.recipe_loads or state.fleet.panel.recipe_loads
    if not loads:
        raise NotFound("this panel has no recipes")
    its = _session_of(state, session, loads[0].id)
    return RedirectResponse(f"{its.base}/recipes/{loads[0].id}", status_code=303)


@router.get(
    "/recipes/{set}.csv",
    response_class=Response,
    summary="The recipes of a set as CSV",
    responses=errors(403, 404) | {200: {"content": {CSV: {"schema": TEXT}}}},
)
async def as_csv(set: SetId, state: CurrentState) -> Response:
    book = _book(state, set)
    at = {r.id: datetime.fromtimestamp(r.now.at, UTC).isoformat("T", "seconds") for r in book.recipes}
    headers = {"content-disposition": f'attachment; filename="{set}.csv"', "cache-control": "no-store"}
    text = csv_text(book.load.fields, book.recipes, at)
    return Response(text.encode(), media_type=f"{CSV}; charset=utf-8", headers=headers)


@router.get(
    "/recipes/{set}",
    response_class=HTMLResponse,
    summary="The page of a set of recipes",
    responses=errors(403, 404, 422)
    | {303: {"description": "to the first robot that has it, of several"}},
)
async def page(
    set: SetId,
    request: Request,
    state: CurrentState,
    session: CurrentSession,
    query: Annotated[RecipesQuery, Query()],
) -> Response:
    book = _book(state, set)
    if (its := _session_of(state, session, set)) is not session:
        return RedirectResponse(f"{its.base}/recipes/{set}", status_code=303)
    loads = session.panel.recipe_loads
    said = _said(session, query.act)
    context = recipes_context(book, loads, session.robot, query.recipe, query.mode, said)
    chosen = context["chosen"]
    shown = chosen.id if chosen else ""
    path = f"recipes/{set}?{urlencode({'recipe': shown, 'mode': context['mode']})}"
    robot = session.entry.id if session.entry else ""
    entries = entries_of(book.load, context["mode"])
    framed = FramedPage("recipes.html", word("title"), robot, recipes_page=path, entries=entries)
    question = recipe_ask(session, book.load, chosen) if chosen and book.load.asks else None
    return framed_page(request, state, framed, {**context, "word": word, "question": question})


@router.post(
    "/recipes/{set}/{act}",
    response_model=RecipeReceipt,
    summary="Make, change, restore or delete a recipe, or import some",
    responses=errors(404, 408, 413, 422)
    | refusals(RecipeReceipt)
    | {
        303: {"description": "of a form: back to the page, with the receipt on it"},
        503: {"model": RecipeReceipt, "description": "the disk or the operator's log refuses it"},
    },
    openapi_extra=described_body(
        RecipeActBody,
        {**fields(**FORM_PARTS), "additionalProperties": {"type": "string"}},
        required=False,
    ),
)
async def act(
    set: SetId, act: ActName, request: Request, state: CurrentState, session: CurrentSession
) -> Response:
    book, kind, content = _book(state, set), kind_of(request), await body_of(request)
    session = _session_of(state, session, set)
    form = form_of(content) if kind == FORM else None
    entered = entered_fields(form) if form is not None else {}
    body = (
        _form_body(book, act, form, language_of(request)) if form is not None else _body(kind, content)
    )
    who, token = principal_with_new_token(request, state)
    act_id = f"{body.id}.{act}.{body.recipe}"[:400] if body.id else secrets.token_hex(8)
    at = body.at.timestamp() if body.at else None
    confirmed, asking = None, None
    if form is not None:
        edit = Edit(book, act, body.recipe, body.inputs, form, entered)
        confirmed, asking = await confirmed_edit(request, state, session, edit)
    if asking is not None:
        return asking
    asked = ActRequest(act, who, f"{set}/{body.recipe}", body.inputs, at, form is None)
    asked = asked._replace(confirmed=confirmed)
    runner = session.recipe_acts
    refusal = TOO_SOON if form is not None and is_second_tap(form) else None
    if not state.limits.admit(who):
        refusal = TOO_OFTEN
    with state.in_flight.track():
        receipt = (
            await runner.act(asked, act_id)
            if refusal is None
            else runner.limited(asked, act_id, refusal)
        )
    if form is None:
        answer: Response = _receipt(request, receipt)
    else:
        answer = _back(session, set, act, body, receipt, book)
    return set_client_cookie(answer, request, token)


def _book(state: AppState, set_id: str) -> RecipeBook:
    book = state.fleet.recipes.book(set_id)
    if book is None:
        raise NotFound(f'there are no recipes "{set_id:.64}" on this panel')
    return book


def _session_of(state: AppState, session: RobotSession, set_id: str) -> RobotSession:
    """The session of a robot that has the set: this one, else the first that has it."""
    every = (session, *state.fleet.sessions)
    return next(s for s in every if any(load.id == set_id for load in s.panel.recipe_loads))


def _body(kind: str, content: bytes) -> RecipeActBody:
    if kind == CSV:
        try:
            return RecipeActBody(csv=content.decode("utf-8-sig"))
        except UnicodeDecodeError:
            raise InputError("the file is not UTF-8") from None
    if kind not in (JSON, ""):
        raise InputError(f'the body must be "{JSON}", "{CSV}" or "{FORM}", not "{kind}"')
    return as_model(RecipeActBody, json_of(content or b"{}"))


def _form_body(book: RecipeBook, act: str, form: Mapping[str, str], language: str) -> RecipeActBody:
    """The body of a form: its other fields are the values of inputs, as the reader writes them."""
    known = {field.id: field for field in book.load.fields}
    own: dict[str, Any] = {key: form[f"-{key}"] for key in OWN_FIELDS if form.get(f"-{key}")}
    for key in ("version", "to"):
        if key in own:
            if not re.fullmatch(r"[0-9]{1,15}", own[key]):
                raise InputError(f"{key}: is not the number of a version")
            own[key] = int(own[key])
    typed = {key: value for key, value in form.items() if key in known}
    if act in ("save", "create"):
        own["values"] = {key: known[key].parse_text(text, language) for key, text in typed.items()}
    if act in ("create", "copy", "rename"):
        own.setdefault("name", "")
    if act == "import":
        own.setdefault("csv", "")
    for key in form:
        if key not in known and key != "_since" and key.removeprefix("-") not in OWN_FIELDS:
            raise InputError(f'the form has an unknown field "{key:.40}"')
    return as_model(RecipeActBody, own)


def _receipt(request: Request, receipt: ActReceipt) -> Response:
    content = localized({**receipt.as_json(), "done": receipt.done}, language_of(request))
    headers = {"retry-after": str(RETRY_AFTER_S)} if receipt.cause == "limit" else None
    return JSONResponse(content, status_code=STATUS[receipt.cause], headers=headers)


def _back(
    session: RobotSession,
    set_id: str,
    act: str,
    body: RecipeActBody,
    receipt: ActReceipt,
    book: RecipeBook,
) -> Response:
    """A redirect to the page, which shows the recipe and what the receipt says."""
    recipe = body.recipe
    if receipt.done and act in ("create", "copy"):
        name = clean_name(body.name or "").casefold()
        recipe = next((r.id for r in book.recipes if r.name.casefold() == name), recipe)
    query = {"recipe": recipe} if recipe and not (receipt.done and act == "delete") else {}
    if receipt.reason:
        query["act"] = receipt.code if receipt.cause == "limit" else receipt.id
    path = f"{session.base}/recipes/{set_id}"
    return RedirectResponse(f"{path}?{urlencode(query)}" if query else path, status_code=303)


def _said(session: RobotSession, query: str) -> TextLike:
    """What the receipt of an act says: `query` is its id, or the code where it is not kept."""
    known: Mapping[str, Text] = {text.code: text for text in (TOO_OFTEN, TOO_SOON)}
    if query in known:
        return known[query]
    receipt = session.recipe_acts.receipt(query) if query else None
    return receipt.reason if receipt else ""

"""Recipes: their page, the acts on them, and CSV. JSON for programs, forms for pages. Loading a recipe
is a press of its set (`POST /widgets/{set}`)."""

import asyncio
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from functools import partial
from typing import Annotated, Any, Final, Literal, NamedTuple
from urllib.parse import urlencode

from fastapi import APIRouter, Path, Query, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from pydantic import BaseModel, ConfigDict, Field, JsonValue, WithJsonSchema

from app.cell.commands.acts import ActReceipt
from app.cell.commands.press import PRESS_ID
from app.cell.commands.recipe_acts import RECIPE_ACTS
from app.cell.permission.roles import ConfirmedBy, role_verdict
from app.cell.recipes.book import RecipeBook
from app.cell.recipes.recipe import (
    MAX_CSV_BYTES,
    BadRow,
    ReadRow,
    clean_name,
    decoded,
    differences,
    read_rows,
    recipes_csv,
    value_text,
)
from app.cell.session.session import RobotSession
from app.panel.base import ID
from app.panel.widgets.families import Input
from app.system.errors import InputError, NotFound
from app.system.texts import TextLike, number, say
from app.web.acts import (
    ActBody,
    UnreadableEntry,
    act_responses,
    entered_again,
    refused_form,
    said_of,
    sent_with,
)
from app.web.answers import ActAnswer
from app.web.app_state import AppState, CurrentSession, CurrentState
from app.web.caller import caller_of
from app.web.pages.confirm import Subject, confirm_sheet, recipe_ask
from app.web.pages.context import FramedPage, framed_page
from app.web.pages.recipe_comparison import comparison, seen_of
from app.web.pages.recipes_page import Mode, entries_of, recipes_context, word
from app.web.pages.words import Ask, AskedChange
from app.web.requests import (
    LONGEST,
    SINCE,
    TEXT,
    FormFields,
    act_body_of,
    described_body,
    errors,
    is_second_tap,
)
from app.web.routes.confirm import checked_entry, entered_fields

# Changes of recipes that a person confirms with a PIN, password or badge: the page that asks for it.
#
# Only forms can be confirmed, which the pages of recipes send with scripts and without.

router = APIRouter()

WORDS: Final = {"create": "new", "save": "save"}  # of acts whose word has another name
# What the page shows for the form of an act.
FORMS: Final[Mapping[str, Mode]] = {
    "create": "new",
    "save": "edit",
    "copy": "copy",
    "rename": "rename",
    "restore": "history",
    "delete": "delete",
    "import": "csv",
}


SetId = Annotated[str, Path(pattern=ID, description="the id of a [[recipe]]")]
ActName = Annotated[str, Path(json_schema_extra={"enum": list(RECIPE_ACTS)})]


class Edit(NamedTuple):
    """An act on a recipe of a set as a form has it: `values` are what it sends."""

    book: RecipeBook
    act: str
    recipe: str
    values: dict[str, Any]
    form: dict[str, str]
    entered: dict[str, str]


@router.get(
    "/recipes/{set}/{act}",
    summary="Back to the set: a page that asks for a PIN is not loaded again",
    responses=errors(403, 404, 422) | {303: {"description": "to the page of the set"}},
)
async def asked_before(
    set: SetId, act: ActName, state: CurrentState, session: CurrentSession
) -> Response:
    if state.fleet.recipes.book(set) is None:
        raise NotFound(f'there are no recipes "{set:.64}" on this panel')
    return RedirectResponse(f"{session.base}/recipes/{set}", status_code=303)


@router.get(
    "/recipes/{set}/import",
    summary="Back to the set: the page that compares an import is not loaded again",
    responses=errors(403, 404, 422) | {303: {"description": "to the page of the set"}},
)
async def compared_before(set: SetId, state: CurrentState, session: CurrentSession) -> Response:
    return await asked_before(set, "import", state, session)


async def confirmed_edit(
    request: Request, state: AppState, session: RobotSession, edit: Edit
) -> tuple[ConfirmedBy | None, Response | None]:
    """Who has confirmed an act; else the page that asks. (None, None) for one that needs none, or
    that is refused without a PIN."""
    client, subject = caller_of(request), _subject(edit)
    who = client.principal
    if subject is None or not who.user or role_verdict(subject.needs, who):
        return None, None
    entered = edit.entered
    failed: TextLike = ""
    too_soon = is_second_tap(edit.form)
    typed = any(entered[name] for name in ("_pin", "_password", "_badge"))  # no second tap types
    if entered["_enter"] and (typed or not too_soon):
        by, checked = await checked_entry(state, subject, edit.act, client, entered)
        if by is not None:
            edit.form.pop("_since", None)
            return by, None
        failed = checked.reason
        if checked.tries_left:
            failed = say("signin_tries_left", why=failed, count=str(checked.tries_left))
    elif not entered["_enter"] and too_soon:
        return None, None
    set_id, base = edit.book.load.id, session.base
    context: dict[str, Any] = {
        **confirm_sheet(state, subject, who, entered["_user"]),
        "action": f"{base}/recipes/{set_id}/{edit.act}",
        "away": f"{base}/recipes/{set_id}" + (f"?recipe={edit.recipe}" if edit.recipe else ""),
        "no": say("back"),
        "fields": {name: text for name, text in edit.form.items() if name != "_since"},
        "failed": failed,
    }
    robot = session.entry.id if session.entry else ""
    path = f"/recipes/{set_id}"
    framed = FramedPage("alarm-confirm.html", word("title"), path, "recipes", robot)
    return None, framed_page(request, state, framed, context)


def _subject(edit: Edit) -> Subject | None:
    """What is confirmed; None for a set whose changes need none."""
    load = edit.book.load
    confirmation = load.set.confirm_edit
    if confirmation is None:
        return None
    recipe = edit.book.recipe(edit.recipe)
    act = word(WORDS.get(edit.act, edit.act))
    new = edit.values.get("values")
    old = recipe.values if recipe is not None else {}
    known = {field.id: field for field in load.fields}
    changed = differences(known, old, new) if isinstance(new, dict) else []
    changes = [
        AskedChange(
            known[change.field].label,
            value_text(known[change.field], change.old),
            value_text(known[change.field], change.new),
        )
        for change in changed
    ]
    name = edit.values.get("name") or (recipe.name if recipe is not None else load.label)
    ask = Ask(
        sentence=say("alarms_confirm", act=act, alarm=name),
        inputs=[],
        changes=changes,
        note=word("loads", count=number(str(len(changes)))) if changes else "",
    )
    needs = frozenset({RECIPE_ACTS[edit.act].needs})
    return Subject(f"recipe {load.id}", confirmation, needs, ask, act)


CSV: Final = "text/csv"
RecipeId = Annotated[str, Field(max_length=64)]
# Fields of a form that are not the value of an input: "-" stands before them, as before no input.
OWN_FIELDS: Final = ("id", "recipe", "version", "to", "name", "csv", "decimal", "seen")


FILES: Final = {CSV: lambda content: {"csv": decoded(content)}}
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


class RecipeActBody(ActBody):
    """`version` is that which the screen showed, `to` the one to restore. `decimal` is the decimal sign
    of the `csv`, where the file does not say it; `seen` is the comparison that a page has shown. The
    same `id` again is the same act. `at` is when it was touched, in the server's own time."""

    recipe: RecipeId = ""
    version: Annotated[int, Field(ge=0, lt=2**53)] | None = None
    to: Annotated[int, Field(ge=0, lt=2**53)] | None = None
    name: Annotated[str, Field(max_length=500)] | None = None
    values: Annotated[dict[str, JsonValue], WithJsonSchema(VALUES)] | None = None
    csv: str | None = None
    decimal: Literal[".", ","] | None = None
    seen: Annotated[str, Field(max_length=80)] = ""

    @property
    def inputs(self) -> dict[str, Any]:
        """What the act needs, and the log keeps."""
        return self.model_dump(
            include={"version", "to", "name", "values", "csv", "decimal"}, exclude_none=True
        )


class RecipeReceipt(ActAnswer):
    """The receipt of an act, as that of a press; `done`: it was applied."""


ACT_FORM: Final = FormFields(
    {
        "-id": {"pattern": PRESS_ID},
        "-recipe": {"maxLength": 64},
        "-version": {"pattern": "^[0-9]{1,15}$"},
        "-to": {"pattern": "^[0-9]{1,15}$"},
        "-name": {"maxLength": 500},
        "-csv": {},
        "-decimal": {"enum": [".", ","]},
        "-seen": {"maxLength": 80},
        "_since": SINCE,
    },
    has_values=True,
)


@router.get("/recipes", summary="The page of the first set of recipes", responses=errors(403, 404))
async def first(state: CurrentState, session: CurrentSession) -> Response:
    loads = session.panel.recipe_loads or state.fleet.panel.recipe_loads
    if not loads:
        raise NotFound(say("recipes_none_on_panel"))
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
    text = recipes_csv(book.load.fields, book.recipes, at)
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
    refused = refused_form(request, state)
    said = refused.reason or said_of(query.act, [session.recipe_acts])
    about = (query.recipe, query.mode, said, refused.typed)
    context = recipes_context(book, loads, session.robot, *about)
    chosen = context["chosen"]
    shown = chosen.id if chosen else ""
    path = f"/recipes/{set}?{urlencode({'recipe': shown, 'mode': context['mode']})}"
    robot = session.entry.id if session.entry else ""
    entries = entries_of(book.load, context["mode"])
    framed = FramedPage("recipes.html", word("title"), path, "recipes", robot, entries)
    question = recipe_ask(session, book.load, chosen) if chosen and book.load.asks else None
    more = {"word": word, "question": question, "comparison": None}
    return framed_page(request, state, framed, {**context, **more})


ACT_RESPONSES: Final = act_responses(RecipeReceipt)
ACT_BODY: Final = described_body(RecipeActBody, ACT_FORM.schema, required=False)


@router.post(
    "/recipes/{set}/import",
    response_model=RecipeReceipt,
    summary="Import recipes",
    responses=ACT_RESPONSES,
    openapi_extra=ACT_BODY,
    max_body_size=3 * MAX_CSV_BYTES + LONGEST,  # a form has up to three bytes for each
)
async def import_csv(
    set: SetId, request: Request, state: CurrentState, session: CurrentSession
) -> Response:
    return await act(set, "import", request, state, session)


@router.post(
    "/recipes/{set}/{act}",
    response_model=RecipeReceipt,
    summary="Make, change, restore or delete a recipe",
    responses=ACT_RESPONSES,
    openapi_extra=ACT_BODY,
)
async def act(
    set: SetId, act: ActName, request: Request, state: CurrentState, session: CurrentSession
) -> Response:
    book, session = _book(state, set), _session_of(state, session, set)
    is_form, content = await act_body_of(request, ACT_FORM, files=FILES)
    entered = entered_fields(content) if is_form else {}
    read_form = partial(_form_body, book, act, caller_of(request).language)
    try:
        sent = sent_with(request, state, RecipeActBody, ACT_FORM, content, is_form, read_form)
    except UnreadableEntry as error:
        page = _form_page(session, set, act, content.get("-recipe", ""))
        return entered_again(request, state, page, ACT_FORM.typed(content), error.text)
    body, confirmed, read = sent.body, None, await _read(book, act, sent.body)
    if is_form:
        if read and body.seen != seen_of(book, body.csv, body.decimal):
            compared = _compared(request, state, session, Import(book, body, read["rows"]))
            return sent.with_cookie(compared)
        edit = Edit(book, act, body.recipe, body.inputs, content, entered)
        confirmed, asking = await confirmed_edit(request, state, session, edit)
        if asking is not None:
            return asking
    asked = sent.asked(act, f"{set}/{body.recipe}", body.inputs)
    asked = asked._replace(confirmed=confirmed, read=read)
    receipt = await sent.run(session.recipe_acts, asked, sent.act_id(act, body.recipe))
    return sent.answer(receipt, _shown(session, book, body, receipt))


def _book(state: AppState, set_id: str) -> RecipeBook:
    book = state.fleet.recipes.book(set_id)
    if book is None:
        raise NotFound(f'there are no recipes "{set_id:.64}" on this panel')
    return book


def _session_of(state: AppState, session: RobotSession, set_id: str) -> RobotSession:
    """The session of a robot that has the set: this one, else the first that has it."""
    every = (session, *state.fleet.sessions)
    return next(s for s in every if any(load.id == set_id for load in s.panel.recipe_loads))


class Import(NamedTuple):
    """An import of a form, with the rows that were read."""

    book: RecipeBook
    body: RecipeActBody
    rows: Sequence[ReadRow | BadRow]


def _compared(request: Request, state: AppState, session: RobotSession, asked: Import) -> Response:
    """The page that shows what an import would change, before anything is taken."""
    book, body, rows = asked
    loads = session.panel.recipe_loads
    context = recipes_context(book, loads, session.robot, body.recipe, "csv", "")
    seen = seen_of(book, body.csv, body.decimal)
    shown = comparison(book, rows, body.csv or "", body.decimal or "", seen)
    robot = session.entry.id if session.entry else ""
    path = f"/recipes/{book.load.id}?mode=csv"
    framed = FramedPage("recipes.html", word("title"), path, "recipes", robot)
    more = {"word": word, "question": None, "comparison": shown}
    return framed_page(request, state, framed, {**context, **more})


def _form_body(book: RecipeBook, act: str, language: str, form: Mapping[str, str]) -> dict[str, Any]:
    """The body of a form: its other fields are the values of inputs, as the reader writes them."""
    known = {field.id: field for field in book.load.fields}
    own: dict[str, Any] = {key: form[f"-{key}"] for key in OWN_FIELDS if f"-{key}" in form}
    for key in ("version", "to"):
        if key in own:
            own[key] = int(own[key])
    typed = {key: value for key, value in form.items() if key in known}
    if act in ("save", "create"):
        own["values"] = {key: _entry(known[key], text, language) for key, text in typed.items()}
    if act in ("create", "copy", "rename"):
        own.setdefault("name", "")
    if act == "import":
        own.setdefault("csv", "")
    for key in form:
        if key not in known and key != "_since" and key.removeprefix("-") not in OWN_FIELDS:
            raise InputError(f'the form has an unknown field "{key:.40}"')
    return own


def _entry(field: Input, text: str, language: str) -> Any:
    try:
        return field.parse_text(text, language)
    except InputError as error:
        raise UnreadableEntry(error.text) from None


async def _read(book: RecipeBook, act: str, body: RecipeActBody) -> Mapping[str, Any]:
    """The rows of an import, read on a thread: they may be many."""
    if act != "import" or body.csv is None:
        return {}
    if len(body.csv.encode("utf-8", "surrogatepass")) > MAX_CSV_BYTES:
        raise InputError(f"csv is longer than {MAX_CSV_BYTES // 1_000_000} MB")
    rows = read_rows(body.csv, book.load.fields, body.decimal or "")
    return {"rows": await asyncio.to_thread(list, rows)}


def _shown(session: RobotSession, book: RecipeBook, body: RecipeActBody, receipt: ActReceipt) -> str:
    """The page of the set after an act, with the recipe that it shows; the form again if it was
    refused."""
    if not receipt.done:
        return _form_page(session, book.load.id, receipt.act, body.recipe)
    recipe = body.recipe
    if receipt.act in ("create", "copy"):
        name = clean_name(body.name or "").casefold()
        recipe = next((r.id for r in book.recipes if r.name.casefold() == name), recipe)
    path = f"{session.base}/recipes/{book.load.id}"
    is_gone = receipt.act == "delete"
    return f"{path}?{urlencode({'recipe': recipe})}" if recipe and not is_gone else path


def _form_page(session: RobotSession, set_id: str, act: str, recipe: str) -> str:
    """The page with the form of an act."""
    query = {"recipe": recipe} if recipe else {}
    return f"{session.base}/recipes/{set_id}?{urlencode({**query, 'mode': FORMS[act]})}"

"""Changes of recipes that a person confirms with a PIN, password or badge: the page that asks for it.

Only forms can be confirmed, which the pages of recipes send with scripts and without.
"""

from typing import Annotated, Any, Final, NamedTuple

from fastapi import APIRouter, Path, Request
from fastapi.responses import RedirectResponse, Response

from app.commands.recipe_acts import RECIPE_ACTS
from app.errors import NotFound
from app.i18n import TextLike, number, say
from app.panel.base import ID
from app.permission.confirmations import ConfirmedBy
from app.permission.role_locks import role_verdict
from app.recipes.book import RecipeBook
from app.recipes.field_text import value_text
from app.recipes.recipe import differences
from app.runtime.robot_session import RobotSession
from app.web.app_state import AppState, CurrentSession, CurrentState
from app.web.client_cookie import caller
from app.web.framed_page import FramedPage, framed_page
from app.web.openapi_parts import errors
from app.web.rendering.confirm_sheet import Subject, confirm_sheet, digits_key
from app.web.rendering.page_words import Ask, AskedChange
from app.web.rendering.recipes_page import word
from app.web.routes.confirm_forms import ConfirmForm, checked_entry
from app.web.routes.press_forms import is_second_tap

router = APIRouter()

WORDS: Final = {"create": "new", "save": "save"}  # of acts whose word has another name


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


async def confirmed_edit(
    request: Request, state: AppState, session: RobotSession, edit: Edit
) -> tuple[ConfirmedBy | None, Response | None]:
    """Who has confirmed an act; else the page that asks. (None, None) for one that needs none, or
    that is refused without a PIN."""
    client, subject = caller(request), _subject(edit)
    who = client.principal(state)
    if subject is None or not who.user or role_verdict(subject.needs, who):
        return None, None
    entered, digit = edit.entered, edit.entered["_digit"]
    failed: TextLike = ""
    too_soon = is_second_tap(edit.form)
    typed = any(entered[name] for name in ("_pin", "_password", "_badge"))  # no second tap types
    if digit and digit != "enter":
        state.access.typed_digits.press(who.client.id, digits_key(subject.id), digit)
    elif digit and (typed or not too_soon):
        form = ConfirmForm(who, edit.form, client.session)
        by, checked = await checked_entry(state, subject, edit.act, form, entered)
        if by is not None:
            edit.form.pop("_since", None)
            return by, None
        failed = checked.reason
        if checked.tries_left:
            failed = say("signin_tries_left", why=failed, count=str(checked.tries_left))
    elif not digit and too_soon:
        return None, None
    set_id, base = edit.book.load.id, session.base
    context: dict[str, Any] = {
        **confirm_sheet(state, subject, who, entered["_user"]),
        "action": f"{base}/recipes/{set_id}/{edit.act}",
        "away": f"{base}/recipes/{set_id}" + (f"?recipe={edit.recipe}" if edit.recipe else ""),
        "no": say("back"),
        "fields": {name: text for name, text in edit.form.items() if name != "_since"},
        "failed": failed,
        "scripted": False,
    }
    robot = session.entry.id if session.entry else ""
    path = f"recipes/{set_id}"
    framed = FramedPage("alarm-confirm.html", word("title"), robot, recipes_page=path)
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

"""Acts of clients over HTTP: sent as JSON or by a form of a page, and answered for whom it is. Programs
and scripts get the receipt as JSON, a form the redirect to its page, which shows what the receipt says.

Every route of acts has these steps: `sent_act`, `SentAct.asked`, `SentAct.run`, `SentAct.answer`.
"""

import secrets
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Final, Generic, TypeVar
from urllib.parse import quote

from fastapi import Request
from fastapi.responses import RedirectResponse, Response
from pydantic import BaseModel, ConfigDict, Field

from app.cell.commands.acts import NO_VALUES, ActReceipt, ActRequest, ActRunner
from app.cell.commands.control_acts import TOO_OFTEN
from app.cell.commands.press import PRESS_ID
from app.records.principal import Principal
from app.system.errors import InputError
from app.system.texts import Text, TextLike, say
from app.web.answers import receipt_answer
from app.web.app_state import EMPTY_FORM, AppState, RefusedForm
from app.web.caller import Caller, caller_of
from app.web.requests import (
    LONGEST,
    Described,
    FormFields,
    Moment,
    act_body_of,
    as_model,
    errors,
    is_second_tap,
    refusals,
)

TOO_SOON: Final = say("press_too_soon")
BAD_ENTRY: Final = "entry"  # in the query of a page: what was entered could not be read
NOT_KEPT: Final[Mapping[str, Text]] = {text.code: text for text in (TOO_OFTEN, TOO_SOON)}
ID_MOST: Final = 400  # characters of an act's id
Content = Mapping[str, Any]
ReadForm = Callable[[Mapping[str, str]], Content]


class ActBody(BaseModel):
    """The same `id` again is the same act. `at` is when it was touched, in the server's own time."""

    model_config = ConfigDict(extra="forbid")

    id: Annotated[str, Field(pattern=PRESS_ID)] | None = None
    at: Moment | None = None


Body = TypeVar("Body", bound=ActBody)


def act_responses(model: type[BaseModel]) -> Described:
    """The responses of an act whose receipt is this model."""
    return (
        errors(404, 408, 413, 422)
        | refusals(model)
        | {
            303: {"description": "of a form: back to its page, with the receipt's id"},
            503: {"model": model, "description": "the operator's log can't be written"},
        }
    )


class UnreadableEntry(InputError):
    """What was entered in a field of a form is not what its input takes."""


@dataclass(frozen=True, slots=True)
class SentAct(Generic[Body]):
    """An act as a client sent it. `form` has the fields of a form, None for JSON; `typed` are those
    that its page shows again if it is refused. `token` is that of a new client, "" for a known one."""

    caller: Caller
    state: AppState
    body: Body
    form: Mapping[str, str] | None
    typed: Mapping[str, str]
    who: Principal
    token: str

    def act_id(self, *parts: str) -> str:
        """The id of the act, with `parts` where one page has one id for all its buttons, and each is an
        act of its own."""
        return ".".join((self.body.id, *parts))[:ID_MOST] if self.body.id else secrets.token_hex(8)

    def asked(self, act: str, about: str = "", values: Mapping[str, Any] = NO_VALUES) -> ActRequest:
        """The request for the act on the object `about`."""
        at = self.body.at.timestamp() if self.body.at else None
        return ActRequest(act, self.who, about, values, at, self.form is None)

    def refusal(self) -> Text | None:
        """Why it is refused before it is judged: the client sends too many, or a form came by the
        second tap of what brought its page."""
        if not self.state.limits.admit(self.who):
            return TOO_OFTEN
        return TOO_SOON if self.form is not None and is_second_tap(self.form) else None

    async def run(self, runner: ActRunner[Any], asked: ActRequest, act_id: str) -> ActReceipt:
        if (refusal := self.refusal()) is not None:
            return runner.limited(asked, act_id, refusal)
        with self.state.in_flight.track():
            return await runner.act(asked, act_id)

    def answer(self, receipt: ActReceipt, page: str, name: str = "act", **more: Any) -> Response:
        """The receipt, with `more` beside it; of a form the redirect to its page, whose query names the
        receipt if it says something."""
        if self.form is not None:
            return self.back(page, receipt if receipt.reason else None, name)
        content = {**receipt.as_json(), "done": receipt.done, **more}
        return self.with_cookie(receipt_answer(self.caller, content, receipt.cause))

    def back(self, page: str, receipt: ActReceipt | None, name: str = "act") -> Response:
        """The redirect to a page that shows a receipt, and what was typed if the act was refused."""
        if receipt is not None:
            shown = receipt.code if receipt.cause == "limit" else receipt.id
            page = _showing(page, name, shown)
            if not receipt.done:
                keep_form(self.state, self.who, RefusedForm(page, self.typed))
        return self.with_cookie(RedirectResponse(page, status_code=303))

    def with_cookie(self, answer: Response) -> Response:
        return self.caller.with_client_cookie(answer, self.token)


def said_of(query: str, runners: Iterable[ActRunner[Any]]) -> TextLike:
    """What a page shows of an earlier act: `query` is the id of its receipt, or the code of one that is
    not kept. "" without one."""
    if query in NOT_KEPT:
        return NOT_KEPT[query]
    receipts = (runner.receipt(query) for runner in runners) if query else ()
    return next((receipt.reason for receipt in receipts if receipt is not None), "")


def _showing(page: str, name: str, shown: str) -> str:
    return f"{page}{'&' if '?' in page else '?'}{name}={quote(shown, safe='')}"


def keep_form(state: AppState, who: Principal, form: RefusedForm) -> None:
    """Keeps what a client typed in a form that was refused, in place of its form before. A longer text
    is not kept: it comes from a file, which can be chosen again."""
    if sum(map(len, form.typed.values())) <= LONGEST:
        state.refused_forms[who.client.id, who.user] = form


def refused_form(request: Request, state: AppState) -> RefusedForm:
    """What the client typed, if the page of this request comes after the refusal of its form; else an
    empty form."""
    who = caller_of(request).principal
    form = state.refused_forms.get((who.client.id, who.user))
    address = f"{request.url.path}?{request.url.query}"
    return form if form is not None and form.page == address else EMPTY_FORM


def entered_again(
    request: Request, state: AppState, page: str, typed: Mapping[str, str], reason: TextLike
) -> Response:
    """The redirect of a form, of which an entry can't be read, to its page with what was typed."""
    caller = caller_of(request)
    who, token = caller.identified()
    page = _showing(page, "act", BAD_ENTRY)
    keep_form(state, who, RefusedForm(page, typed, reason))
    return caller.with_client_cookie(RedirectResponse(page, status_code=303), token)


async def sent_act(
    request: Request,
    state: AppState,
    model: type[Body],
    form: FormFields,
    read_form: ReadForm | None = None,
) -> SentAct[Body]:
    """The act of a request, whose form has these fields. `read_form` makes the body of a form; without
    it the fields that the model has are its body."""
    is_form, content = await act_body_of(request, form)
    return sent_with(request, state, model, form, content, is_form, read_form)


def sent_with(
    request: Request,
    state: AppState,
    model: type[Body],
    form: FormFields,
    content: Content,
    is_form: bool,
    read_form: ReadForm | None = None,
) -> SentAct[Body]:
    """The act of a request with this content; `form` are the fields that a form may have."""
    body = content
    if is_form:
        fields = model.model_fields
        body = read_form(content) if read_form else {k: v for k, v in content.items() if k in fields}
    act = as_model(model, body)
    caller = caller_of(request)
    who, token = caller.identified()
    typed = form.typed(content) if is_form else {}
    return SentAct(caller, state, act, content if is_form else None, typed, who, token)

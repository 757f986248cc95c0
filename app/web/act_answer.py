"""The answer to an act, such as taking control: its receipt, as JSON."""

from typing import Any

from fastapi import Request
from fastapi.responses import JSONResponse, Response
from pydantic import AwareDatetime, BaseModel

from app.commands.act_receipt import ActReceipt
from app.commands.press_limits import RETRY_AFTER_S
from app.i18n import localized
from app.web.language import language_of
from app.web.routes.presses import STATUS


class ActAnswer(BaseModel):
    """The receipt of an act: `reason` is "" where it was done, `code` is its stable name."""

    id: str
    act: str
    outcome: str
    code: str
    reason: str
    at: AwareDatetime
    done: bool


def act_answer(request: Request, receipt: ActReceipt, **more: Any) -> Response:
    """The receipt in the language of the request, with `more` beside it."""
    content = localized({**receipt.as_json(), "done": receipt.done, **more}, language_of(request))
    headers = {"retry-after": str(RETRY_AFTER_S)} if receipt.cause == "limit" else None
    return JSONResponse(content, status_code=STATUS[receipt.cause], headers=headers)

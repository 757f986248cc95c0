"""The responses to acts and presses: receipts as JSON, and their HTTP status."""

from collections.abc import Mapping
from typing import Annotated, Any, Final

from fastapi.responses import JSONResponse, Response
from pydantic import AwareDatetime, BaseModel, Field, JsonValue

from app.cell.commands.judge import RETRY_AFTER_S
from app.system.texts import localized
from app.web.caller import Caller

# The receipt of a press as JSON, and the HTTP status by the cause of its refusal.

STATUS: Final[Mapping[str, int]] = {
    "": 200,
    "interlock": 409,
    "input": 422,
    "link": 503,
    "log": 503,
    "time": 504,
    "limit": 429,
    "role": 403,
}


class ReceiptAnswer(BaseModel):
    """The receipt of a press. That of a stop button has `brief`; that of a press which stops several
    robots has the receipt of each."""

    id: str
    widget: str
    outcome: str
    code: Annotated[str | None, Field(description="the stable name of the reason, null without one")]
    reason: Annotated[str, Field(description="a sentence for the operator, in the request's language")]
    at: AwareDatetime
    brief: Annotated[str | None, Field(description="the same in a few words, of a stop button")] = None
    receipts: Annotated[list[dict[str, JsonValue]] | None, Field(description="of each robot")] = None


# The answer to an act, such as taking control: its receipt, as JSON.


class ActAnswer(BaseModel):
    """The receipt of an act: `reason` is "" where it was done, `code` is its stable name."""

    id: str
    act: str
    outcome: str
    code: str
    reason: str
    at: AwareDatetime
    done: bool


def receipt_answer(caller: Caller, content: Mapping[str, Any], cause: str) -> Response:
    """Receipts as JSON, in the language of who asks; `cause` is why the first that was not done was
    refused."""
    headers = {"cache-control": "no-store"}
    if cause == "limit":
        headers["retry-after"] = str(RETRY_AFTER_S)
    return JSONResponse(localized(content, caller.language), STATUS[cause], headers)

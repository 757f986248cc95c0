"""The receipt of a press as JSON."""

from typing import Annotated

from pydantic import AwareDatetime, BaseModel, Field


class ReceiptAnswer(BaseModel):
    """The receipt of a press."""

    id: str
    widget: str
    outcome: str
    code: Annotated[str | None, Field(description="the stable name of the reason, null without one")]
    reason: Annotated[str, Field(description="a sentence for the operator, in the request's language")]
    at: AwareDatetime

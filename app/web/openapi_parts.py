"""Parts of openapi.json that several routes share: error responses and request bodies."""

from typing import Any, Final

from pydantic import BaseModel

JSON: Final = "application/json"
FORM: Final = "application/x-www-form-urlencoded"
TEXT: Final = {"type": "string"}

Described = dict[int | str, dict[str, Any]]


class ErrorAnswer(BaseModel):
    """What is wrong, in a sentence; a client that accepts `text/html` gets it as a page."""

    error: str


REASONS: Final = {
    403: "by another site's page, or under a name that the panel does not have",
    404: "there is no such thing on this panel",
    408: "the body took too long",
    413: "the body is too large",
    422: "it is not what this description says",
    429: "too many requests, or others do that already; `Retry-After` says when to try again",
    503: "the operator's log can't be read",
}
PAGE: Final = {"text/html": {"schema": TEXT}}


def errors(*statuses: int) -> Described:
    """The error responses of a route; each may be answered 429."""
    content = {JSON: {"schema": ErrorAnswer.model_json_schema()}, **PAGE}
    return {status: {"description": REASONS[status], "content": content} for status in (*statuses, 429)}


def refusals(model: type[BaseModel]) -> Described:
    """The responses of what is judged where it is made: receipts of this model."""
    return {
        403: {
            "model": model | ErrorAnswer,
            "description": f"without the role; {REASONS[403]}",
            "content": PAGE,
        },
        409: {"model": model, "description": "it was not done"},
        429: {
            "model": model,
            "description": "more than a client may",
            "headers": {"Retry-After": {"description": "seconds", "schema": {"type": "integer"}}},
        },
    }


def described_body(
    model: type[BaseModel] | None, form: dict[str, Any] | None, *, required: bool
) -> dict[str, Any]:
    """The `openapi_extra` of a route that reads JSON, a form or either."""
    content = {JSON: {"schema": model.model_json_schema()}} if model else {}
    if form is not None:
        content[FORM] = {"schema": form}
    return {"requestBody": {"required": required, "content": content}}


def fields(**texts: dict[str, Any]) -> dict[str, Any]:
    """The schema of a form with these fields and no others."""
    properties = {name: {**TEXT, **about} for name, about in texts.items()}
    return {"type": "object", "properties": properties, "additionalProperties": False}

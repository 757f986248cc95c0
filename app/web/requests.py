"""What clients send: JSON, forms and times; and how openapi.json describes requests and responses."""

import asyncio
import json
import re
from collections.abc import Callable, Mapping
from datetime import datetime
from typing import Annotated, Any, Final, TypeVar
from urllib.parse import parse_qsl

from fastapi import Request, WebSocket
from pydantic import AwareDatetime, BaseModel, BeforeValidator, JsonValue, ValidationError
from pydantic import Field as PydanticField
from starlette.types import Message

from app.system import clock
from app.system.errors import InputError, TooSlow

# Parts of openapi.json that several routes share: error responses and request bodies.

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
            "model": model | ErrorAnswer,
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


# The fields of forms, each described once: for openapi.json, and to be checked.
#
# An empty field is none: a browser sends every field of a form, also those that no one has filled in.

Field = Mapping[str, Any]  # with `pattern`, `enum` or `maxLength`, as in JSON Schema

# A page's own time, by which the second tap of what brought the page is told.
MOMENT: Final = r"^[0-9]{1,10}(\.[0-9]{1,9})?$"
SINCE: Final[Field] = {
    "description": "when the page was rendered, in the server's own time",
    "pattern": MOMENT,
}
OF_PAGE: Final = frozenset({"_since", "id", "-id"})  # fields that each rendered page has anew


class FormFields:
    """The fields that a form may have."""

    def __init__(
        self,
        fields: Mapping[str, Field],
        others: Mapping[str, Field] | None = None,
        *,
        has_values: bool = False,
        about: str = "",
    ) -> None:
        """`others` are further fields, by the pattern of their names. `has_values`: all else are
        values of inputs, which may be empty. `about` describes the form."""
        self._fields = fields
        self._others = others or {}
        self._has_values = has_values
        self._about = about

    @property
    def schema(self) -> dict[str, Any]:
        """For openapi.json."""
        schema: dict[str, Any] = {
            "type": "object",
            "properties": {name: _described(field) for name, field in self._fields.items()},
            "additionalProperties": TEXT if self._has_values else False,
        }
        if self._others:
            schema["patternProperties"] = {name: _described(f) for name, f in self._others.items()}
        if self._about:
            schema["description"] = self._about
        return schema

    def filled(self, form: Mapping[str, str]) -> dict[str, str]:
        """The fields without the empty ones; InputError for a field or text that is not described."""
        filled: dict[str, str] = {}
        for name, text in form.items():
            field = self._field(name)
            if field is None:
                if not self._has_values:
                    raise InputError(f'the form has an unknown field "{name:.40}"')
                filled[name] = text
            elif text:
                _check(name, field, text)
                filled[name] = text
        return filled

    def typed(self, form: Mapping[str, str]) -> dict[str, str]:
        """What was entered: the fields without secrets and without those of the page itself."""
        return {name: text for name, text in form.items() if not self._is_own_or_secret(name)}

    def _is_own_or_secret(self, name: str) -> bool:
        return name in OF_PAGE or (self._field(name) or {}).get("format") == "password"

    def _field(self, name: str) -> Field | None:
        if name in self._fields:
            return self._fields[name]
        return next((f for pattern, f in self._others.items() if re.search(pattern, name)), None)


def _described(field: Field) -> dict[str, Any]:
    schema = {**TEXT, **field}
    if "pattern" in field:
        schema["pattern"] = f"^$|{field['pattern']}"
    if "enum" in field:
        schema["enum"] = ["", *field["enum"]]
    return schema


def _check(name: str, field: Field, text: str) -> None:
    if "enum" in field and text not in field["enum"]:
        raise InputError(f'{name:.40}: "{text:.40}" is none of {", ".join(field["enum"])}')
    if len(text) > field.get("maxLength", len(text)):
        raise InputError(f"{name:.40}: it must have at most {field['maxLength']} characters")
    if "pattern" in field and not re.fullmatch(field["pattern"], text):
        raise InputError(f'{name:.40}: "{text:.40}" must match {field["pattern"]}')


# What clients send: JSON in a body or on a socket, or a form. All routes read it with these functions.

LONGEST: Final = 64 * 1024  # bytes of a body; bytes or characters of a message on a socket
BODY_WITHIN_S: Final = 10.0
FIELDS_MOST: Final = 200  # of a form
TAP_AGAIN_S: Final = 0.7  # as the page's scripts have it
TOO_BIG: Final = 1009  # RFC 6455

Model = TypeVar("Model", bound=BaseModel)


async def body_of(request: Request) -> bytes:
    """The whole body; TooSlow after `BODY_WITHIN_S`."""
    try:
        async with asyncio.timeout(BODY_WITHIN_S):
            return await request.body()
    except TimeoutError:
        raise TooSlow(f"the body took longer than {BODY_WITHIN_S:g} s") from None


def kind_of(request: Request) -> str:
    """The media type of the body, as its header says; "" without one."""
    return request.headers.get("content-type", "").partition(";")[0].strip().lower()


async def act_body_of(
    request: Request,
    form: FormFields | None = None,
    most: int = FIELDS_MOST,
    files: Mapping[str, Callable[[bytes], dict[str, Any]]] | None = None,
) -> tuple[bool, dict[str, Any]]:
    """Whether the body of an act is a form, and its content: JSON, a form of at most so many fields
    without the empty ones, a file of one of these media types, or nothing at all. InputError for what
    is none, and for a form without `form`."""
    kind, content, files = kind_of(request), await body_of(request), files or {}
    if kind == FORM and form is not None:
        return True, await _apart(content, lambda: form.filled(form_of(content, most)))
    if kind in files:
        return False, await _apart(content, lambda: files[kind](content))
    if kind not in (JSON, ""):
        *others, last = (f'"{known}"' for known in (JSON, *files, *([FORM] if form else ())))
        kinds = f"{', '.join(others)} or {last}" if others else last
        raise InputError(f'the body must be {kinds}, not "{kind}"')
    decoded = json_of(content or b"{}")
    if not isinstance(decoded, dict):
        raise InputError("the body must be an object")
    return False, decoded


async def _apart(content: bytes, read: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """What `read` returns, on a thread if the content is large."""
    return await asyncio.to_thread(read) if len(content) > LONGEST else read()


def form_of(body: bytes, most: int = FIELDS_MOST) -> dict[str, str]:
    """The fields of a form; InputError for what is none, has more than `most`, or has one twice."""
    try:
        text = body.decode("ascii")
        pairs = parse_qsl(text, keep_blank_values=True, errors="strict", max_num_fields=most)
    except ValueError as error:
        raise InputError(f"the body is not a form: {error}") from None
    fields: dict[str, str] = {}
    for name, value in pairs:
        # A toggle that is on comes after the hidden field that is there when it is off.
        if name in fields and (fields[name], value) != ("false", "true"):
            raise InputError("a field is in the form twice")
        fields[name] = value
    return fields


def is_second_tap(form: Mapping[str, str]) -> bool:
    """Whether a page without scripts is pressed sooner than anyone reads it: by the second tap of what
    brought it. Scripts tell by themselves; a page that loaded itself was not tapped for."""
    shown_at = form_moment(form, "_since")
    return shown_at is not None and clock.server_now() - shown_at < TAP_AGAIN_S


def form_moment(form: Mapping[str, str], name: str) -> float | None:
    """A time in the server's own seconds, None without one; InputError for what is none."""
    text = form.get(name, "")
    if text and not re.fullmatch(MOMENT, text):
        raise InputError(f'{name}: "{text:.40}" is not that of a page')
    return float(text) if text else None


async def received(socket: WebSocket) -> Message:
    """The next message. A message that is too large closes the socket, as the server does if it has the
    limit."""
    message = await socket.receive()
    said = message.get("text") or message.get("bytes") or ""
    if len(said) > LONGEST:
        await socket.close(TOO_BIG)
        return {"type": "websocket.disconnect", "code": TOO_BIG}
    return message


def json_of(text: str | bytes, place: str = "the body") -> Any:
    """The value of a JSON text; InputError if it is not JSON, or has text that is not Unicode."""
    try:
        text = text.decode("utf-8-sig") if isinstance(text, bytes) else text
        decoded = _decoder.decode(text)
        if "\\u" in text:
            json.dumps(decoded, ensure_ascii=False).encode()  # half a surrogate pair is no text
    except UnicodeEncodeError:
        raise InputError(f"{place} has half of a surrogate pair, which is not Unicode text") from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"{place} is not JSON: {error}") from None
    return decoded


def as_model(model: type[Model], value: object, place: str = "the body") -> Model:
    """A value as a model; InputError names the first fault and its place."""
    try:
        return model.model_validate(value)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(step) for step in first["loc"])
        raise InputError(f"{where or place}: {first['msg']}") from None


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number of JSON")


_decoder: Final = json.JSONDecoder(parse_constant=_no_constant)


# Times as programs send them, with their zone, and as forms do: `2026-11-21T10:00`, in the server's
# zone where they have none.

# For API clients; what is not a time of the calendar is refused with a sentence.
A_TIME: Final[dict[str, JsonValue]] = {
    "pattern": (
        r"^((19[7-9]\d|20\d\d)-(0[1-9]|1[0-2])-(0[1-9]|1\d|2[0-8])"
        r"(T([01]\d|2[0-3]):[0-5]\d(:[0-5]\d)?(Z|[+-](0\d|1[0-2]):00)?)?)?$"
    ),
    "examples": ["2026-11-21T10:00"],
}
DATE: Final = re.compile(r"\d{4}-\d\d-\d\d")


def _no_number(value: object) -> object:
    """ValueError for what does not begin with a date: Pydantic would take a number for seconds."""
    if isinstance(value, datetime) or (isinstance(value, str) and DATE.match(value)):
        return value
    raise ValueError("it must be a time like 2026-11-21T10:00:00Z")


Moment = Annotated[AwareDatetime, BeforeValidator(_no_number)]
TypedTime = Annotated[str, PydanticField(max_length=40, json_schema_extra=A_TIME)]


def parse_form_time(name: str, text: str, fold: int = 0) -> int | None:
    """Milliseconds since 1970, None for ""; InputError for what is no time. `fold` is which of two
    times, where the clock shows a time twice: 1 for the later."""
    if not text:
        return None
    try:
        return int(datetime.fromisoformat(text).replace(fold=fold).timestamp() * 1000)
    except (ValueError, OverflowError, OSError):
        raise InputError(f'{name}: "{text}" is no time: it must be like 2026-11-21T10:00') from None

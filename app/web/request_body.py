"""What clients send: JSON in a body or on a socket, or a form. All routes read it with these
functions."""

import asyncio
import json
from typing import Any, Final, TypeVar
from urllib.parse import parse_qsl

from fastapi import Request, WebSocket
from pydantic import BaseModel, ValidationError
from starlette.types import Message

from app.errors import InputError, TooSlow
from app.web.openapi_parts import FORM, JSON

LONGEST: Final = 64 * 1024  # bytes of a body; bytes or characters of a message on a socket
BODY_WITHIN_S: Final = 10.0
FIELDS_MOST: Final = 200  # of a form
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


async def act_body_of(request: Request, most: int = FIELDS_MOST) -> tuple[bool, dict[str, Any]]:
    """Whether the body of an act is a form, and its content: JSON, a form of at most so many fields, or
    nothing at all. InputError for what is none."""
    kind, content = kind_of(request), await body_of(request)
    if kind == FORM:
        return True, dict(form_of(content, most))
    if kind not in (JSON, ""):
        raise InputError(f'the body must be "{JSON}" or "{FORM}", not "{kind}"')
    decoded = json_of(content or b"{}")
    if not isinstance(decoded, dict):
        raise InputError("the body must be an object")
    return False, decoded


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

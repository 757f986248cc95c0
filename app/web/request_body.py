"""What a client says as JSON, in a body or on a socket: read with the same care everywhere."""

import asyncio
import json
from typing import Any, Final, TypeVar

from fastapi import Request, WebSocket
from pydantic import BaseModel, ValidationError
from starlette.types import Message

from app.errors import InputError, TooSlow

LONGEST: Final = 64 * 1024  # bytes of a body; bytes or characters of a message on a socket
BODY_WITHIN_S: Final = 10.0
TOO_BIG: Final = 1009  # RFC 6455

Model = TypeVar("Model", bound=BaseModel)


async def body_of(request: Request) -> bytes:
    """The whole body; TooSlow where it takes longer than any client needs for so little."""
    try:
        async with asyncio.timeout(BODY_WITHIN_S):
            return await request.body()
    except TimeoutError:
        raise TooSlow(f"the body took longer than {BODY_WITHIN_S:g} s") from None


async def received(socket: WebSocket) -> Message:
    """The next message; a socket that sends too large a one is closed at once, as its server does
    where it knows the limit."""
    message = await socket.receive()
    said = message.get("text") or message.get("bytes") or ""
    if len(said) > LONGEST:
        await socket.close(TOO_BIG)
        return {"type": "websocket.disconnect", "code": TOO_BIG}
    return message


def json_of(text: str | bytes, place: str = "the body") -> Any:
    """What stands in it; InputError for what is not JSON, or has text that is not Unicode."""
    try:
        text = text.decode("utf-8-sig") if isinstance(text, bytes) else text
        given = _decoder.decode(text)
        if "\\u" in text:
            json.dumps(given, ensure_ascii=False).encode()  # half a surrogate pair is no text
    except UnicodeEncodeError:
        raise InputError(f"{place} has half of a surrogate pair, which is not Unicode text") from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"{place} is not JSON: {error}") from None
    return given


def as_model(model: type[Model], given: object, place: str = "the body") -> Model:
    """The same as a model; InputError names the first fault and its place."""
    try:
        return model.model_validate(given)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(step) for step in first["loc"])
        raise InputError(f"{where or place}: {first['msg']}") from None


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number of JSON")


_decoder: Final = json.JSONDecoder(parse_constant=_no_constant)

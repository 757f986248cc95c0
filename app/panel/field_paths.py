"""The types of keys that name a field of a message."""

from typing import Annotated

from pydantic import AfterValidator

from app.errors import InterfaceError
from app.interfaces import field_call
from app.interfaces.field_path import Key, path_steps


def _check_field_path(path: str) -> str:
    try:
        if field_call(path) is None:
            path_steps(path)
    except InterfaceError as error:
        raise ValueError(str(error)) from None
    return path


def _check_message_field(path: str) -> str:
    if field_call(_check_field_path(path)) is not None:
        raise ValueError(f'"{path}" is a function of fields: here it must be a field')
    return path


def _check_written_field(path: str) -> str:
    if any(isinstance(step, Key) for step in path_steps(_check_message_field(path))):
        raise ValueError(f'"{path}" is filled in: an element is given by its number, as in data[2]')
    return path


FieldPath = Annotated[str, AfterValidator(_check_field_path)]  # or a function of fields
MessageField = Annotated[str, AfterValidator(_check_message_field)]
WrittenField = Annotated[str, AfterValidator(_check_written_field)]  # without keys

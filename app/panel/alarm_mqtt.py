"""`[alarms.mqtt]`: where alarms are published by MQTT."""

import re
from pathlib import PurePosixPath
from typing import Annotated, Final, Self

from pydantic import AfterValidator, Field, model_validator

from app.interfaces.validation import format_value
from app.panel.base import Description, File

PORT, TLS_PORT = 1883, 8883
PREFIX: Final = re.compile(r"[^/+#$\s\0][^+#\s\0]*")


def _check_prefix(prefix: str) -> str:
    if not PREFIX.fullmatch(prefix) or prefix.endswith("/"):
        raise ValueError(f'{format_value(prefix)} is not a topic of MQTT, like "plant1/cell2/alarms"')
    return prefix


def _check_path(path: str) -> str:
    if not PurePosixPath(path).is_absolute():
        raise ValueError(f"{format_value(path)} is not the whole path of a file, from / on")
    return path


Variable = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$", max_length=100)]


class MqttRules(Description):
    """The broker at `host`, and what the topics begin with. The password of `username` is in an
    environment variable of the server, or else in a file there, never in the panel file."""

    host: Annotated[str, Field(min_length=1, max_length=253)]
    prefix: Annotated[str, Field(max_length=200), AfterValidator(_check_prefix)]
    port: Annotated[int, Field(ge=1, le=65_535)] | None = None
    tls: bool = False
    ca: File | None = None
    username: Annotated[str, Field(min_length=1, max_length=100)] | None = None
    password_env: Variable | None = None
    password_file: Annotated[str, AfterValidator(_check_path)] | None = None
    client_id: Annotated[str, Field(min_length=1, max_length=23)] | None = None

    @model_validator(mode="after")
    def _check_together(self) -> Self:
        if self.username is None and (self.password_env or self.password_file):
            raise ValueError("has a password without a username")
        if self.ca is not None and not self.tls:
            raise ValueError("has a ca, which is for tls = true")
        return self

    @property
    def used_port(self) -> int:
        return self.port or (TLS_PORT if self.tls else PORT)

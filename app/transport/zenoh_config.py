"""Zenoh configurations: a file's, or of one endpoint, with the settings that the panel server needs."""

import json
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import zenoh

from app.errors import LinkError, SettingsError

Config = zenoh.Config

MOST_QUEUED: Final = 16  # batches; Zenoh takes no more
JOINED_WITHIN_MS: Final = 3_000  # by who took a connection
BLOCKED_MOST_US: Final = 200_000  # for a put or query to wait for room: less than a hold's lease
IN_ITS_SOURCE: Final = re.compile(r" at \S+\.rs:\d+\.?")  # where in Zenoh an error was made


def config_from(path: Path, connect: Sequence[str] = ()) -> zenoh.Config:
    """A Zenoh configuration file, with other endpoints to connect to if there are any; SettingsError
    says what is wrong with it."""
    try:
        config = zenoh.Config.from_file(path)
    except zenoh.ZError as error:
        raise SettingsError(f"{path} is not a usable Zenoh configuration: {said(error)}") from error
    if connect:
        try:
            config.insert_json5("connect/endpoints", json.dumps(list(connect)))
        except zenoh.ZError as error:
            endpoints = ", ".join(connect)
            raise SettingsError(
                f"{endpoints}: can't connect there, a Zenoh endpoint is like tcp/robot1:7447: "
                f"{said(error)}"
            ) from error
    return _fit(config)


def config_to(endpoint: str) -> zenoh.Config:
    """A session that connects to one endpoint and to nothing else."""
    config = zenoh.Config()
    for place, value in {
        "mode": '"peer"',
        "connect/endpoints": f'["{endpoint}"]',
        "listen/endpoints": "[]",
        "scouting/multicast/enabled": "false",
        "scouting/gossip/enabled": "false",
        "open/return_conditions/connect_scouted": "false",
    }.items():
        config.insert_json5(place, value)
    return _fit(config)


def _fit(config: zenoh.Config) -> zenoh.Config:
    """What a kiosk needs of any configuration.

    No shared memory: Zenoh keeps a segment and its file for each session that was, and a session is
    renewed at every loss of the link. Room for a burst, as Zenoh's own two messages are few. What finds
    no room waits for it, which stops the event loop: where that takes too long (5 s are Zenoh's own)
    the connection is closed, once, and all is locked. Nothing is dropped in silence. And a session's
    end waits for who takes a connection and says nothing, as a frozen bridge's port does: not for 10 s.
    """
    config.insert_json5("transport/unicast/open_timeout", str(JOINED_WITHIN_MS))
    config.insert_json5("transport/shared_memory/enabled", "false")
    config.insert_json5("transport/link/tx/queue/size/data", str(MOST_QUEUED))
    wait = "transport/link/tx/queue/congestion_control/block/wait_before_close"
    config.insert_json5(wait, str(BLOCKED_MOST_US))
    return config


def said(error: zenoh.ZError) -> str:
    """What Zenoh says of an error, without where in its source that was."""
    return IN_ITS_SOURCE.sub("", str(error))


def endpoints_of(config: zenoh.Config) -> tuple[str, ...]:
    """Where a session connects; empty where it only looks around."""
    found = json.loads(config.get_json("connect/endpoints"))
    if isinstance(found, dict):  # for each mode
        found = found.get(json.loads(config.get_json("mode")) or "peer", [])
    return tuple(map(str, found))


@contextmanager
def translated(doing: str) -> Iterator[None]:
    """Zenoh's errors within the block leave it as LinkError."""
    try:
        yield
    except zenoh.ZError as error:
        raise LinkError(f"{doing}: {said(error)}") from error

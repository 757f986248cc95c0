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

MOST_QUEUED: Final = 16  # batches: Zenoh's maximum
JOINED_WITHIN_MS: Final = 3_000  # by a peer that has accepted a connection
BLOCKED_MOST_US: Final = 200_000  # that a put or query waits for the queue: less than a hold's lease
SOURCE_PLACE: Final = re.compile(r" at \S+\.rs:\d+\.?")  # where in Zenoh's source an error was raised


def config_from(path: Path, connect: Sequence[str] = ()) -> zenoh.Config:
    """A Zenoh configuration file, with other endpoints to connect to if there are any; SettingsError
    says what is wrong with it."""
    try:
        config = zenoh.Config.from_file(path)
    except zenoh.ZError as error:
        raise SettingsError(
            f"{path} is not a usable Zenoh configuration: {error_text(error)}"
        ) from error
    if connect:
        try:
            config.insert_json5("connect/endpoints", json.dumps(list(connect)))
        except zenoh.ZError as error:
            endpoints = ", ".join(connect)
            raise SettingsError(
                f"{endpoints}: can't connect there, a Zenoh endpoint is like tcp/robot1:7447: "
                f"{error_text(error)}"
            ) from error
    return _apply_required_settings(config)


def certificates_in(path: Path) -> list[Path]:
    """The files of certificates that a Zenoh configuration file names, for TLS."""
    tls = json.loads(zenoh.Config.from_file(path).get_json("transport/link/tls")) or {}
    names = ("root_ca_certificate", "listen_certificate", "connect_certificate")
    return [Path(tls[name]) for name in names if tls.get(name)]


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
    return _apply_required_settings(config)


def _apply_required_settings(config: zenoh.Config) -> zenoh.Config:
    """Applies the settings that the panel server needs in any configuration.

    No shared memory: Zenoh keeps a segment and its file of each earlier session, and a session is
    renewed at every loss of the link. A queue for a burst: Zenoh's default is two messages. If the
    queue is full, a put blocks the event loop: after `BLOCKED_MOST_US` (Zenoh's default is 5 s) the
    connection is closed once, and everything locks. Nothing is dropped silently. Closing a session
    waits for a peer that has accepted a connection and does not answer, such as a frozen bridge: not
    for 10 s.
    """
    config.insert_json5("transport/unicast/open_timeout", str(JOINED_WITHIN_MS))
    config.insert_json5("transport/shared_memory/enabled", "false")
    config.insert_json5("transport/link/tx/queue/size/data", str(MOST_QUEUED))
    wait = "transport/link/tx/queue/congestion_control/block/wait_before_close"
    config.insert_json5(wait, str(BLOCKED_MOST_US))
    return config


def error_text(error: zenoh.ZError) -> str:
    """The message of a Zenoh error, without the place in Zenoh's source."""
    return SOURCE_PLACE.sub("", str(error))


def endpoints_of(config: zenoh.Config) -> tuple[str, ...]:
    """The endpoints that a session connects to; empty if it only scouts."""
    endpoints = json.loads(config.get_json("connect/endpoints"))
    if isinstance(endpoints, dict):  # for each mode
        endpoints = endpoints.get(json.loads(config.get_json("mode")) or "peer", [])
    return tuple(map(str, endpoints))


@contextmanager
def translated(doing: str) -> Iterator[None]:
    """Zenoh's errors within the block leave it as LinkError."""
    try:
        yield
    except zenoh.ZError as error:
        raise LinkError(f"{doing}: {error_text(error)}") from error

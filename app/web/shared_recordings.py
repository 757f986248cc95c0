"""Recordings that are shared with Foxglove for some minutes, each below an address with a secret token.

Foxglove reads a file from another origin, without the panel's cookies: the token in the address is what
permits it. Recordings are in memory only and end with the server. Used on the event loop only.
"""

import asyncio
import secrets
import time
from collections import OrderedDict
from dataclasses import dataclass
from typing import Final, NamedTuple
from urllib.parse import urlencode

VALID_S: Final = 600.0
COUNT_MOST: Final = 3
BYTES_MOST: Final = 64_000_000  # of all together; the newest is kept, however large it is
TOKEN_BYTES: Final = 32
BROWSER: Final = "https://app.foxglove.dev/~/view"
DESKTOP: Final = "foxglove://open"


@dataclass(frozen=True, slots=True, repr=False)
class SharedRecording:
    """An MCAP file as it was at `at`; `until` is when it ends: both in seconds since the epoch. `robot`
    is the robot's id, "" on a panel with one robot; `act_id` is the act that shared it."""

    token: str
    content: bytes
    etag: str
    robot: str
    act_id: str
    at: float
    until: float


class SharedRecordings:
    """The latest recordings, at most `COUNT_MOST` of `BYTES_MOST` together, each for `valid_s`."""

    def __init__(self, valid_s: float = VALID_S) -> None:
        self._valid_s = valid_s
        self._by_token: OrderedDict[str, SharedRecording] = OrderedDict()  # the oldest first

    def share(self, content: bytes, robot: str, act_id: str) -> SharedRecording:
        """Shares a file under a new token; the oldest ones end if there are too many."""
        now = time.time()
        recording = SharedRecording(
            token=secrets.token_urlsafe(TOKEN_BYTES),
            content=content,
            etag=f'"{secrets.token_hex(16)}"',
            robot=robot,
            act_id=act_id,
            at=now,
            until=now + self._valid_s,
        )
        self._by_token[recording.token] = recording
        while len(self._by_token) > 1 and self._too_many():
            self._by_token.popitem(last=False)
        asyncio.get_running_loop().call_later(self._valid_s, self._end, recording.token)
        return recording

    def by_token(self, token: str) -> SharedRecording | None:
        """The recording with this token, until it ends."""
        return self._by_token.get(token)

    def by_act(self, act_id: str) -> SharedRecording | None:
        """The recording that this act shared, until it ends."""
        return next((shared for shared in self._by_token.values() if shared.act_id == act_id), None)

    def latest(self, robot: str) -> SharedRecording | None:
        """The newest recording of a robot, until it ends."""
        return next((s for s in reversed(self._by_token.values()) if s.robot == robot), None)

    def _too_many(self) -> bool:
        size = sum(len(recording.content) for recording in self._by_token.values())
        return len(self._by_token) > COUNT_MOST or size > BYTES_MOST

    def _end(self, token: str) -> None:
        self._by_token.pop(token, None)


class SharedLinks(NamedTuple):
    """Where a shared recording is, and the links that open it in Foxglove in a browser and in its
    desktop app."""

    recording: SharedRecording
    address: str
    browser: str
    desktop: str


def links_of(recording: SharedRecording, base_url: str) -> SharedLinks:
    """The links of a recording; `base_url` is that of the panel as the client names it."""
    address = f"{base_url.rstrip('/')}/recordings/shared/{recording.token}.mcap"
    source = urlencode({"ds": "remote-file", "ds.url": address})
    return SharedLinks(recording, address, f"{BROWSER}?{source}", f"{DESKTOP}?{source}")

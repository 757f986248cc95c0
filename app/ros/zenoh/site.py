"""The summaries of cells on the plant's Zenoh routers: a cell publishes its own, a wall reads those of
all. Both are clients of a router, and change over to another one when it ends.

A summary is at `operator-panel/<site>/<cell>/summary`, with a liveliness token at `…/summary/alive` and
a queryable. A wall publishes nothing.
"""

import asyncio
import threading
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Final

import zenoh

from app.ros.zenoh.answers import direct
from app.ros.zenoh.config import Config, in_own_thread, open_client, translated
from app.system.errors import LinkError

PREFIX: Final = "operator-panel"
SUMMARY: Final = "summary"
ALIVE: Final = "alive"
ANY: Final = "*"
AGAIN_S: Final = 1.0  # between two tries to reach a router
WHOLE_WITHIN_S: Final = 5.0  # for the answers of all cells
MAX_PENDING: Final = 4_000  # cells of which something is kept until it is taken


def summary_key(site: str = ANY, cell: str = ANY) -> str:
    """The key expression of a cell's summary; of all cells of all sites without names."""
    return f"{PREFIX}/{site}/{cell}/{SUMMARY}"


def alive_key(site: str = ANY, cell: str = ANY) -> str:
    """That of the liveliness token."""
    return f"{summary_key(site, cell)}/{ALIVE}"


def cell_of(key: str) -> tuple[str, str]:
    """(site, cell) of a key or token."""
    parts = key.split("/")
    return (parts[1], parts[2]) if len(parts) > 3 else ("", "")


class _Client:
    """A session at one of the routers, opened as soon as one answers; what it declares stays over all
    changes of routers, as Zenoh declares it again."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._session: zenoh.Session | None = None
        self._held: list[Any] = []

    async def open(self) -> None:
        """Returns when it is open; tries for ever."""
        while True:
            try:
                session = await in_own_thread(lambda: open_client(self._config))
            except zenoh.ZError:
                await asyncio.sleep(AGAIN_S)
                continue
            with translated("the summary can't be declared"):
                self._held = self._declare(session)
            self._session = session
            return

    def _declare(self, session: zenoh.Session) -> list[Any]:
        raise NotImplementedError

    @property
    def is_connected(self) -> bool:
        """Whether a router is reached now."""
        session = self._session
        if session is None:
            return False
        with suppress(zenoh.ZError):
            return any(session.info.routers_zid()) or any(session.info.peers_zid())
        return False

    async def close(self) -> None:
        session, self._session = self._session, None
        self._held = []
        if session is not None:
            with suppress(LinkError, zenoh.ZError):
                await in_own_thread(session.close)


class SummaryPublisher(_Client):
    """Publishes the summary of one cell. `others` has the newest payload of another panel that
    publishes as the same cell; it is emptied by `take_other`."""

    def __init__(self, config: Config, site: str, cell: str) -> None:
        super().__init__(config)
        self._key, self._token = summary_key(site, cell), alive_key(site, cell)
        self._latest = b""
        self._other: bytes | None = None
        self._publisher: zenoh.Publisher | None = None

    def _declare(self, session: zenoh.Session) -> list[Any]:
        self._publisher = session.declare_publisher(
            self._key,
            encoding=zenoh.Encoding.APPLICATION_JSON,
            congestion_control=zenoh.CongestionControl.DROP,  # the next one has all of it
            allowed_destination=zenoh.Locality.REMOTE,
        )
        return [
            session.declare_queryable(self._key, direct(self._answer)),
            session.declare_subscriber(
                self._key, direct(self._hear), allowed_origin=zenoh.Locality.REMOTE
            ),
            session.liveliness().declare_token(self._token),
        ]

    def put(self, payload: bytes) -> None:
        """Sends it now, and to each query from now on. Lost without a router: the next one has
        all."""
        self._latest = payload
        if self._publisher is not None:
            with suppress(zenoh.ZError):
                self._publisher.put(payload)

    def take_other(self) -> bytes | None:
        """The last payload of another panel with the same name since the last call."""
        other, self._other = self._other, None
        return other

    async def close(self) -> None:
        self._publisher = None
        await super().close()

    # On Zenoh's threads.

    def _answer(self, query: zenoh.Query) -> None:
        with query, suppress(zenoh.ZError):
            if self._latest:
                query.reply(self._key, self._latest, encoding=zenoh.Encoding.APPLICATION_JSON)

    def _hear(self, sample: zenoh.Sample) -> None:
        self._other = sample.payload.to_bytes()


@dataclass(slots=True)
class CellChanges:
    """What has arrived since the last call, by (site, cell): the newest token, and the newest summaries
    by their publishers (two, if two cells have one name). `dropped` counts what found no room."""

    alive: dict[tuple[str, str], bool] = field(default_factory=dict)
    payloads: dict[tuple[str, str], dict[str, bytes]] = field(default_factory=dict)
    dropped: int = 0


MAX_PUBLISHERS: Final = 3  # of one name


class SummaryReader(_Client):
    """Reads the summaries of the cells of some sites; of all sites without names. It declares
    subscribers only."""

    def __init__(self, config: Config, longest: int, sites: Sequence[str] = ()) -> None:
        """A payload of more than `longest` bytes arrives as an empty one."""
        super().__init__(config)
        self._longest = longest
        self._sites = tuple(sites) or (ANY,)
        self._lock = threading.Lock()
        self._changes = CellChanges()

    def _declare(self, session: zenoh.Session) -> list[Any]:
        return [
            declared
            for site in self._sites
            for declared in (
                session.declare_subscriber(summary_key(site), direct(self._on_summary)),
                session.liveliness().declare_subscriber(
                    alive_key(site), direct(self._on_token), history=True
                ),
            )
        ]

    def take(self) -> CellChanges:
        with self._lock:
            changes, self._changes = self._changes, CellChanges()
        return changes

    def ask(self, cells: Iterable[tuple[str, str]] = ()) -> None:
        """Asks these cells, or all, for the whole; the answers arrive as changes."""
        session = self._session
        if session is None:
            return
        selectors = [summary_key(*names) for names in cells] or [*map(summary_key, self._sites)]
        for selector in selectors:
            with suppress(zenoh.ZError):
                session.get(
                    selector,
                    direct(self._on_reply),
                    target=zenoh.QueryTarget.ALL,
                    consolidation=zenoh.ConsolidationMode.NONE,
                    timeout=WHOLE_WITHIN_S,
                )

    # On Zenoh's threads.

    def _on_summary(self, sample: zenoh.Sample) -> None:
        stamp = sample.timestamp
        self._put(str(sample.key_expr), str(stamp.get_id()) if stamp else "", sample.payload)

    def _on_reply(self, reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            by = str(reply.replier_id.zid) if reply.replier_id else ""
            self._put(str(reply.ok.key_expr), by, reply.ok.payload)

    def _put(self, key: str, publisher: str, payload: zenoh.ZBytes) -> None:
        names = cell_of(key)
        content = payload.to_bytes() if len(payload) <= self._longest else b""
        with self._lock:
            changes = self._changes
            if names not in changes.payloads and len(changes.payloads) >= MAX_PENDING:
                changes.dropped += 1
                return
            of_cell = changes.payloads.setdefault(names, {})
            if publisher in of_cell or len(of_cell) < MAX_PUBLISHERS:
                of_cell[publisher] = content

    def _on_token(self, sample: zenoh.Sample) -> None:
        names, alive = cell_of(str(sample.key_expr)), sample.kind == zenoh.SampleKind.PUT
        with self._lock:
            changes = self._changes
            if names not in changes.alive and len(changes.alive) >= MAX_PENDING:
                changes.dropped += 1 if alive else 0
                return
            changes.alive[names] = alive

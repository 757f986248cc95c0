"""The configuration of a Zenoh session, and how a session is opened."""

import asyncio
import json
import re
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import Annotated, Any, Final, Literal, TypeVar

import zenoh

from app.ros.zenoh.answers import direct
from app.system.errors import LinkError, SettingsError
from app.system.public import PUBLIC_ENDPOINT, Public

# Zenoh configurations: a file's, or of one endpoint, with the settings that the panel server needs.

Config = zenoh.Config

MOST_QUEUED: Final = 16  # batches: Zenoh's maximum
JOINED_WITHIN_MS: Final = 3_000  # by a peer that has accepted a connection
BLOCKED_MOST_US: Final = 200_000  # that a put or query waits for the queue: less than a hold's lease
TLS_ENDS: Final = ("listen", "connect")
# How Zenoh prints errors of its parsers.
PARSED: Final = re.compile(
    r'Message \{ msg: "(?P<message>.*)", location: Some\(Location \{ line: (?P<line>\d+), '
    r"column: (?P<column>\d+) \}\)"
)
SYNTAX: Final = re.compile(
    r"\s*--> (?P<line>\d+):(?P<column>\d+)\n.*= (?P<expected>expected [^\n]*)", re.DOTALL
)
STRING: Final = re.compile(r'^Str\("(.*)"\)$')
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


@dataclass(frozen=True, slots=True)
class TlsFilesInUse:
    """The files that a Zenoh configuration names for TLS; `own` are (certificate, its key)."""

    authority: Path | None
    own: tuple[tuple[Path, Path | None], ...]

    @property
    def certificates(self) -> list[Path]:
        own = [certificate for certificate, _ in self.own]
        return [self.authority, *own] if self.authority else own

    def faults(self) -> list[str]:
        """Why they can't be used. Imported only with TLS, for a faster start."""
        if not self.certificates:
            return []
        from app.system.certificates import authority_fault, pair_fault

        pairs = [(certificate, key) for certificate, key in self.own if key]
        of_pairs = (pair_fault(certificate, key) for certificate, key in pairs)
        every = (authority_fault(self.authority) if self.authority else "", *of_pairs)
        return [fault for fault in every if fault]


def tls_files(path: Path) -> TlsFilesInUse:
    """The files of TLS that a Zenoh configuration file names."""
    tls = json.loads(zenoh.Config.from_file(path).get_json("transport/link/tls")) or {}
    named = ((tls.get(f"{end}_certificate"), tls.get(f"{end}_private_key")) for end in TLS_ENDS)
    own = tuple((Path(file), Path(key) if key else None) for file, key in named if file)
    authority = tls.get("root_ca_certificate")
    return TlsFilesInUse(Path(authority) if authority else None, own)


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


End = Literal["connect", "listen"]


def error_text(error: zenoh.ZError) -> str:
    """The message of a Zenoh error, with the line of the file if it has one; without the names of its
    types and the places in its source."""
    text = SOURCE_PLACE.sub("", str(error))
    if match := PARSED.search(text):
        message = SYNTAX.sub(r"\g<expected>", match["message"].replace("\\n", "\n"))
        return f"line {match['line']}, column {match['column']}: {message.strip()}"
    if match := SYNTAX.search(text):
        return f"line {match['line']}, column {match['column']}: {match['expected']}"
    return STRING.sub(r"\1", text)


def endpoints_of(
    config: zenoh.Config, end: Literal["connect", "listen"] = "connect"
) -> tuple[str, ...]:
    """The endpoints that a session connects to, empty if it only scouts; or those where it listens."""
    endpoints = json.loads(config.get_json(f"{end}/endpoints"))
    if isinstance(endpoints, dict):  # for each mode
        endpoints = endpoints.get(json.loads(config.get_json("mode")) or "peer", [])
    return tuple(map(str, endpoints))


@dataclass(frozen=True, slots=True)
class ConfigSummary:
    """What a support bundle has of a Zenoh configuration file. `is_multicast`, `is_gossip`: by which
    ways it scouts."""

    mode: Annotated[str, Public("peer|client|router")]
    connect: Annotated[tuple[str, ...], PUBLIC_ENDPOINT]
    listen: Annotated[tuple[str, ...], PUBLIC_ENDPOINT]
    is_multicast: bool
    is_gossip: bool


def summary(path: Path) -> ConfigSummary:
    """SettingsError for a file that is not usable."""
    config = config_from(path)

    def value(key: str) -> Any:
        return json.loads(config.get_json(key))

    return ConfigSummary(
        value("mode") or "peer",
        endpoints_of(config),
        endpoints_of(config, "listen"),
        value("scouting/multicast/enabled") is not False,
        value("scouting/gossip/enabled") is not False,
    )


@contextmanager
def translated(doing: str) -> Iterator[None]:
    """Zenoh's errors within the block leave it as LinkError."""
    try:
        yield
    except zenoh.ZError as error:
        raise LinkError(f"{doing}: {error_text(error)}") from error


# Opens a Zenoh session, as a peer or as a client.

Result = TypeVar("Result")

HISTORY_S = 0.15  # in which a router sends the tokens that it has
CLIENT_WITHIN_MS = 500  # to connect, of all endpoints together


def open_session(config: zenoh.Config, as_client: bool) -> tuple[zenoh.Session, bool]:
    """(session, whether it is as it was wished). LinkError if none can be opened.

    A client can only be opened where something answers. Else a peer waits for that: once it is
    connected, a client can be opened in its place.
    """
    with translated("the Zenoh session can't be opened"):
        if as_client or is_client(config):
            try:
                return open_client(config), True
            except zenoh.ZError:
                return zenoh.open(_waiting(config)), False
        return zenoh.open(config), True


def open_client(config: zenoh.Config) -> zenoh.Session:
    """A client of the first router that answers; ZError if none does. Zenoh itself would wait for the
    first endpoint until its time is over, and try no other."""
    endpoints = endpoints_of(config)
    for first in range(len(endpoints) - 1):
        with suppress(zenoh.ZError):
            return zenoh.open(client_config(config, (*endpoints[first:], *endpoints[:first])))
    return zenoh.open(client_config(config, (*endpoints[-1:], *endpoints[:-1])))


def is_client(config: zenoh.Config) -> bool:
    """Whether a configuration is that of a client: it is connected to one of several routers at a time,
    and changes over to another when that ends. A peer would be connected to all of them, and get and
    send everything twice."""
    return bool(json.loads(config.get_json("mode")) == "client")


def _waiting(config: zenoh.Config) -> zenoh.Config:
    """A peer that connects as a client would, and waits for that."""
    waiting = zenoh.Config.from_json5(str(config))
    waiting.insert_json5("mode", '"peer"')
    waiting.insert_json5("open/return_conditions/connect_scouted", "false")
    return waiting


def client_config(config: zenoh.Config, endpoints: Sequence[str] = ()) -> zenoh.Config:
    """That of a client, which connects to the first of these endpoints that answers, of its own without
    any. It stamps what it sends, as rmw_zenoh's nodes do: the stamp says whose a message is."""
    client = zenoh.Config.from_json5(str(config))
    for place, value in {
        "mode": '"client"',
        "listen/endpoints": "[]",
        "connect/timeout_ms": str(CLIENT_WITHIN_MS),
        "connect/exit_on_failure": "true",
        "timestamping/enabled": "true",
    }.items():
        client.insert_json5(place, value)
    if endpoints:
        client.insert_json5("connect/endpoints", json.dumps(list(endpoints)))
    return client


def tokens_for_clients(config: zenoh.Config, expressions: Collection[str]) -> list[str]:
    """The liveliness tokens that a client of the same router sees now; none if it can't be opened.
    Blocks for `HISTORY_S` after it is open. Not by queries: a second one of a session may end early."""
    seen: set[str] = set()

    def see(sample: zenoh.Sample) -> None:
        seen.add(str(sample.key_expr))

    try:
        with zenoh.open(client_config(config)) as session:
            declare = session.liveliness().declare_subscriber
            held = [declare(each, direct(see), history=True) for each in expressions]
            Event().wait(HISTORY_S)  # which a clock that is set does not disturb
            del held
    except zenoh.ZError:
        return []
    return sorted(seen)


async def in_own_thread(work: Callable[[], Result]) -> Result:
    """What blocks, in a thread that nothing else waits for: those of the event loop may all be busy."""
    executor = ThreadPoolExecutor(1, "zenoh-look")
    try:
        return await asyncio.get_running_loop().run_in_executor(executor, work)
    finally:
        executor.shutdown(wait=False)

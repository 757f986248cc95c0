"""The way to a robot's Zenoh router or peer: name, TCP, Zenoh's handshake, versions of Zenoh."""

import asyncio
import json
import re
import socket
from collections.abc import Sequence
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Final, Protocol

from app.diagnose.findings import Report
from app.dialect.dialect import Dialect
from app.errors import LinkError, SettingsError
from app.i18n import say
from app.transport.admin_space import AdminSpace
from app.transport.zenoh_config import config_from, endpoints_of
from app.transport.zenoh_session import ZenohSession

CONNECT_S: Final = 3.0
HANDSHAKE_S: Final = 3.0
ASK_S: Final = 1.0
ROUTERS: Final = (
    "@/*/router",
    "@/*/peer",
)  # in Zenoh's admin space: JSON with `version` and `sessions`
TCP: Final = re.compile(r"(?P<protocol>tcp|tls|ws)/(?P<host>\[[^\]]+\]|[^\s/?#:]+):(?P<port>\d+).*")
RELEASE: Final = re.compile(r"v?(\d+\.\d+)(\.\d+)?")


class AdminSession(AdminSpace, Protocol):
    """A link with the id of its session."""

    zid: str


def configured(report: Report, zenoh: Path, connect: Sequence[str], robot: str) -> tuple[str, ...]:
    """The endpoints that a Zenoh configuration connects to; () if it can't be used."""
    try:
        endpoints = endpoints_of(config_from(zenoh, connect))
    except SettingsError as error:
        report.find("zenoh_config", str(zenoh), robot=robot, detail=" ".join(str(error).split()))
        return ()
    if not endpoints:
        detail = say("finding_no_endpoint", file=str(zenoh))
        report.find("zenoh_config", str(zenoh), robot=robot, detail=detail)
    return endpoints


async def check_link(
    report: Report, zenoh: Path, endpoints: Sequence[str], robot: str, dialect: Dialect
) -> list[str]:
    """The endpoints at which Zenoh answers."""
    answering = []
    for endpoint in endpoints:
        there = await asyncio.to_thread(connects, report, endpoint, robot)
        if there and await _shakes_hands(report, zenoh, endpoint, robot, dialect):
            answering.append(endpoint)
    return answering


def connects(report: Report, endpoint: str, robot: str) -> bool:
    """Whether TCP gets through; True where an endpoint is none of TCP."""
    match = TCP.fullmatch(endpoint)
    if match is None:
        return True
    try:
        with socket.create_connection((match["host"].strip("[]"), int(match["port"])), CONNECT_S):
            return True
    except socket.gaierror as error:
        report.find("host_unknown", endpoint, robot=robot, detail=(error.strerror or "").lower())
    except ConnectionRefusedError:
        report.find("no_router", endpoint, robot=robot)
    except TimeoutError:
        report.find(
            "no_route",
            endpoint,
            robot=robot,
            detail=say("finding_no_connection", seconds=f"{CONNECT_S:g}"),
        )
    except OSError as error:
        detail = (error.strerror or str(error)).lower()
        report.find("no_route", endpoint, robot=robot, detail=detail)
    return False


async def _shakes_hands(
    report: Report, zenoh: Path, endpoint: str, robot: str, dialect: Dialect
) -> bool:
    session = await asyncio.to_thread(
        ZenohSession, config_from(zenoh, [endpoint]), lambda _: None, dialect
    )
    try:
        if not await session.connected(HANDSHAKE_S):
            report.find("not_zenoh", endpoint, robot=robot)
            return False
        await check_version(report, session, endpoint, robot)
        return True
    except LinkError as error:
        report.find("zenoh_config", str(zenoh), robot=robot, detail=str(error))
        return False
    finally:
        with suppress(LinkError):
            await asyncio.to_thread(session.close)


async def check_version(report: Report, session: AdminSession, endpoint: str, robot: str) -> None:
    """Whether the other side has this Zenoh; its admin space may be off."""
    ours = version("eclipse-zenoh")
    answers = await asyncio.gather(*(session.query_all(selector, ASK_S) for selector in ROUTERS))
    for _, answer in (answer for several in answers for answer in several):
        with suppress(
            ValueError, TypeError, AttributeError, LookupError, RecursionError
        ):  # an answer that is none of Zenoh's
            said = json.loads(answer)
            if all(session.zid != peer.get("peer") for peer in said["sessions"]):
                continue  # further away
            theirs = RELEASE.match(said["version"])
            if theirs is not None and theirs[1] != ".".join(ours.split(".")[:2]):
                report.find("zenoh_version", endpoint, robot=robot, theirs=theirs[0], ours=ours)
            elif theirs is not None:
                report.fact(f"Zenoh {theirs[0].lstrip('v')} answers at {endpoint}; {ours} is here")
            return
    report.fact(f"Zenoh answers at {endpoint} (its version is not known: its admin space is off)")

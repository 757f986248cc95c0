"""Whether the panel server answers: one small request on loopback."""

import asyncio
from contextlib import suppress
from time import monotonic
from typing import TYPE_CHECKING, Final
from urllib.parse import urlsplit

if TYPE_CHECKING:
    import ssl

ANSWERS_WITHIN_S: Final = 1.0
POLL_S: Final = 0.1


async def server_answers(url: str, path: str = "/healthz") -> bool:
    """Whether the server of `url` responds with status 200 in time."""
    try:
        async with asyncio.timeout(ANSWERS_WITHIN_S):
            return await _status(url, path) == 200
    except (OSError, TimeoutError, ValueError):
        return False


async def answers_within(url: str, within_s: float) -> bool:
    """The same, of a server that may be starting."""
    end = monotonic() + within_s
    while not (answers := await server_answers(url)) and monotonic() < end:
        await asyncio.sleep(POLL_S)
    return answers


async def _status(url: str, path: str) -> int:
    parts = urlsplit(url)
    secure = parts.scheme == "https"
    port = parts.port or (443 if secure else 80)
    # The certificate is the browser's to check: whether the server runs is all that counts here.
    context = _unchecked() if secure else None
    reader, writer = await asyncio.open_connection(parts.hostname, port, ssl=context)
    try:
        request = f"GET {path} HTTP/1.1\r\nHost: {parts.netloc}\r\nConnection: close\r\n\r\n"
        writer.write(request.encode())
        return int((await reader.readline()).split()[1])
    except IndexError:
        return 0
    finally:
        writer.close()
        with suppress(OSError):
            await writer.wait_closed()


def _unchecked() -> "ssl.SSLContext":
    import ssl  # 3 MiB that a panel on HTTP does not need

    context = ssl.create_default_context()
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    return context

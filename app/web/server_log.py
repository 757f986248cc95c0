"""What the HTTP server logs of its clients: one line for a fault, without a traceback where the fault
is the client's, and the number of those that follow."""

import asyncio
import logging
import re
from collections.abc import Mapping
from pathlib import PurePath
from typing import Final

from app.repeated_records import RepeatedRecords

# asyncio logs what fails below a connection, such as a TLS handshake.
LOGGERS: Final = ("uvicorn.error", "asyncio", "kiosk.connections", "kiosk.web")
TOKEN_PATH: Final = re.compile(r"(/recordings/shared/)[^/?\s]+")
COUNT_EVERY_S: Final = 5.0
# uvicorn's and websockets' words → ours, for faults of a client.
CLIENT_FAULTS: Final[Mapping[str, str]] = {
    "Invalid HTTP request received.": "A client sent something that is not an HTTP request",
    "Invalid UTF-8 sequence received from client.": "A client sent a WebSocket message that is no text",
    "Unsupported upgrade request.": "A client asked for another protocol than HTTP and WebSocket",
}


class ClientFaults(logging.Filter):
    """Rewords faults of a client, and drops what is logged of each WebSocket."""

    def filter(self, record: logging.LogRecord) -> bool:
        words = CLIENT_FAULTS.get(str(record.msg).strip())
        if words is not None:
            record.msg, record.args, record.exc_info, record.exc_text = words, (), None, None
        path = PurePath(record.pathname)
        about_client = "protocols" in path.parts or path.parent.name == "websockets"
        return record.levelno >= logging.WARNING or not about_client


class MaskedTokens(logging.Filter):
    """Masks the tokens of shared recordings in the lines of requests."""

    def filter(self, record: logging.LogRecord) -> bool:
        if isinstance(record.args, tuple):
            record.args = tuple(
                TOKEN_PATH.sub(r"\1***", value) if isinstance(value, str) else value
                for value in record.args
            )
        return True


def limit_server_log(debug: bool) -> RepeatedRecords:
    """Puts the filters on the server's loggers; with `debug` each WebSocket is logged."""
    repeated = RepeatedRecords()
    for name in LOGGERS:
        logger = logging.getLogger(name)
        for before in [
            log_filter
            for log_filter in logger.filters
            if isinstance(log_filter, (ClientFaults, RepeatedRecords))
        ]:
            logger.removeFilter(before)
        if not debug:
            logger.addFilter(ClientFaults())
        logger.addFilter(repeated)
    requests = logging.getLogger("uvicorn.access")
    if not any(isinstance(log_filter, MaskedTokens) for log_filter in requests.filters):
        requests.addFilter(MaskedTokens())
    return repeated


async def count_repeated(repeated: RepeatedRecords) -> None:
    """Writes the counts, for ever."""
    while True:
        await asyncio.sleep(COUNT_EVERY_S)
        repeated.write_counts(logging.getLogger("kiosk.connections"))

"""Opens a Zenoh session, as a peer or as a client."""

import zenoh

from app.transport.zenoh_config import translated

CLIENT_WITHIN_MS = 500  # to connect, of all endpoints together


def open_session(config: zenoh.Config, as_client: bool) -> tuple[zenoh.Session, bool]:
    """(session, whether it is as it was wished). LinkError if none can be opened.

    A client can only be opened where something answers. Else a peer waits for that: once it is
    connected, a client can be opened in its place.
    """
    with translated("the Zenoh session can't be opened"):
        if as_client:
            try:
                return zenoh.open(_client(config)), True
            except zenoh.ZError:
                return zenoh.open(config), False
        return zenoh.open(config), True


def _client(config: zenoh.Config) -> zenoh.Config:
    client = zenoh.Config.from_json5(str(config))
    for place, value in {
        "mode": '"client"',
        "listen/endpoints": "[]",
        "connect/timeout_ms": str(CLIENT_WITHIN_MS),
        "connect/exit_on_failure": "true",
    }.items():
        client.insert_json5(place, value)
    return client

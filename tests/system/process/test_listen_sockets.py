"""What the server listens on is found, and what it accepts keeps little unread."""

import asyncio
import socket
from contextlib import suppress

import pytest

from app.system.process import listen_sockets
from app.system.process.listen_sockets import SEND_BUFFER_BYTES, USER_TIMEOUT_MS


def accepted(listening: socket.socket) -> int:
    """The send buffer of a connection to it."""
    with socket.create_connection(listening.getsockname()), listening.accept()[0] as accepted_socket:
        return accepted_socket.getsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF)


def test_a_listening_socket_is_found_and_no_other() -> None:
    before = listen_sockets.listener_names()
    with socket.create_server(("127.0.0.1", 0)) as listening:
        (name,) = listen_sockets.listener_names() - before
        with socket.create_connection(listening.getsockname()):
            assert listen_sockets.listener_names() == before | {name}
    assert listen_sockets.listener_names() == before


def test_waiter_is_notified_when_the_server_listens() -> None:
    async def work() -> None:
        waiting = asyncio.create_task(listen_sockets.wait_for_listener(listen_sockets.listener_names()))
        await asyncio.sleep(0)
        assert not waiting.done()
        with socket.create_server(("127.0.0.1", 0)):
            await asyncio.wait_for(waiting, 4)

    asyncio.run(work())


def test_only_new_listening_sockets_get_the_send_buffer_limit() -> None:
    async def work() -> None:
        with socket.create_server(("127.0.0.1", 0)) as old:
            wide = accepted(old)
            ports: set[int] = set()
            narrowing = asyncio.create_task(listen_sockets.limit_send_buffer(ports))
            await asyncio.sleep(0)
            with socket.create_server(("127.0.0.1", 0)) as new:
                assert await asyncio.wait_for(narrowing, 4) == [new.getsockname()]
                assert ports == {new.getsockname()[1]}
                assert accepted(new) == 2 * SEND_BUFFER_BYTES < wide
                assert accepted(old) == wide
                gone = (socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT)
                assert (new.getsockopt(*gone), old.getsockopt(*gone)) == (USER_TIMEOUT_MS, 0)

    asyncio.run(work())


def test_unread_connection_is_closed_and_a_read_one_is_not() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        port = listening.getsockname()[1]
        with (
            socket.create_connection(("127.0.0.1", port)) as deaf,
            listening.accept()[0] as stuck,
            socket.create_connection(("127.0.0.1", port)) as _,
            listening.accept()[0] as idle,
        ):
            stuck.setblocking(False)
            with suppress(BlockingIOError):
                while stuck.send(bytes(65_536)):
                    pass
            listen_sockets.abort_unsent({port + 1})
            assert listen_sockets.unsent_bytes(stuck)
            listen_sockets.abort_unsent({port})
            with pytest.raises(BrokenPipeError):
                stuck.send(b"more")
            assert idle.send(b"still there") == 11
            assert deaf.fileno() > 0

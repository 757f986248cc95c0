"""Answers that take long are built once and beside the event loop."""

import asyncio
import gzip
import json
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from fastapi import Request

from app.system.concurrency import BuiltOnce
from app.system.texts import say
from app.web.caller import caller_of
from app.web.large_answers import PACKED_BYTES, SMALL, rows_answer
from tests.support.servers import demo_server
from tests.web.test_alarms import HEALTHY, PANEL


def test_those_that_wait_for_a_value_share_one_building() -> None:
    begun: list[int] = []
    finish = threading.Event()

    def build() -> object:
        begun.append(threading.get_ident())
        finish.wait(60.0)
        return object()

    async def work() -> None:
        once = BuiltOnce(build)
        uses = [asyncio.create_task(once.value()) for _ in range(20)]
        await asyncio.sleep(0)
        uses.pop().cancel()  # a client that is gone ends no building
        finish.set()
        values = await asyncio.gather(*uses)
        assert {*values, await once.value()} == {values[0]}

    asyncio.run(work())
    assert len(begun) == 1
    assert begun[0] != threading.get_ident()


def test_a_building_that_failed_is_tried_again() -> None:
    results: list[Any] = [ValueError("first"), 7]

    def build() -> int:
        result = results.pop(0)
        if isinstance(result, ValueError):
            raise result
        return int(result)

    async def work() -> int:
        once = BuiltOnce(build)
        with pytest.raises(ValueError, match="first"):
            await once.value()
        return await once.value()

    assert asyncio.run(work()) == 7


@pytest.mark.parametrize("count", [1, SMALL, SMALL + 1, 2_000])
@pytest.mark.parametrize("packed", [True, False])
def test_many_rows_are_made_on_a_thread(count: int, packed: bool) -> None:
    made_on: list[int] = []

    def content() -> dict[str, Any]:
        made_on.append(threading.get_ident())
        return {"rows": [say("alarm_acknowledge")] * count}

    async def work() -> tuple[bytes, str | None]:
        encoding = b"gzip" if packed else b"identity"
        request = Request({"type": "http", "headers": [(b"accept-encoding", encoding)]})
        caller_of(request).language = "en"
        answer = await rows_answer(request, content, count)
        return bytes(answer.body), answer.headers.get("content-encoding")

    body, encoding = asyncio.run(work())
    assert (made_on[0] != threading.get_ident()) == (count > SMALL)
    assert (encoding == "gzip") == (packed and count * 14 + 10 > PACKED_BYTES)
    text = gzip.decompress(body) if encoding else body
    assert json.loads(text) == {"rows": ["Acknowledge"] * count}


def test_the_description_is_the_same_for_all_who_ask_at_once(tmp_path: Path) -> None:
    with demo_server(tmp_path, PANEL % HEALTHY) as server:

        def ask(number: int) -> tuple[int, bytes]:
            headers = {"accept-encoding": "gzip" if number % 2 else "identity"}
            answer = server.http.get("/openapi.json", headers=headers)
            return answer.status_code, answer.content

        with ThreadPoolExecutor(20) as pool:
            answers = set(pool.map(ask, range(20)))
        ((status, content),) = answers
        assert status == 200
        assert "/alarms" in json.loads(content)["paths"]

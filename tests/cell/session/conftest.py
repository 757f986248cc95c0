"""Fixtures of robots on rmw_zenoh."""

from collections.abc import Iterator

import pytest

from tests.support.rmw import Router, SessionRouter


@pytest.fixture
def router() -> Iterator[Router]:
    mine = SessionRouter()
    mine.start()
    yield mine
    mine.end()

"""Fixtures of clients that sign in."""

from collections.abc import Iterator

import pytest

from tests.support.users import Browsers


@pytest.fixture
def browsers() -> Iterator[Browsers]:
    every = Browsers()
    yield every
    every.close()

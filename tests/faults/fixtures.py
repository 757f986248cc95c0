"""Fixtures: a rig per module, each on another domain than the one before, and a kiosk server on it."""

import itertools
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.faults.net import Cable
from tests.faults.rig import Rig
from tests.support.parts import Server

_domains = itertools.cycle((2, 5, 6, 7, 8))


@pytest.fixture(scope="module")
def rig(domain: int) -> Iterator[Rig]:
    mine = Rig(domain + next(_domains))
    yield mine
    mine.end()


@pytest.fixture
def server(rig: Rig, tmp_path: Path) -> Iterator[Server]:
    with rig.serving(tmp_path) as mine:
        yield mine


@pytest.fixture
def cable() -> Iterator[Cable]:
    """A cable; the test itself runs at the kiosk's end."""
    mine = Cable()
    with mine.kiosk.inside():
        yield mine
    mine.end()

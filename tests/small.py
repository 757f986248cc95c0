"""Limits as small as tests need them, of `tests.hasty` and `tests.strict`."""

from typing import Final

CONNECTIONS: Final = 20
PRESSES: Final = 10

"""Small limits for the tests, of `tests.support.apps.hasty` and `tests.support.apps.strict`."""

from typing import Final

CONNECTIONS: Final = 20
PRESSES: Final = 10

"""The two forms of the tests that try something often: short in `make test`, long in `make faults`."""

import os
from typing import Final

LONG: Final = os.environ.get("FAULTS") == "long"


def several(short: int, long: int) -> int:
    """A count or a time, by the form."""
    return long if LONG else short

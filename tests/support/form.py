"""The two forms of tests with many repetitions: short in `make test`, long in `make faults`."""

import os
from typing import Final

LONG: Final = os.environ.get("FAULTS") == "long"


def several(short: int, long: int) -> int:
    """A count or a time, depending on the form."""
    return long if LONG else short

"""The two forms of tests with repetitions: short, and long in `make faults` and `make test-long`.

`make faults` runs one test at a time, and measures; `make test-long` runs them beside each other."""

import os
from typing import Final

MEASURES: Final = os.environ.get("FAULTS") == "long"
LONG: Final = MEASURES or os.environ.get("EXAMPLES") == "long"


def several(short: int, long: int) -> int:
    """A count or a time, depending on the form."""
    return long if LONG else short


def load_hypothesis_profile() -> None:
    """The short form tests the same examples each time, the long form many random ones."""
    from hypothesis import HealthCheck, settings

    settings.register_profile(
        "panel",
        deadline=None,  # an example may take long on a busy machine
        suppress_health_check=[HealthCheck.too_slow],
        derandomize=not LONG,
        database=None,
        max_examples=several(40, 1000),
    )
    settings.load_profile("panel")
    _loaded.append("panel")


def has_profile() -> bool:
    """Whether the profile is loaded."""
    return bool(_loaded)


_loaded: Final[list[str]] = []

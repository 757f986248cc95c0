"""The list of options that a service has answered."""

from typing import NamedTuple


class OptionList(NamedTuple):
    """The `texts` of an answer, and `at` (monotonic seconds) when it came."""

    texts: tuple[str, ...]
    at: float

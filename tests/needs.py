"""What tests need beside Python: `python -m tests.needs [ARGUMENT OF PYTEST]…` prints the target of the
Makefile that sets it up, or nothing where they need nothing."""

import io
import sys
from contextlib import redirect_stderr, redirect_stdout

import pytest

# Who takes one of these fixtures needs the bridge, the ROS 2 nodes or the browser.
PARTS = {
    "domain",
    "cyclone_bridge",
    "own_cyclone_bridge",
    "robots",
    "ros",
    "chromium",
    "other_browser",
    "screen",
    "screens",
    "sway",
    "units",
}


def needs_part(item: pytest.Item) -> bool:
    return bool(PARTS.intersection(getattr(item, "fixturenames", ())))


def needs_parts(session: pytest.Session) -> bool:
    """Whether a test that was collected needs a real part."""
    return any(map(needs_part, session.items))


class Collected:
    """A plugin: whether what was collected needs real parts; what could not be collected may."""

    needs = True

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        self.needs = needs_parts(session)


def main(arguments: list[str]) -> None:
    collected = Collected()
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        status = pytest.main([*arguments, "--collect-only", "-q"], plugins=[collected])
    if collected.needs or status is not pytest.ExitCode.OK:
        print("test-parts")


if __name__ == "__main__":
    main(sys.argv[1:])

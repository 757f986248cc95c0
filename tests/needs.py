"""What tests need beside Python: `python -m tests.needs [ARGUMENT OF PYTEST]…` prints the target of the
Makefile that sets it up, or nothing where they need nothing. Tests that cannot be collected set up
nothing: pytest's output is printed, and the exit status is 2."""

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
    "broker",
}


def needs_part(item: pytest.Item) -> bool:
    return bool(PARTS.intersection(getattr(item, "fixturenames", ())))


def needs_parts(session: pytest.Session) -> bool:
    """Whether a test that was collected needs a real part."""
    return any(map(needs_part, session.items))


class Collected:
    """A plugin: whether the collected tests need real parts."""

    needs = False

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        self.needs = needs_parts(session)


def main(arguments: list[str]) -> None:
    collected = Collected()
    output = io.StringIO()
    with redirect_stdout(output), redirect_stderr(output):
        status = pytest.main([*arguments, "--collect-only", "-q"], plugins=[collected])
    if status != pytest.ExitCode.OK:
        print(output.getvalue(), end="", file=sys.stderr)
        sys.exit(2)
    if collected.needs:
        print("test-parts")


if __name__ == "__main__":
    main(sys.argv[1:])

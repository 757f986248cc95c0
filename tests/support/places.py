"""Where the project and the real parts of the tests are on this machine."""

import os
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parent.parent.parent
TESTS: Final = ROOT / "tests"
SHIPPED: Final = ROOT / "app/panel.toml"
# The page of the reference system alone: its robot permits and forbids in turns.
REFERENCE: Final = TESTS / "reference.toml"
BRIDGE: Final = Path(
    os.environ.get("TEST_BRIDGE") or Path.home() / ".cache/operator-panel/bridge/release/test-bridge"
)
# A node on hiroz, beside the bridge: `tests/rmw_crate/`.
RMW_ROBOT: Final = BRIDGE.with_name("test-rmw-robot")
ZENOHD: Final = BRIDGE.parents[1] / "bin/zenohd"
ROS_PYTHON: Final = Path(os.environ.get("TEST_ROS_PYTHON") or ROOT / ".venv-ros/bin/python")
CHROMIUM: Final = "/usr/bin/chromium"
# The same engine without windows: a page takes a quarter of the CPU time.
HEADLESS: Final = "/usr/bin/chromium-headless-shell"

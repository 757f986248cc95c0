"""Imports go one way, from what knows nothing to what wires all; Zenoh has two doors. Modules are
short."""

import ast
import graphlib
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

import pytest

from app.settings import PACKAGE
from tests.support.parts import ROOT

# The rooms, from the ground up: a room imports only from those before it.
ROOMS = (
    "interfaces",
    "dialect",
    "survey",
    "panel",
    "robot",
    "permission",
    "audit",
    "access",
    "certificates",
    "trends",
    "alarms",
    "recipes",
    "view",
    "commands",
    "recording",
    "transport",
    "runtime",
    "process",
    "kiosk",
    "install",
    "web",
    "simulator",
    "scaffold",
    "diagnose",
    "cli",
)
# What every room may import.
COMMON = {
    "app.bounded",
    "app.clock",
    "app.concurrency",
    "app.disk_writer",
    "app.errors",
    "app.i18n",
    "app.i18n.__main__",
    "app.i18n.catalogue",
    "app.i18n.locales",
    "app.i18n.text",
    "app.i18n.typed_numbers",
    "app.i18n.values",
    "app.icons",
    "app.page_process",
    "app.pictures",
    "app.printable",
    "app.rate_limit",
    "app.repeated_records",
    "app.roles",
    "app.ros_logging",
    "app.settings",
    "app.toml_values",
    "app.version",
}
WIRING = {"app.main", "app.check", "app.log", "app.simulator.__main__"}  # these may import every room
SPEAK_ZENOH = {
    "app.transport.token_query",
    "app.transport.zenoh_answers",
    "app.transport.zenoh_config",
    "app.transport.zenoh_opening",
    "app.transport.zenoh_publishers",
    "app.transport.zenoh_session",
    "app.simulator.zenoh_action",
    "app.simulator.zenoh_peer",
    "app.simulator.zenoh_wire",
}
# The dialect and the peer of each kind of robot, and who else may know them.
OF_A_KIND: dict[tuple[str, ...], set[str]] = {
    ("app.dialect.bridge_", "app.transport.bridge_"): {
        "app.cli.bridge_config",
        "app.dialect.auto_dialect",
        "app.runtime.robot_access",
        "app.simulator.zenoh_peer",
        "app.transport.auto_peer",
        "app.transport.rmw_zenoh_router",  # a panel may look whether a bridge is there
        "app.simulator.zenoh_wire",
    },
    ("app.dialect.rmw_zenoh_", "app.transport.rmw_zenoh_"): {
        "app.cli.router_config",
        "app.dialect.auto_dialect",
        "app.runtime.robot_access",
        "app.simulator.zenoh_wire",
        "app.transport.auto_peer",
    },
}
KNOWN_TO_THE_SIMULATOR = (
    "app.simulator",
    "app.interfaces",
    "app.dialect",
    "app.panel",  # descriptions: what a robot has to have
    "app.errors",
    "app.i18n",
)


def name_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(path): path for path in sorted(PACKAGE.rglob("*.py"))}


def read_imports(module: str) -> Iterator[str]:
    """Every module that a module names in an `import`, wherever it stands."""
    for node in ast.walk(ast.parse(MODULES[module].read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module} imports relatively, in line {node.lineno}"
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in MODULES else str(node.module)


@cache
def imported() -> Mapping[str, list[str]]:
    """What each module imports. Parsed in another process: with threads Python 3.11.7 may fail to
    (gh-106905)."""
    code = (
        "import json; from tests.test_imports import MODULES, read_imports;"
        " print(json.dumps({module: [*read_imports(module)] for module in MODULES}))"
    )
    modules: dict[str, list[str]] = json.loads(
        subprocess.check_output([sys.executable, "-c", code], cwd=PACKAGE.parent, text=True)
    )
    return modules


def of_project(module: str) -> set[str]:
    return {name for name in imported()[module] if name.partition(".")[0] == "app"}


def of_zenoh(module: str) -> bool:
    return any(name.partition(".")[0] == "zenoh" for name in imported()[module])


def room_of(module: str) -> str:
    """The room of a module; "" for those beside the rooms."""
    name = module.removeprefix("app.").partition(".")[0]
    return name if name in ROOMS else ""


def test_every_module_is_in_a_room_or_is_common_or_wires() -> None:
    beside = {module for module in set(MODULES) - {"app"} if not room_of(module)}
    assert beside | WIRING == COMMON | WIRING


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_imports_only_from_those_before_it(room: str) -> None:
    before = {*ROOMS[: ROOMS.index(room) + 1], ""}
    back = sorted(
        f"{module} imports {name}"
        for module in MODULES
        if room_of(module) == room and module not in WIRING
        for name in of_project(module)
        if room_of(name) not in before or name in WIRING
    )
    assert back == []


def test_common_modules_import_no_room() -> None:
    assert {name for module in COMMON for name in of_project(module)} <= COMMON


def test_no_module_imports_itself_by_way_of_others() -> None:
    order = graphlib.TopologicalSorter({module: of_project(module) for module in MODULES})
    order.prepare()  # CycleError names those of a cycle


def test_only_the_link_and_the_simulator_speak_zenoh() -> None:
    assert {module for module in MODULES if of_zenoh(module)} == SPEAK_ZENOH


@pytest.mark.parametrize("modules", OF_A_KIND)
def test_only_the_wiring_and_the_simulator_know_that_there_is_a_kind(modules: tuple[str, ...]) -> None:
    """A robot of another kind is reached by another dialect and another peer."""
    others = {module for module in MODULES if not module.startswith(modules)}
    know = {m for m in others if any(name.startswith(modules) for name in of_project(m))}
    assert know == OF_A_KIND[modules]


def test_nothing_asks_which_dialect_it_is() -> None:
    """Beside the tables, only a dialect, a transport and the simulator know what depends on it."""
    asks = re.compile(r"dialect\s*(==|!=|in|is)\s*[\"'(]")
    rooms = ("dialect", "transport", "simulator")
    asking = {m for m, path in MODULES.items() if asks.search(path.read_text())}
    assert {module for module in asking if room_of(module) not in rooms} == set()


def test_the_simulator_knows_nothing_of_the_server() -> None:
    own = [m for m in MODULES if room_of(m) == "simulator" and m not in WIRING]
    known = {name for module in own for name in of_project(module)}
    assert {name for name in known if not name.startswith(KNOWN_TO_THE_SIMULATOR)} == set()


def test_a_start_reads_no_library_that_most_kiosks_never_need(tmp_path: Path) -> None:
    env = {**os.environ, "KIOSK_DATA": str(tmp_path)}
    code = "import sys, app.main; print(*sys.modules)"
    read = subprocess.check_output([sys.executable, "-c", code], cwd=PACKAGE.parent, env=env, text=True)
    of_faults = {"app.panel.faults.shape", "app.panel.faults.toml_lines", "app.panel.preview"}
    of_demos = {"app.simulator.panel_robot", "app.simulator.zenoh_peer"}
    assert {"mcap", "prometheus_client", *of_faults, *of_demos} & set(read.split()) == set()


def test_only_replay_imports_the_extra_packages() -> None:
    """`make_builtin` is not in the wheel."""
    lacking = ("rosbags", "numpy", "apsw", "ruamel")
    need = {m for m in MODULES for name in imported()[m] if name.partition(".")[0] in lacking}
    assert need == {"app.simulator.bag.files", "app.interfaces.make_builtin"}
    needed_by = {m for m in MODULES if need & of_project(m)} - need
    assert needed_by == {"app.simulator.bag.recording"}


def test_objects_of_the_start_are_frozen_for_the_garbage_collector(tmp_path: Path) -> None:
    env = {**os.environ, "KIOSK_DATA": str(tmp_path)}
    code = "import app.main, gc; print(gc.isenabled(), gc.get_freeze_count(), len(gc.get_objects()))"
    said = subprocess.check_output([sys.executable, "-c", code], cwd=PACKAGE.parent, env=env, text=True)
    enabled, frozen, watched = said.split()
    assert enabled == "True"
    assert int(frozen) > 20 * int(watched)


def test_the_interfaces_know_nothing_but_errors() -> None:
    own = {module for module in MODULES if room_of(module) == "interfaces"}
    assert {name for module in own for name in of_project(module)} - own <= {"app.errors"}


@pytest.mark.parametrize(
    "module",
    [
        "app.permission.interlocks",
        "app.permission.control_authority",
        "app.view.view",
        "app.commands.presses",
        "app.view.publisher",
        "app.runtime.robot_session",
    ],
)
def test_deciding_modules_import_no_http(module: str) -> None:
    frameworks = {"starlette", "uvicorn", "jinja2", "app.web.routes"}
    assert {name for name in imported()[module] if name.startswith(tuple(frameworks))} == set()


def test_the_runner_of_acts_knows_none_of_their_tables() -> None:
    assert {name for name in of_project("app.commands.acts") if "control" in name} == set()


MOST_LINES = {"app": ("*.py", 300), "static": ("*.js", 200)}


@pytest.mark.parametrize("folder", MOST_LINES)
def test_modules_are_short(folder: str) -> None:
    pattern, most = MOST_LINES[folder]
    lengths = {
        str(path.relative_to(ROOT)): len(path.read_text().splitlines())
        for path in (ROOT / folder).rglob(pattern)
    }
    assert lengths
    assert {path: length for path, length in lengths.items() if length > most} == {}

"""Imports go one way, from what knows nothing to what wires all; Zenoh has two doors."""

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

from app.system.settings import PACKAGE

# The rooms, from the ground up: a room imports only from those before it.
ROOMS = ("system", "ros", "panel", "records", "cell", "web", "tools")
# The folders of a room, from the ground up in the same way. The definitions and the codec read each
# other.
FOLDERS: dict[str, tuple[tuple[str, ...], ...]] = {
    "ros": (("messages", "cdr"), ("dialects",), ("zenoh",), ("graph",)),
    "cell": (
        ("robot",),
        ("permission",),
        ("people",),
        ("recipes",),
        ("places",),
        ("alarms",),
        ("link",),
        ("view",),
        ("commands",),
        ("stops",),
        ("history",),
        ("forward",),
        ("site",),
        ("session",),
    ),
    "tools": (
        ("cell_config", "doctor", "install", "kiosk", "simulator"),
        ("scaffold",),
        ("robot",),
        ("editor",),
        ("prove",),
        ("central",),
        ("cli",),
    ),
}
# Names that commands and other programs use; these may import every room.
WIRING = {
    "app.check",
    "app.cli",
    "app.i18n",
    "app.kiosk",
    "app.kiosk.waiting_page",
    "app.log",
    "app.main",
    "app.simulator",
}
SPEAK_ZENOH = {
    "app.ros.zenoh.session",
    "app.ros.zenoh.answers",
    "app.ros.zenoh.config",
    "app.ros.zenoh.site",
    "app.tools.simulator.zenoh",
}
# The dialect and the peer of each kind of robot, and who else may know them.
OF_A_KIND: dict[tuple[str, ...], set[str]] = {
    (
        *("app.ros.dialects.bridge_", "app.ros.graph.bridge_"),
        *("app.cell.link.bridge", "app.tools.cell_config.bridge_"),
    ): {
        "app.tools.cli.bridge_config",
        "app.ros.dialects.auto_dialect",
        "app.cell.link.robot_access",
        "app.tools.simulator.zenoh",
        "app.cell.link.auto_peer",
        "app.tools.cell_config.rmw_zenoh_router",
    },
    (
        *("app.ros.dialects.rmw_zenoh", "app.ros.graph.rmw_zenoh_"),
        *("app.cell.link.rmw_zenoh", "app.tools.cell_config.rmw_zenoh_"),
    ): {
        "app.tools.cli.router_config",
        "app.ros.dialects.auto_dialect",
        "app.cell.link.robot_access",
        "app.tools.simulator.zenoh",
        "app.cell.link.auto_peer",
    },
}
KNOWN_TO_THE_SIMULATOR = (
    "app.tools.simulator",
    "app.ros.messages",
    "app.ros.cdr",
    "app.ros.dialects",
    "app.panel",  # descriptions: what a robot has to have
    "app.system.errors",
    "app.system.texts",
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
    return name if name in ROOMS and module not in WIRING else ""


def is_in(module: str, *folders: str) -> bool:
    """Whether a module is in one of the folders, such as "ros/dialects"."""
    return f"{module.removeprefix('app.').replace('.', '/')}/".startswith(
        tuple(f"{name}/" for name in folders)
    )


def test_every_module_is_in_a_room_or_wires() -> None:
    assert {module for module in set(MODULES) - {"app"} if not room_of(module)} == WIRING


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_imports_only_from_those_before_it(room: str) -> None:
    before = ROOMS[: ROOMS.index(room) + 1]
    back = sorted(
        f"{module} imports {name}"
        for module in MODULES
        if room_of(module) == room
        for name in of_project(module)
        if room_of(name) not in before
    )
    assert back == []


@pytest.mark.parametrize("room", FOLDERS)
def test_a_folder_of_a_room_imports_only_from_those_before_it(room: str) -> None:
    names = {name for floor in FOLDERS[room] for name in floor}
    inside = {path.name for path in (PACKAGE / room).iterdir() if (path / "__init__.py").exists()}
    assert names == inside
    before: list[str] = []
    for floor in FOLDERS[room]:
        before += [f"{room}/{name}" for name in floor]
        back = sorted(
            f"{module} imports {name}"
            for module in MODULES
            if is_in(module, *before)
            for name in of_project(module)
            if room_of(name) == room and not is_in(name, *before)
        )
        assert back == []


def test_only_the_tools_know_the_reference_of_the_panel_file() -> None:
    """The server needs neither the words of keys nor the JSON Schema."""
    reference = "app.panel.reference"
    others = {m for m in MODULES if room_of(m) != "tools" and not m.startswith(reference)}
    assert {m for m in others if any(name.startswith(reference) for name in of_project(m))} == set()


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
    folders = ("ros/dialects", "ros/graph", "ros/zenoh", "cell/link", "tools/cell_config")
    asking = {m for m, path in MODULES.items() if asks.search(path.read_text())}
    assert {module for module in asking if not is_in(module, *folders, "tools/simulator")} == set()


def test_the_simulator_knows_nothing_of_the_server() -> None:
    own = [module for module in MODULES if is_in(module, "tools/simulator")]
    known = {name for module in own for name in of_project(module)}
    assert {name for name in known if not name.startswith(KNOWN_TO_THE_SIMULATOR)} == set()


def test_a_start_reads_no_library_that_most_kiosks_never_need(tmp_path: Path) -> None:
    env = {**os.environ, "KIOSK_DATA": str(tmp_path)}
    code = "import sys, app.main; print(*sys.modules)"
    read = subprocess.check_output([sys.executable, "-c", code], cwd=PACKAGE.parent, env=env, text=True)
    of_faults = {"app.panel.file.shape", "app.panel.file.toml_lines", "app.panel.file.preview"}
    of_demos = {"app.tools.simulator.panel_robot", "app.tools.simulator.zenoh"}
    assert {"mcap", "prometheus_client", *of_faults, *of_demos} & set(read.split()) == set()


def test_only_replay_imports_the_extra_packages() -> None:
    """`make_builtin` is not in the wheel."""
    lacking = ("rosbags", "numpy", "apsw", "ruamel")
    need = {m for m in MODULES for name in imported()[m] if name.partition(".")[0] in lacking}
    assert need == {"app.tools.simulator.bag", "app.ros.messages.make_builtin"}
    needed_by = {m for m in MODULES if need & of_project(m)} - need
    assert needed_by == {"app.tools.cli.simulate"}


def test_objects_of_the_start_are_frozen_for_the_garbage_collector(tmp_path: Path) -> None:
    env = {**os.environ, "KIOSK_DATA": str(tmp_path)}
    code = "import app.main, gc; print(gc.isenabled(), gc.get_freeze_count(), len(gc.get_objects()))"
    said = subprocess.check_output([sys.executable, "-c", code], cwd=PACKAGE.parent, env=env, text=True)
    enabled, frozen, watched = said.split()
    assert enabled == "True"
    assert int(frozen) > 20 * int(watched)


def test_the_interfaces_know_nothing_but_errors() -> None:
    own = {module for module in MODULES if is_in(module, "ros/messages", "ros/cdr")}
    assert {name for module in own for name in of_project(module)} - own <= {"app.system.errors"}


@pytest.mark.parametrize(
    "module",
    [
        "app.cell.permission.interlocks",
        "app.cell.permission.control",
        "app.cell.view.view",
        "app.cell.commands.presses",
        "app.cell.view.publisher",
        "app.cell.session.session",
    ],
)
def test_deciding_modules_import_no_http(module: str) -> None:
    frameworks = {"starlette", "uvicorn", "jinja2", "app.web.routes"}
    assert {name for name in imported()[module] if name.startswith(tuple(frameworks))} == set()


def test_the_runner_of_acts_knows_none_of_their_tables() -> None:
    assert {name for name in of_project("app.cell.commands.acts") if "control" in name} == set()

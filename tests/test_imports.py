"""Imports go one way, from what knows nothing to what wires all; Zenoh has two doors."""

import ast
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.settings import PACKAGE

# A module imports only from those that stand before it.
ORDER = (
    "app.collector",
    "app.printable",
    "app.errors",
    "app.settings",
    "app.sentences",
    "app.browsers",
    "app.logs",
    "app.tasks",
    "app.waits",
    "app.ending",
    "app.heap",
    "app.moments",
    "app.rate_limit",
    "app.systemd",
    "app.sockets",
    "app.connections",
    "app.watchdog",
    "app.keys",
    "app.interfaces.definitions",
    "app.interfaces.formats",
    "app.interfaces.scalars",
    "app.interfaces.literals",
    "app.interfaces.composition",
    "app.interfaces.parsing",
    "app.interfaces.packages",
    "app.interfaces.paths",
    "app.interfaces.plain",
    "app.interfaces.hashes",
    "app.interfaces.values",
    "app.interfaces.decoding",
    "app.interfaces.encoding",
    "app.interfaces.envelope",
    "app.interfaces.layout",
    "app.interfaces.wanted",
    "app.interfaces.programs",
    "app.interfaces.reading",
    "app.interfaces.beginnings",
    "app.interfaces.fields",
    "app.interfaces.codec",
    "app.interfaces.text",
    "app.interfaces.kept",
    "app.interfaces.stock",
    "app.interfaces.distributions",
    "app.interfaces.store",
    "app.interfaces",
    "app.panel.description",
    "app.panel.control",
    "app.panel.inputs",
    "app.panel.displays",
    "app.panel.ranges",
    "app.panel.listed",
    "app.panel.parameter",
    "app.panel.interlock",
    "app.panel.log",
    "app.panel.record",
    "app.panel.model",
    "app.panel.template",
    "app.panel.wording",
    "app.panel.examples",
    "app.panel.check_inputs",
    "app.panel.constants",
    "app.panel.check_types",
    "app.panel.check_displays",
    "app.panel.check_interlocks",
    "app.panel.check_confirm",
    "app.panel.check_parameters",
    "app.panel.check_calls",
    "app.panel.check_holds",
    "app.panel.check",
    "app.panel.notes",
    "app.panel.toml_file",
    "app.panel.toml_lines",
    "app.panel.places",
    "app.panel.keys_of_tables",
    "app.panel.shape",
    "app.panel.stand_ins",
    "app.panel.causes",
    "app.panel.message_text",
    "app.panel.preview",
    "app.panel.load",
    "app.panel",
    "app.check",
    "app.log.entry",
    "app.log.file",
    "app.log.folder",
    "app.log.store",
    "app.log.chain",
    "app.log.reading",
    "app.log.export",
    "app.log.reader",
    "app.log.process",
    "app.log.places",
    "app.log.readers",
    "app.log.refusals",
    "app.log.ticket",
    "app.log.syncer",
    "app.log.opening",
    "app.log.keeper",
    "app.log.writer",
    "app.log.unlogged",
    "app.log",
    "app.log.__main__",
    "app.inputs",
    "app.declared",
    "app.parameter_values",
    "app.graph",
    "app.progress",
    "app.seen",
    "app.silent_publishers",
    "app.samples",
    "app.slices",
    "app.topics",
    "app.robot",
    "app.conditions",
    "app.interlocks",
    "app.lamps",
    "app.control_view",
    "app.control",
    "app.displays",
    "app.parameter_display",
    "app.views",
    "app.since",
    "app.heartbeat",
    "app.board",
    "app.confirmations",
    "app.calls",
    "app.goals",
    "app.action_services",
    "app.following",
    "app.actions",
    "app.parameter_services",
    "app.parameters",
    "app.logbook",
    "app.press_limits",
    "app.resuming",
    "app.receipts",
    "app.doubts",
    "app.sending",
    "app.unjudged",
    "app.recall",
    "app.presses",
    "app.leases",
    "app.hold_messages",
    "app.hold_receipts",
    "app.holds",
    "app.recording.ring",
    "app.recording.file",
    "app.recording.folder",
    "app.recording.writer",
    "app.recording.recorder",
    "app.recording",
    "app.rosout",
    "app.bridges",
    "app.tokens",
    "app.inbox",
    "app.attached",
    "app.link",
    "app.intake",
    "app.joining",
    "app.asked",
    "app.pulse",
    "app.showing",
    "app.kiosk",
    "app.fleet",
    "app.metrics",
    "app.owed",
    "app.exposition",
    "app.assets",
    "app.doors",
    "app.proxies",
    "app.startup",
    "app.routes.messages",
    "app.serving",
    "app.direct",
    "app.routes.described",
    "app.routes.site",
    "app.routes.visitors",
    "app.routes.pages",
    "app.routes.events",
    "app.routes.presses",
    "app.routes.parameters",
    "app.routes.press_socket",
    "app.routes.control",
    "app.routes.holds",
    "app.routes.health",
    "app.routes.static",
    "app.routes.log",
    "app.routes",
    "app.development",
    "app.demo_parameters",
    "app.demo",
    "app.simulator",
    "app.main",
)
SPEAK_ZENOH = {"app.link", "app.simulator"}
KNOWN_TO_THE_SIMULATOR = {
    "app.demo",
    "app.demo_parameters",
    "app.errors",
    "app.interfaces",
    "app.keys",
}


def name_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


# Parsed before any test has threads: with threads Python 3.11.7 may fail to (gh-106905).
MODULES = {name_of(path): ast.parse(path.read_text()) for path in sorted(PACKAGE.rglob("*.py"))}


def imported(module: str) -> Iterator[str]:
    """Every module that a module names in an `import`, wherever it stands."""
    for node in ast.walk(MODULES[module]):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module} imports relatively, in line {node.lineno}"
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in MODULES else str(node.module)


def of_project(module: str) -> set[str]:
    return {name for name in imported(module) if name.partition(".")[0] == "app"}


def of_zenoh(module: str) -> bool:
    return any(name.partition(".")[0] == "zenoh" for name in imported(module))


def test_every_module_has_its_place_in_the_order() -> None:
    assert set(MODULES) - {"app"} == set(ORDER)


@pytest.mark.parametrize("module", [name for name in ORDER if name in MODULES])
def test_a_module_imports_only_what_stands_before_it(module: str) -> None:
    before = set(ORDER[: ORDER.index(module)])
    back = sorted(of_project(module) - before)
    assert back == [], f"{module} imports {', '.join(back)}: that goes back"


def test_only_the_link_and_the_simulator_speak_zenoh() -> None:
    assert {module for module in MODULES if of_zenoh(module)} == SPEAK_ZENOH


def test_the_simulator_knows_nothing_of_the_server() -> None:
    assert of_project("app.simulator") <= KNOWN_TO_THE_SIMULATOR


def test_a_start_reads_no_library_that_most_kiosks_never_need(tmp_path: Path) -> None:
    env = {**os.environ, "KIOSK_DATA": str(tmp_path)}
    code = "import sys, app.main; print(*sys.modules)"
    read = subprocess.check_output([sys.executable, "-c", code], cwd=PACKAGE.parent, env=env, text=True)
    of_faults = {"app.panel.shape", "app.panel.toml_lines", "app.panel.preview"}
    assert {"mcap", "prometheus_client", *of_faults} & set(read.split()) == set()


def test_the_interfaces_know_nothing_of_the_panel() -> None:
    own = {module for module in MODULES if module.startswith("app.interfaces")}
    assert {name for module in own for name in of_project(module)} - own <= {"app.errors"}


def test_the_link_knows_no_view_and_no_panel() -> None:
    assert of_project("app.link") <= {"app.attached", "app.errors", "app.inbox", "app.keys"}


@pytest.mark.parametrize(
    "module", ["app.interlocks", "app.control", "app.views", "app.presses", "app.board", "app.kiosk"]
)
def test_what_decides_knows_no_http(module: str) -> None:
    frameworks = {"starlette", "uvicorn", "jinja2", "app.routes"}
    assert {name for name in imported(module) if name.startswith(tuple(frameworks))} == set()

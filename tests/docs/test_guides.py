"""What the guides in docs/ show can be used as it stands there."""

import re
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Final

import pytest

from app.panel import load_panel
from tests.docs.test_palletizing import PANELS as QUOTED_PANELS
from tests.support.beside_panel import put_named_files
from tests.support.parts import ROOT, Server
from tests.support.processes import command

DOCS: Final = ROOT / "docs"
OWN: Final = '# interfaces = ["cell_msgs"]'
JOG: Final = "float64 speed\nuint32 valid_ms\nuint16 number\n"
ALL_KINDS: Final = {
    *("text", "slider", "publish", "call", "action", "parameter", "hold", "readout", "indicator")
}


def examples(name: str) -> list[str]:
    """The TOML blocks of a page."""
    text = (DOCS / name).read_text()
    return re.findall(r"^```toml\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


GUIDE: Final = examples("panel-file.md")
HOW_TOS: Final = [
    f"how-to/{path.name}"
    for path in sorted((DOCS / "how-to").glob("*.md"))
    if f"docs/how-to/{path.name}" not in QUOTED_PANELS  # its examples are of that panel
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder for a panel file, with the message of the hold's example."""
    messages = tmp_path / "cell_msgs/msg"
    messages.mkdir(parents=True)
    (messages / "Jog.msg").write_text(JOG)
    return tmp_path


def kinds(folder: Path, *blocks: str) -> set[str]:
    """The kinds of widgets of a panel that these blocks are."""
    whole = "\n".join(blocks)
    assert OWN in whole
    put_named_files(folder, whole)
    panel = folder / "cell1.toml"
    panel.write_text(whole.replace(OWN, OWN.removeprefix("# ")))
    return {widget.kind for widget in load_panel(panel).widgets()}


def test_first_panel_of_the_guide_is_valid(tmp_path: Path) -> None:
    panel = tmp_path / "cell1.toml"
    panel.write_text(GUIDE[0])
    assert load_panel(panel).title == "Robot cell 1"


@pytest.mark.parametrize("name", [name for name in HOW_TOS if examples(name)])
def test_the_example_of_each_how_to_fits_the_guides_panel(folder: Path, name: str) -> None:
    assert kinds(folder, *GUIDE, *examples(name)) >= kinds(folder, *GUIDE)


def test_all_examples_together_are_a_panel(folder: Path) -> None:
    used = kinds(folder, *GUIDE, *(block for name in HOW_TOS for block in examples(name)))
    assert used >= ALL_KINDS


@pytest.mark.parametrize("path", sorted((DOCS / "examples").glob("*.toml")), ids=lambda path: path.name)
def test_each_example_panel_is_good(path: Path) -> None:
    assert load_panel(path).mode == "demo"


def test_the_settings_of_the_bridge_are_those_of_its_file() -> None:
    page = (DOCS / "how-to/bridge.md").read_text()
    shipped = (ROOT / "deploy/bridge.json5").read_text()
    rows = re.findall(r"^\| `[\w.]*\b(\w+)` \| `?(\w+)`?(?: \(.*?\))? \|", page, re.MULTILINE)
    assert len(rows) == 4
    for name, value in rows:
        assert re.search(rf'\b{name}: "?{value}"?,| {name}: {value} ', shipped), name


def test_the_lines_to_change_are_in_the_shipped_files() -> None:
    page = (DOCS / "how-to/bridge.md").read_text()
    listen, connect = re.findall(r"^```text\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    for lines, name in ((listen, "deploy/bridge.json5"), (connect, "zenoh.json5")):
        assert lines.replace("192.0.2.10", "127.0.0.1") in (ROOT / name).read_text()


@pytest.mark.parametrize("name", ["README.md", "docs/how-to/bridge.md", "docs/compatibility.md"])
def test_documented_bridge_version_is_the_tested_version(name: str) -> None:
    cargo = (ROOT / "tests/bridge_crate/Cargo.toml").read_text()
    (version,) = re.findall(r'zenoh-plugin-ros2dds = \{ version = "=([\d.]+)"', cargo)
    assert version in (ROOT / name).read_text()


def test_settings_that_the_service_page_names_are_in_the_unit() -> None:
    page = (DOCS / "how-to/service.md").read_text()
    unit = (ROOT / "deploy/operator-panel.service").read_text().splitlines()
    said = re.findall(r"`([A-Z]\w+=\S+?)`", page)
    assert len(said) >= 6
    assert [line for line in said if line not in unit] == []


def test_a_backup_of_a_running_servers_log_is_whole(demo: Server, tmp_path: Path) -> None:
    assert demo.press("operation", "before the backup").status_code == 200
    name = "operators-log.sqlite3"
    with (
        closing(sqlite3.connect(demo.data / name)) as log,
        closing(sqlite3.connect(tmp_path / name)) as copy,
    ):
        log.backup(copy)  # as sqlite3's .backup does
    verified = command.run("app.log", "verify", "--data", str(tmp_path))
    assert verified.returncode == 0, verified.stdout + verified.stderr
    assert int(verified.stdout.split()[1]) >= 3

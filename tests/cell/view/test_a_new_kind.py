"""Two kinds of widgets are added as `docs/adding-a-widget-kind.md` says: a class, a row, a macro.

The code is that of the page, put into a copy of the project that then runs a panel of these kinds.
"""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import httpx
import pytest

from tests.support.parts import ROOT, Server, until
from tests.support.servers import ready

GUIDE: Final = ROOT / "docs/adding-a-widget-kind.md"
BLOCK: Final = re.compile(r'^```[\w+]+ title="([^"]+)"\n(.*?)^```$', re.DOTALL | re.MULTILINE)


def add(path: Path, code: str) -> None:
    """A new file; to one that is there, its imports and the row behind the first line of a table."""
    if not path.exists():
        path.write_text(code)
        return
    parts = re.fullmatch(r"(.*?)\n\n(.*? = \{\n)(.*)", code, re.DOTALL)
    assert parts is not None, f"no imports, table and row for {path}: {code}"
    imports, table, row = parts.groups()
    text = path.read_text()
    assert text.count(table) == 1, f"{path} has no {table}"
    text = text.replace(table, table + row).replace("\nfrom app.", f"\n{imports}\nfrom app.", 1)
    path.write_text(text)


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project with the kinds of the guide."""
    folder = tmp_path_factory.mktemp("project")
    for name in ("app", "templates", "static"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "zenoh.json5", folder)
    for name, code in BLOCK.findall(GUIDE.read_text()):
        add(folder / name, code)
    return folder


@pytest.fixture(scope="module")
def kiosk(project: Path) -> Iterator[Server]:
    with ready(Server(project, KIOSK_PANEL=str(project / "panel.toml"))) as mine:
        until(lambda: mine.widget("greet")["enabled"], "the demo robot permits", within_s=40)
        yield mine


def published(kiosk: Server) -> dict[str, Any] | None:
    """The receipt of a press that was not refused."""
    receipt: dict[str, Any] = kiosk.http.post("/widgets/greet", json={"inputs": {}}).json()
    return receipt if receipt["outcome"] == "published" else None


def check(project: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "app.check", *arguments],
        cwd=project,
        capture_output=True,
        text=True,
        timeout=60,
    )


def test_the_guide_adds_files_and_rows() -> None:
    names = [name for name, _ in BLOCK.findall(GUIDE.read_text())]
    assert len(names) == 9
    assert [name for name in names if (ROOT / name).exists()] == [
        "app/panel/widgets/kinds.py",
        "app/cell/view/kinds.py",
        "app/panel/widgets/kinds.py",
    ]


def test_values_of_a_new_kind_are_in_events_snapshot_and_page(kiosk: Server) -> None:
    shown = "one\ntwo\nthree (/operation1)"
    with kiosk.stream() as stream:
        _, data, _ = stream.next("snapshot")
        assert (data["widgets"]["heard"]["state"], data["widgets"]["heard"]["count"]) == ("waiting", 0)
        pressed = until(lambda: published(kiosk), "the demo robot permits", within_s=40)
        assert pressed["widget"] == "greet"

        def heard() -> bool:
            _, data, _ = stream.next("update")
            return bool(data.get("heard", {}).get("text") == shown)

        until(heard, "an event says what the robot heard")
    snapshot = kiosk.widget("heard")
    assert (snapshot["state"], snapshot["text"], snapshot["count"]) == ("live", shown, 3)
    html = kiosk.http.get("/").text
    assert f'<pre data-text="text">{shown}</pre>' in html
    assert re.search(r'<meter min="0" max="5" value="3" data-value="count"', html)
    assert 'data-widget="greet" data-kind="say"' in html


def test_a_new_command_takes_no_other_input_than_its_own(kiosk: Server) -> None:
    def judged() -> httpx.Response | None:
        answer = kiosk.press("greet")
        return None if answer.status_code in (409, 503) else answer

    refused: httpx.Response = until(judged, "the demo robot permits")
    assert (refused.status_code, refused.json()["outcome"]) == (422, "refused")


def test_the_server_does_not_start_with_a_kind_without_its_macro(project: Path, tmp_path: Path) -> None:
    shutil.copytree(project, tmp_path, dirs_exist_ok=True)
    (tmp_path / "templates/widgets/lines.html").unlink()
    started = subprocess.run(
        [sys.executable, "-m", "app.cli", "run", "panel.toml", "--port", "0"],
        cwd=tmp_path,
        env={**os.environ, "KIOSK_DATA": str(tmp_path / "data")},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert started.returncode != 0
    assert 'the widget kind "lines" has no template: add ' in started.stderr
    assert "Traceback" not in started.stderr


def test_app_check_knows_a_new_kind(project: Path) -> None:
    good = check(project, "--verbose", "panel.toml")
    assert good.returncode == 0, good.stderr
    assert "publishes /operation1 (std_msgs/msg/String)" in good.stdout
    assert 'data: "one; two; three"' in good.stdout


MISTAKES: Final = (
    ('type = "std_msgs/msg/String"', 'type = "std_msgs/msg/Bool"', ["lines are for a string"]),
    ('label = "Heard"', 'label = "Heard"\nmost = 0', ["page[0].widget[1].most", "1 or more"]),
    ('label = "Heard"', 'label = "Heard"\nmots = 3', ['did you mean "most"?']),
    ('text = "one', 'text = "{name} one', ['no input "name"']),
    ('interlock = "operation"', 'interlock = "operate"', ['no interlock "operate"']),
    ('kind = "lines"', 'kind = "line"', ['unknown kind "line"; did you mean "lines"?']),
)


def test_app_check_finds_the_faults_of_a_new_kind(project: Path) -> None:
    panel = (project / "panel.toml").read_text()
    names = [f"mistake{number}.toml" for number in range(len(MISTAKES))]
    for name, (old, new, _) in zip(names, MISTAKES, strict=True):
        assert panel.count(old) == 1
        (project / name).write_text(panel.replace(old, new))
    result = check(project, *names)
    assert (result.returncode, result.stdout) == (1, "")
    _, *said = re.split(r"^mistake\d\.toml can't be used:$", result.stderr, flags=re.MULTILINE)
    for of_one, (_, new, faults) in zip(said, MISTAKES, strict=True):
        for fault in faults:
            assert fault in of_one, new

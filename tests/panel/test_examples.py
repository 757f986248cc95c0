"""The examples of the documentation are good, fit their screens, and have values in the demo."""

from pathlib import Path
from typing import Final

import pytest

from app.panel.file.load import check_panel
from tests.support.parts import ROOT, Server, until
from tests.support.servers import ready

EXAMPLES: Final = sorted((ROOT / "docs/examples").glob("*/panel.toml"))
PLAYED: Final = [path for path in EXAMPLES if path.parent.name != "plan"]  # that shows what is pressed


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.parent.name)
def test_an_example_is_good_and_fits_its_screens(path: Path) -> None:
    checked = check_panel(path)
    assert [str(note) for note in checked.notes if "does not fit" in str(note)] == []


@pytest.mark.parametrize("path", PLAYED, ids=lambda path: path.parent.name)
def test_an_example_is_played_with_values_in_all_its_widgets(path: Path) -> None:
    panel = check_panel(path).panel
    server = ready(Server(ROOT, KIOSK_PANEL=str(path), KIOSK_MODE="demo"))
    try:
        for page in panel.pages:
            answer = server.http.get(f"/pages/{page.id}", follow_redirects=True)
            assert answer.status_code == 200
            for widget in page.widgets:
                assert f'data-widget="{widget.id}"' in answer.text
        if not panel.robots:
            cameras = {widget.id for widget in panel.widgets() if widget.kind == "camera"}
            until(lambda: waiting(server) <= cameras, "all values are there")  # cameras: while shown
    finally:
        server.end()


def waiting(server: Server) -> set[str]:
    """The widgets without a value."""
    shown = server.snapshot()["widgets"].items()
    return {name for name, widget in shown if widget.get("state") == "waiting"}

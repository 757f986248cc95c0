"""Files that a form uploads: stored beside the panel file if the panel's own checks take them."""

from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from app.panel.file.toml_lines import Path as TomlPath
from tests.support.editor import PANEL, EditorServer, editing

SVG = b'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1 1"/>'
WITH_PICTURE = """
[[page.widget]]
id = "plan"
kind = "image"
label = "Plan"
src = "missing.svg"
"""
SRC: TomlPath = ("page", 1, "widget", 1, "src")


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EditorServer]:
    with editing(tmp_path_factory.mktemp("editor"), PANEL + WITH_PICTURE) as running:
        yield running


def upload(server: EditorServer, path: str, name: str, data: bytes) -> httpx.Response:
    return server.http.post("/files", params={"path": path, "name": name}, content=data)


def text(server: EditorServer) -> str:
    return server.http.get("/text", params={"path": "[]"}).text


def test_a_picture_goes_into_the_folder_of_pictures_as_one_step(server: EditorServer) -> None:
    path = '["page", 1, "widget", 1, "src"]'
    assert upload(server, path, "plan.svg", SVG).status_code == 200
    folder = server.file.parent / "pictures"
    assert (folder / "plan.svg").read_bytes() == SVG
    assert 'pictures = "pictures"' in text(server)
    assert 'src = "plan.svg"' in text(server)
    assert "plan.svg" in server.part("form", path='["page", 1, "widget", 1]')
    other = upload(server, path, "plan.svg", SVG + b" ")
    assert other.status_code == 422
    assert other.json()["message"] == "Another file is called plan.svg. Rename one of them."
    assert server.http.post("/undo").status_code == 200
    assert "pictures =" not in text(server)


@pytest.mark.parametrize(
    ("path", "name", "data", "message"),
    [
        ('["page", 1, "widget", 1, "src"]', "../up.svg", SVG, "../up.svg is not the name"),
        ('["page", 1, "widget", 1, "src"]', "plan.exe", SVG, "plan.exe is not the name"),
        ('["page", 1, "template"]', "page.html", b"{{ widget(", "page.html"),
        ('["page", 1, "template"]', "huge.html", b" " * 8_000_001, "has more than 8 MB"),
    ],
)
def test_what_a_panel_can_not_use_is_refused_and_leaves_nothing(
    server: EditorServer, path: str, name: str, data: bytes, message: str
) -> None:
    before = text(server)
    refused = upload(server, path, name, data)
    assert refused.status_code == 422
    assert message in refused.json()["message"]
    assert text(server) == before
    assert not (server.file.parent / Path(name).name).exists()
    assert not list(server.file.parent.glob("pictures/*.exe"))

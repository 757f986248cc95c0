"""Files of recipes: whole or not at all, whatever ends the server, and a broken one is only itself."""

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final

import pytest

from app.cell.recipes.book import RecipeFolder
from app.cell.recipes.recipe import MAX_FILE_BYTES, BrokenRecipe, Recipe, new_recipe, recipe_text
from app.system.texts import Text
from app.system.whole_file import SUFFIX
from tests.cell.recipes.panels import CARTON, TRAY
from tests.support.parts import ROOT

CARTON_RECIPE: Final = new_recipe("carton", "created", 1_700_000_000.0, "Ann", "Carton", CARTON)
TEXT: Final = recipe_text(CARTON_RECIPE)
# Writes versions one after the other, and prints each when it is on the disk.
WRITER: Final = """
import sys
from pathlib import Path
from app.cell.recipes.book import RecipeFolder
from app.cell.recipes.recipe import new_recipe
folder = RecipeFolder(Path(sys.argv[1]))
recipe = new_recipe("carton", "created", 1.7e9, "Ann", "Carton", {"note": "x" * 20000})
for n in range(2, 10**9):
    folder.write(recipe)
    print(recipe.now.number, flush=True)
    recipe = recipe.changed("saved", 1.7e9 + n, "Ann")
"""
# Ends itself between the write and the rename.
KILLED: Final = """
import os, signal, sys
from pathlib import Path
from app.cell.recipes.book import RecipeFolder
from app.cell.recipes.recipe import new_recipe
os.replace = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
RecipeFolder(Path(sys.argv[1])).write(new_recipe("carton", "saved", 1.7e9, "Bob", "Other", {}))
"""
# Has a disk with room for so few bytes.
FULL: Final = """
import resource, signal, sys
from pathlib import Path
from app.cell.recipes.book import RecipeDiskError, RecipeFolder
from app.cell.recipes.recipe import new_recipe
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))
try:
    RecipeFolder(Path(sys.argv[1])).write(new_recipe("carton", "saved", 1.7e9, "Bob", "Other", {}))
except RecipeDiskError as error:
    print(error)
"""


def run(script: str, folder: Path) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-c", script, str(folder)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def read(folder: Path) -> dict[str, Recipe | BrokenRecipe]:
    return {entry.id: entry for entry in RecipeFolder(folder).read()}


def test_a_server_that_is_killed_between_write_and_rename_leaves_the_old_recipe(tmp_path: Path) -> None:
    RecipeFolder(tmp_path).write(CARTON_RECIPE)
    assert run(KILLED, tmp_path).returncode == -signal.SIGKILL
    assert read(tmp_path) == {"carton": CARTON_RECIPE}
    newer = CARTON_RECIPE.changed("saved", 1_700_000_001.0, "Ann", values=TRAY)
    (left,) = (file for file in tmp_path.iterdir() if file.suffix == SUFFIX)
    os.utime(left, (0, 0))
    RecipeFolder(tmp_path).write(newer)
    assert read(tmp_path) == {"carton": newer}
    assert [file.name for file in tmp_path.iterdir()] == ["carton.toml"]


def test_what_was_written_survives_a_kill_at_any_moment(tmp_path: Path) -> None:
    for _ in range(3):
        command = [sys.executable, "-c", WRITER, str(tmp_path)]
        with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as writer:
            assert writer.stdout is not None
            for line in writer.stdout:
                if int(line) >= 5:
                    break
            writer.kill()
            last = max(int(n) for n in (line, *writer.stdout.read().split()) if n.strip())
        recipe = read(tmp_path)["carton"]
        assert isinstance(recipe, Recipe)
        assert recipe.now.number in (last, last + 1)


def test_a_full_disk_is_refused_with_the_reason_and_the_old_file_stays(tmp_path: Path) -> None:
    RecipeFolder(tmp_path).write(CARTON_RECIPE)
    assert "Not saved: File too large." in run(FULL, tmp_path).stdout
    assert read(tmp_path) == {"carton": CARTON_RECIPE}
    assert [file.name for file in tmp_path.iterdir()] == ["carton.toml"]


@pytest.mark.parametrize(
    ("content", "code"),
    [
        (b"", "recipe_file_incomplete"),
        (recipe_text(CARTON_RECIPE).encode()[:-20], "recipe_file_no_toml"),
        (b"\xff\xfe", "recipe_file_no_toml"),
        (b"x = " + b"[" * 5000, "recipe_file_no_toml"),
        (b"#" * (MAX_FILE_BYTES + 1), "recipe_file_too_long"),
        (
            TEXT.replace("number = 1", "number = true").encode(),
            "recipe_file_incomplete",
        ),
        (
            TEXT.replace("speed = 80.0", "speed = nan").encode(),
            "recipe_file_incomplete",
        ),
        (TEXT.replace("+00:00", "").encode(), "recipe_file_incomplete"),
    ],
)
def test_a_broken_file_is_only_itself(tmp_path: Path, content: bytes, code: str) -> None:
    folder = RecipeFolder(tmp_path)
    folder.write(CARTON_RECIPE)
    (tmp_path / "broken.toml").write_bytes(content)
    entries = read(tmp_path)
    assert entries["carton"] == CARTON_RECIPE
    broken = entries["broken"]
    assert isinstance(broken, BrokenRecipe)
    assert isinstance(broken.reason, Text)
    assert broken.reason.code == code


def test_links_and_odd_names_are_not_followed(tmp_path: Path) -> None:
    folder = RecipeFolder(tmp_path / "set")
    folder.write(CARTON_RECIPE)
    outside = tmp_path / "outside.toml"
    outside.write_text(recipe_text(CARTON_RECIPE))
    os.symlink(outside, folder.path / "link.toml")
    (folder.path / "Odd name.toml").write_text("")
    entries = read(folder.path)
    assert isinstance(entries["link"], BrokenRecipe)
    assert isinstance(entries["Odd name"], BrokenRecipe)
    assert outside.read_text() == recipe_text(CARTON_RECIPE)


def test_a_folder_that_is_not_there_has_no_recipes(tmp_path: Path) -> None:
    assert read(tmp_path / "none") == {}


def pipe(path: Path) -> None:
    os.mkfifo(path)


def directory(path: Path) -> None:
    path.mkdir()


def link(path: Path) -> None:
    path.symlink_to("/dev/zero")


def socket_file(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as mine:
        mine.bind(str(path))


@pytest.mark.parametrize("make", [pipe, directory, link, socket_file])
def test_what_is_not_a_regular_file_is_not_read_and_delays_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, make: Callable[[Path], None]
) -> None:
    folder = RecipeFolder(tmp_path)
    folder.write(CARTON_RECIPE)
    monkeypatch.chdir(tmp_path)  # the path of a socket is short
    make(Path("pipe.toml"))
    entries = {entry.id: entry for entry in folder.every()}
    assert entries["carton"] == CARTON_RECIPE
    assert isinstance(entries["pipe"], BrokenRecipe)
    assert isinstance(folder.current("pipe"), BrokenRecipe)
    assert folder.names() == {"carton": "carton"}

"""Files below a folder: no link and no race leads out of it. Needs root, as an installation does."""

import ctypes
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from app.tools.install.file_tree import FileTree, OutsideError

SECRET = b"root:$6$secret"
AT_FDCWD, RENAME_EXCHANGE = -100, 2  # renameat2(2)


@pytest.fixture
def outside(tmp_path: Path) -> Path:
    """A folder that no tree has, with root's file in it."""
    folder = tmp_path / "outside"
    folder.mkdir()
    (folder / "shadow").write_bytes(SECRET)
    (folder / "shadow").chmod(0o600)
    return folder


@pytest.fixture
def root(tmp_path: Path, outside: Path) -> Path:
    folder = tmp_path / "root"
    folder.mkdir()
    return folder


LINKS = ("{outside}", "../outside", "../../../../../../../../../../../../{outside}")


@pytest.mark.parametrize("target", LINKS)
@pytest.mark.parametrize("depth", ["file", "folder", "link to a link"])
def test_no_link_is_read_out_of_a_confined_folder(
    root: Path, outside: Path, target: str, depth: str
) -> None:
    leads = target.format(outside=outside)
    path = "link/shadow"
    if depth == "file":
        path, leads = "link", f"{leads}/shadow"
    (root / "link").symlink_to(leads)
    if depth == "link to a link":
        (root / "link").rename(root / "other")
        (root / "link").symlink_to("other")
    assert (root / path).read_bytes() == SECRET, "the system follows it"
    with pytest.raises(OutsideError):
        FileTree(root, confined=True).read(path)
    assert not FileTree(root, confined=True).is_file(path)


def test_links_inside_are_followed(root: Path) -> None:
    """As colcon makes them with --symlink-install."""
    (root / "src/msg").mkdir(parents=True)
    (root / "src/msg/Jog.msg").write_bytes(b"float64 speed\n")
    (root / "install").mkdir()
    (root / "install/Jog.msg").symlink_to(root / "src/msg/Jog.msg")
    (root / "install/msg").symlink_to("../src/msg/.")
    tree = FileTree(root, confined=True)
    assert tree.read("install/Jog.msg") == b"float64 speed\n"
    assert tree.read("./install/msg/../../install/msg/Jog.msg") == b"float64 speed\n"
    assert tree.names("install/msg") == ["Jog.msg"]


def test_links_that_lead_to_each_other_end(root: Path) -> None:
    (root / "a").symlink_to("b")
    (root / "b").symlink_to("a")
    with pytest.raises(OSError, match="symbolic links"):
        FileTree(root).read("a")
    assert not FileTree(root).exists("a")


@pytest.mark.parametrize("target", ["/private/etc", "private/etc", "../../../../private/etc"])
def test_the_links_of_a_machine_begin_at_its_root(root: Path, target: str) -> None:
    (root / "private/etc").mkdir(parents=True)
    (root / "etc").symlink_to(target)
    FileTree(root).write("/etc/panel.toml", b"mine")
    assert (root / "private/etc/panel.toml").read_bytes() == b"mine"
    assert FileTree(root).read("/etc/panel.toml") == b"mine"


@pytest.mark.parametrize("target", LINKS)
@pytest.mark.parametrize("planted", ["etc", "etc/panel.toml", "etc/.panel.toml.new"])
def test_writing_never_leaves_the_root_folder(
    root: Path, outside: Path, planted: str, target: str
) -> None:
    leads = target.format(outside=outside)
    link = root / planted
    link.parent.mkdir(exist_ok=True)
    link.symlink_to(leads if planted == "etc" else f"../{leads}/shadow")
    FileTree(root).write("/etc/panel.toml", b"mine")
    assert {path.name: path.read_bytes() for path in outside.iterdir()} == {"shadow": SECRET}
    assert FileTree(root).read("/etc/panel.toml") == b"mine"


def test_removal_never_leaves_the_root_folder(root: Path, outside: Path) -> None:
    (root / "opt").symlink_to(outside.parent)
    (root / "other").symlink_to(outside)
    assert not FileTree(root).remove_tree("/opt/outside")
    with pytest.raises(OSError, match="symbolic link"):
        FileTree(root).remove_tree("/other")
    assert (outside / "shadow").exists()


def test_a_replaced_file_keeps_its_mode_and_owner(root: Path) -> None:
    tree, file = FileTree(root), root / "zenoh.json5"
    tree.write("zenoh.json5", b"first")
    assert file.stat().st_mode & 0o777 == 0o644
    file.chmod(0o640)
    os.chown(file, 0, 4321)
    tree.copy("zenoh.json5", "zenoh.json5.before")
    tree.write("zenoh.json5", b"second")
    for name, content in (("zenoh.json5", b"second"), ("zenoh.json5.before", b"first")):
        about = (root / name).stat()
        assert (about.st_mode & 0o777, about.st_gid) == (0o640, 4321)
        assert (root / name).read_bytes() == content


def test_a_second_name_of_another_users_file_is_not_read(root: Path, outside: Path) -> None:
    os.chown(root, 4321, 4321)
    os.link(outside / "shadow", root / "plan.svg")
    with pytest.raises(OutsideError, match="another user's file"):
        FileTree(root, confined=True).read("plan.svg")


def test_only_regular_files_are_read(root: Path) -> None:
    os.mkfifo(root / "pipe.svg")
    (root / "folder.svg").mkdir()
    for name in ("pipe.svg", "folder.svg"):
        with pytest.raises(OSError, match="not a regular file"):
            FileTree(root, confined=True).read(name)
        assert not FileTree(root, confined=True).is_file(name)


@contextmanager
def swapping(folder: Path, outside: Path) -> Iterator[None]:
    """`folder` is a folder and a link to `outside`, in turn."""
    done = threading.Event()
    link = folder.with_name("link")
    link.symlink_to(outside)
    exchange = ctypes.CDLL(None).renameat2

    def swap() -> None:
        while not done.is_set():
            exchange(AT_FDCWD, bytes(folder), AT_FDCWD, bytes(link), RENAME_EXCHANGE)

    thread = threading.Thread(target=swap)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def test_a_folder_that_becomes_a_link_at_any_moment_is_not_read_through(
    root: Path, outside: Path
) -> None:
    (root / "pages").mkdir()
    (root / "pages/shadow").write_bytes(b"mine")
    tree = FileTree(root, confined=True)
    read, refused = set[bytes](), 0
    with swapping(root / "pages", outside):
        while not read or not refused:
            try:
                read.add(tree.read("pages/shadow"))
            except OutsideError:
                refused += 1
            except OSError:  # a link in the moment that it is opened as a folder
                continue
    assert read == {b"mine"}


def test_a_folder_that_becomes_a_link_at_any_moment_is_not_written_through(
    root: Path, outside: Path
) -> None:
    (root / "pages").mkdir()
    tree = FileTree(root)
    with swapping(root / "pages", outside):
        for _ in range(300):
            with suppress(OSError):
                tree.write("/pages/shadow", b"mine")
    assert {path.name: path.read_bytes() for path in outside.iterdir()} == {"shadow": SECRET}

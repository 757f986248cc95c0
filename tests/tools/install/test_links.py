"""What an installation must not copy, and where it must not write: links, second names, other files."""

import os
from pathlib import Path

import pytest

from app.system.errors import SettingsError
from app.tools.cli.install import main
from app.tools.install.host import Host
from app.tools.install.plan import PANEL, Options, steps, uninstall_steps
from app.tools.install.release import (
    BASE,
    RELEASES,
    Release,
    forget,
    link_to,
    linked,
    remove_old,
    wheel_in,
)
from app.tools.install.steps import apply, revert
from tests.tools.install.test_plan import make_wheel, of_files, path_on, tree

SECRET = "root:$6$secret"
ETC = "/etc/operator-panel"
PAGE = '[[page]]\nid = "a"\n'


@pytest.fixture
def outside(tmp_path: Path) -> Path:
    """A folder of root's."""
    folder = tmp_path / "outside"
    (folder / "msg").mkdir(parents=True)
    for name in ("shadow", "plan.svg", "msg/Key.msg", "panel.toml"):
        (folder / name).write_text(SECRET)
        (folder / name).chmod(0o600)
    return folder


@pytest.fixture
def host(tmp_path: Path) -> Host:
    root = tmp_path / "root"
    (root / "etc").mkdir(parents=True)
    (root / "etc/os-release").write_text('ID=debian\nVERSION_ID="12"\n')
    return Host(root)


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    """The panel file of a user, in a folder of that user's."""
    folder = tmp_path / "mine"
    folder.mkdir()
    os.chown(folder, 4321, 4321)
    return folder / "cell1.toml"


def install(host: Host, panel: Path, zenoh: Path | None = None) -> None:
    wheel = make_wheel(host.root.parent / "wheel")
    apply(of_files(steps(Options(wheel=wheel, panel=panel, zenoh=zenoh), host)), host, str)


@pytest.mark.parametrize(
    ("named", "link", "target"),
    [
        (PAGE + 'template = "a.html"', "a.html", "shadow"),
        (PAGE + 'styles = "css/a.css"', "css/a.css", "shadow"),
        (PAGE + 'template = "pages/shadow"', "pages", "."),
        ('pictures = "plans"', "plans/plan.svg", "plan.svg"),
        ('[[font]]\nregular = "a.ttf"', "a.ttf", "shadow"),
        ('pictures = "plans"', "plans", "."),
        ('interfaces = ["cell_msgs"]', "cell_msgs/msg/Key.msg", "msg/Key.msg"),
        ('interfaces = ["cell_msgs"]', "cell_msgs/msg", "msg"),
        ('interfaces = ["cell_msgs"]', "cell_msgs", "."),
    ],
)
@pytest.mark.parametrize("relative", [False, True])
def test_a_link_to_roots_file_is_not_copied_and_named(
    host: Host, mine: Path, outside: Path, named: str, link: str, target: str, relative: bool
) -> None:
    mine.write_text(f"{named}\n")
    path = mine.parent / link
    path.parent.mkdir(parents=True, exist_ok=True)
    leads = outside / target
    path.symlink_to(os.path.relpath(leads, path.parent) if relative else leads)
    with pytest.raises(SettingsError, match="has only what is really below its own folder"):
        install(host, mine)
    assert list(tree(host.root)) == ["etc/os-release"]


def test_a_link_that_comes_after_the_plan_is_not_copied(host: Host, mine: Path, outside: Path) -> None:
    mine.write_text(f'{PAGE}template = "a.html"\n')
    template = mine.parent / "a.html"
    template.write_text("<p></p>")
    plan = of_files(steps(Options(wheel=make_wheel(host.root.parent / "w"), panel=mine), host))
    template.unlink()
    template.symlink_to(outside / "shadow")
    with pytest.raises(OSError, match="it is a link to"):
        apply(plan, host, str)
    assert not any(SECRET in text for text in tree(host.root).values())


@pytest.mark.parametrize("option", ["panel", "zenoh"])
def test_the_users_file_itself_is_not_a_link_to_roots(
    host: Host, mine: Path, outside: Path, option: str
) -> None:
    mine.write_text("")
    link = mine.with_name("link")
    link.symlink_to(outside / "shadow")
    with pytest.raises(SettingsError, match=r"link is not installed: .*\. Name that file itself"):
        install(host, link) if option == "panel" else install(host, mine, zenoh=link)


def test_a_link_beside_the_panel_file_is_followed(host: Host, mine: Path) -> None:
    (mine.parent / "v2.toml").write_text("# second\n")
    mine.symlink_to("v2.toml")
    install(host, mine)
    assert path_on(host, PANEL).read_text() == "# second\n"


def test_a_second_name_of_roots_file_is_not_copied(host: Host, mine: Path, outside: Path) -> None:
    mine.write_text('pictures = "plans"\n')
    (mine.parent / "plans").mkdir()
    os.link(outside / "plan.svg", mine.parent / "plans/plan.svg")
    with pytest.raises(SettingsError, match="a second name of another user's file"):
        install(host, mine)


@pytest.mark.parametrize("name", [".", "./", "./."])
def test_pictures_have_a_folder_of_their_own(host: Host, mine: Path, name: str) -> None:
    mine.write_text(f'pictures = "{name}"\n')
    with pytest.raises(SettingsError, match=r'such as pictures = "pictures"'):
        install(host, mine)


def test_only_pictures_are_copied_from_their_folder(host: Host, mine: Path) -> None:
    mine.write_text('pictures = "plans"\n')
    (mine.parent / "plans").mkdir()
    for name in ("plan.svg", "panel.toml", "notes.txt"):
        (mine.parent / "plans" / name).write_text(name)
    install(host, mine)
    assert sorted(file.name for file in path_on(host, f"{ETC}/plans").iterdir()) == ["plan.svg"]


@pytest.mark.parametrize("name", ["panel.toml", "zenoh.json5", "kiosk.toml", "./panel.toml.before"])
@pytest.mark.parametrize("key", ["template", "styles"])
def test_no_file_of_the_installation_is_replaced(host: Host, mine: Path, name: str, key: str) -> None:
    mine.write_text(f'{PAGE}{key} = "{name}"\n')
    (mine.parent / name).write_text("<p></p>")
    with pytest.raises(SettingsError, match="is the name of a file of the installation"):
        install(host, mine)


def test_installed_files_are_readable_by_the_servers_user(
    host: Host, mine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also from a shell of root's that keeps its files for itself."""
    mine.write_text(f'{PAGE}template = "pages/a.html"\n')
    (mine.parent / "pages").mkdir()
    (mine.parent / "pages/a.html").write_text("<p></p>")
    (mine.parent / "pages/a.html").chmod(0o600)
    wheel = make_wheel(host.root.parent / "wheel")
    plan = of_files(steps(Options(wheel=wheel, panel=mine), host))
    monkeypatch.setattr("app.tools.cli.install.steps", lambda *_: plan)
    before = os.umask(0o077)
    try:
        assert main([str(wheel), "--root", str(host.root), "--panel", str(mine), "--yes"]) == 0
    finally:
        os.umask(before)
    for name in ("panel.toml", "pages/a.html", "pages", ""):
        mode = path_on(host, f"{ETC}/{name}").stat().st_mode & 0o777
        assert mode == (0o755 if "." not in name else 0o644), name


@pytest.mark.parametrize("absolute", [False, True])
@pytest.mark.parametrize(
    ("planted", "target"),
    [
        ("etc/operator-panel", "."),
        ("etc/operator-panel/panel.toml", "panel.toml"),
        ("etc/operator-panel/.panel.toml.new", "panel.toml"),
        ("etc/operator-panel/panel.toml.before", "panel.toml"),
        ("etc/operator-panel/plans", "."),
        ("etc/systemd", "."),
        ("etc/chromium/policies", "."),
    ],
)
def test_a_link_in_the_root_leads_nowhere_else(
    host: Host, mine: Path, outside: Path, planted: str, target: str, absolute: bool
) -> None:
    mine.write_text('pictures = "plans"\n')
    (mine.parent / "plans").mkdir()
    (mine.parent / "plans/plan.svg").write_text("<svg/>")
    before = tree(outside)
    link = host.root / planted
    link.parent.mkdir(parents=True, exist_ok=True)
    link.symlink_to(outside / target if absolute else os.path.relpath(outside / target, link.parent))
    if planted.endswith(".before"):
        (link.parent / "panel.toml").write_text("# first\n")
    install(host, mine)
    revert(of_files(uninstall_steps(host)), host, str)
    assert tree(outside) == before
    assert Host(host.root).files.read(PANEL).decode() == mine.read_text()


def test_a_release_is_made_used_and_removed_inside_of_the_root(
    host: Host, outside: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its folder is a link out of the root, which begins at the root as for what runs in it."""
    monkeypatch.setattr(Host, "run", lambda *_: "")
    (outside / "releases").mkdir()
    before = tree(outside)
    (host.root / "opt").mkdir()
    (host.root / BASE.lstrip("/")).symlink_to(outside)
    wheels = tmp_path / "wheels"
    wheels.mkdir()
    (wheels / "some.whl").write_bytes(b"a wheel")
    (wheels / "folder").mkdir()
    (wheels / "shadow.whl").symlink_to(outside / "shadow")
    release = Release(wheel=make_wheel(tmp_path), lock="", wheels=wheels)
    with pytest.raises(OSError, match="it is a link to"):
        release.do(host)
    (wheels / "shadow.whl").unlink()
    release.do(host)
    assert release.is_done(host)
    assert wheel_in(host, release.name) == release.wheel.read_bytes()
    link_to(host, "current", release.name)
    host.files.make_folder(f"{RELEASES}/0.0.1-a")
    remove_old(host)
    assert host.files.names(RELEASES) == [release.name]
    link_to(host, "previous", release.name)
    forget(host, release.name)
    assert linked(host, "previous") == ""
    assert tree(outside) == before
    with pytest.raises(OSError, match="symbolic link"):
        release.undo(host)
    assert tree(outside) == before

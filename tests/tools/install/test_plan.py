"""Installing into a folder that becomes a machine: what is said, done, done again and taken back."""

import json
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from app.system.errors import SettingsError
from app.tools.cli.install import main as install
from app.tools.install.host import Host, StepFailed, release_of
from app.tools.install.panel_files import UsersCopy
from app.tools.install.plan import PANEL, SCREEN, SERVER, Options, own_files, steps, touch_rule
from app.tools.install.release import (
    Assets,
    Current,
    Release,
    checked_wheel,
    link_to,
    linked,
    release_name,
)
from app.tools.install.steps import (
    InstallStep,
    Masked,
    OwnFile,
    Packages,
    Unit,
    User,
    UsersFile,
    apply,
    describe,
    revert,
)
from tests.support.parts import ROOT

pytestmark = pytest.mark.promise("kiosk")

SHIPPED = {
    "app/panel.toml": "app/panel.toml",
    "app/zenoh.json5": "zenoh.json5",
    **{
        f"app/deploy/{path.name}": f"deploy/{path.name}"
        for path in (ROOT / "deploy").iterdir()
        if path.is_file()
    },
}


def make_wheel(folder: Path, version: str = "0.1.0", **changed: str) -> Path:
    """A wheel with the shipped files only, some of them changed."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"operator_panel-{version}-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for name, source in SHIPPED.items():
            archive.writestr(name, changed.get(source, (ROOT / source).read_text()))
    return path


def path_on(host: Host, path: str) -> Path:
    """Where an absolute path of the machine is."""
    return host.root / path.lstrip("/")


def of_files(plan: list[InstallStep]) -> list[InstallStep]:
    """The steps that need no program of the machine."""
    return [step for step in plan if isinstance(step, (OwnFile, UsersCopy, UsersFile, Masked))]


def tree(root: Path) -> dict[str, str]:
    contents = {}
    for path in sorted(root.rglob("*")):
        name = str(path.relative_to(root))
        if path.is_symlink():
            contents[name] = f"-> {path.readlink()}"
        elif path.is_file():
            contents[name] = path.read_text()
    return contents


def test_the_plan_says_each_step_before_anything_is_changed(host: Host, tmp_path: Path) -> None:
    before = tree(host.root)
    plan = steps(Options(wheel=make_wheel(tmp_path)), host)
    said = list(describe(plan, host))
    assert tree(host.root) == before
    assert all(line.startswith("to do ") for line in said)
    for about in ("chromium", "sway", "/opt/operator-panel/releases/0.1.0-", PANEL, SERVER, SCREEN):
        assert any(about in line for line in said), about


def test_files_are_written_once_and_taken_back_but_the_users_stay(host: Host, tmp_path: Path) -> None:
    before = tree(host.root)
    plan = of_files(steps(Options(wheel=make_wheel(tmp_path), touch_matrix=("1",) * 6), host))
    assert apply(plan, host, str) == len(plan)
    written = tree(host.root)
    assert apply(plan, host, str) == 0
    assert tree(host.root) == written
    policies = json.loads(written["etc/chromium/policies/managed/operator-panel.json"])
    assert "*" in policies["URLBlocklist"]

    said: list[str] = []
    revert(plan, host, said.append)
    kept = {"etc/operator-panel/panel.toml", "etc/operator-panel/zenoh.json5"}
    kept.add("etc/operator-panel/kiosk.toml")
    assert tree(host.root).keys() - before.keys() == kept
    assert f"kept {PANEL}" in said


def test_users_panel_is_kept_by_the_next_run_and_replaced_by_a_new_panel(
    host: Host, tmp_path: Path
) -> None:
    wheel = make_wheel(tmp_path)
    mine = tmp_path / "cell1.toml"
    mine.write_text("# first\n")
    apply(of_files(steps(Options(wheel=wheel, panel=mine), host)), host, str)
    apply(of_files(steps(Options(wheel=wheel), host)), host, str)
    assert path_on(host, PANEL).read_text() == "# first\n"
    mine.write_text("# second\n")
    apply(of_files(steps(Options(wheel=wheel, panel=mine), host)), host, str)
    assert path_on(host, PANEL).read_text() == "# second\n"
    assert path_on(host, f"{PANEL}.before").read_text() == "# first\n"


def test_files_that_the_panel_names_are_installed_with_the_panel(host: Host, tmp_path: Path) -> None:
    package = tmp_path / "install/cell_msgs/share/cell_msgs"
    files = {
        "install/cell_msgs/share/cell_msgs/msg/Jog.msg": "float64 speed\n",
        "install/cell_msgs/share/cell_msgs/package.xml": "<name>cell_msgs</name>",
        "pictures/plan.svg": "<svg/>",
        "pages/cell.html": "{{ widget('start') }}",
        "fonts/regular.ttf": "letters",
        "fonts/bold.ttf": "bold letters",
        "maps/hall.geojson": "zones",
        "maps/ways.geojson": "routes",
    }
    for name, text in {**files, "install/cell_msgs/lib/driver": "a program"}.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    mine, wheel = tmp_path / "cell1.toml", make_wheel(tmp_path)
    mine.write_text(
        f'interfaces = ["install", "{package}"]\npictures = "./pictures"\n'
        '[[page]]\ntemplate = "pages/cell.html"\n'
        '[[font]]\nregular = "fonts/regular.ttf"\nbold = "fonts/bold.ttf"\n'
        '[[zone_file]]\nfile = "maps/hall.geojson"\n'
        '[[page]]\n[[page.widget]]\nroutes = { file = "maps/ways.geojson" }\n'
    )

    def plan() -> list[InstallStep]:
        return of_files(steps(Options(wheel=wheel, panel=mine), host))

    assert "copy pictures into /etc/operator-panel (1 file)" in "\n".join(describe(plan(), host))
    apply(plan(), host, str)
    etc = tree(path_on(host, "/etc/operator-panel"))
    assert {name: text for name, text in etc.items() if "/" in name} == files
    assert apply(plan(), host, str) == 0
    (tmp_path / "pictures/plan.svg").write_text("<svg>2</svg>")
    assert apply(plan(), host, str) == 1
    said: list[str] = []
    revert(plan(), host, said.append)
    assert "kept /etc/operator-panel/pictures" in said


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('pictures = "../plans"', r'cell1\.toml names "\.\./plans", which is not below its own folder'),
        ('interfaces = ["msgs"]', r'cell1\.toml names "msgs", and .*/msgs is not there'),
    ],
)
def test_file_that_cannot_be_installed_is_named_before_any_change(
    host: Host, tmp_path: Path, line: str, said: str
) -> None:
    mine = tmp_path / "cell1.toml"
    mine.write_text(f"{line}\n")
    with pytest.raises(SettingsError, match=said):
        steps(Options(wheel=make_wheel(tmp_path), panel=mine), host)


def test_units_of_another_version_replace_those_that_are_there(host: Host, tmp_path: Path) -> None:
    apply(own_files(Assets(make_wheel(tmp_path / "1")), True), host, str)
    other = make_wheel(tmp_path / "2", "0.2.0", **{f"deploy/{SERVER}": "# other\n"})
    assert apply(own_files(Assets(other), True), host, str) == 1
    assert path_on(host, f"/etc/systemd/system/{SERVER}").read_text() == "# other\n"


def test_the_server_alone_needs_no_screen(host: Host, tmp_path: Path) -> None:
    plan = steps(Options(wheel=make_wheel(tmp_path), screen=False), host)
    said = "\n".join(describe(plan, host))
    assert [word for word in ("sway", "chromium", "kiosk", "user") if word in said] == []
    assert SERVER in said


@pytest.mark.parametrize(
    ("system", "said"),
    [
        ('ID=fedora\nVERSION_ID="42"\n', "fedora 42 is not supported"),
        ('ID=debian\nVERSION_ID="11"\n', "debian 11 is not supported"),
        ('ID=ubuntu\nVERSION_ID="24.04"\n', "Ubuntu's Chromium is a snap"),
    ],
)
def test_a_system_that_can_not_be_used_is_named(
    host: Host, tmp_path: Path, system: str, said: str
) -> None:
    path_on(host, "/etc/os-release").write_text(system)
    with pytest.raises(SettingsError, match=said):
        steps(Options(wheel=make_wheel(tmp_path)), host)


def test_ubuntu_with_chrome_is_good(host: Host, tmp_path: Path) -> None:
    path_on(host, "/etc/os-release").write_text('ID=ubuntu\nVERSION_ID="24.04"\n')
    chrome = path_on(host, "/usr/bin/google-chrome-stable")
    chrome.parent.mkdir(parents=True)
    chrome.touch()
    packages = steps(Options(wheel=make_wheel(tmp_path)), host)[0]
    assert isinstance(packages, Packages)
    assert "chromium" not in packages.names
    assert release_of(host) == ("ubuntu", "24.04")


@pytest.mark.parametrize("matrix", [("1", "0"), ("1", "0", "0", "0", "1", "$(x)")])
def test_a_calibration_that_is_none_is_named(matrix: tuple[str, ...]) -> None:
    with pytest.raises(SettingsError, match="six numbers"):
        touch_rule(matrix)


def test_udev_accepts_the_rule_of_the_touch_screen() -> None:
    rule = touch_rule(("0", "-1", "1", "1", "0", "0"))
    assert 'ENV{LIBINPUT_CALIBRATION_MATRIX}="0 -1 1 1 0 0"' in rule


@pytest.mark.parametrize("option", ["panel", "zenoh"])
def test_users_file_never_counts_as_the_shipped_file(host: Host, tmp_path: Path, option: str) -> None:
    mine = tmp_path / "mine"
    mine.write_bytes(b"")
    wheel = make_wheel(tmp_path)
    options = (
        Options(wheel=wheel, panel=mine) if option == "panel" else Options(wheel=wheel, zenoh=mine)
    )
    apply(of_files(steps(options, host)), host, str)
    name = {"panel": PANEL, "zenoh": "/etc/operator-panel/zenoh.json5"}[option]
    assert path_on(host, name).read_text() == ""
    mine.write_bytes(b'title = "caf\xe9"\n')
    with pytest.raises(SettingsError, match="mine can't be read: it is not UTF-8 text"):
        steps(options, host)


def test_a_file_in_another_encoding_is_replaced(host: Host, tmp_path: Path) -> None:
    path_on(host, PANEL).parent.mkdir(parents=True)
    path_on(host, PANEL).write_bytes(b"# caf\xe9\n")
    mine = tmp_path / "cell1.toml"
    mine.write_text("# mine\n")
    apply(of_files(steps(Options(wheel=make_wheel(tmp_path), panel=mine), host)), host, str)
    assert path_on(host, PANEL).read_text() == "# mine\n"
    assert path_on(host, f"{PANEL}.before").read_bytes() == b"# caf\xe9\n"


def test_a_unit_that_is_linked_elsewhere_is_not_masked_and_is_kept(host: Host) -> None:
    masked = Masked(unit="ctrl-alt-del.target", about="")
    link = path_on(host, masked.path)
    link.parent.mkdir(parents=True)
    link.symlink_to("/lib/systemd/system/reboot.target")
    assert not masked.is_done(host)
    with pytest.raises(
        StepFailed, match=r"ctrl-alt-del\.target is not of this installation: remove it"
    ):
        masked.do(host)
    assert masked.undo(host) == ""
    assert link.is_symlink()


class Started(Unit):
    """A unit that runs."""

    def is_done(self, host: Host) -> bool:
        return True

    def do(self, host: Host) -> None:
        path_on(host, "/started").touch()


@pytest.mark.parametrize("changed", [False, True])
def test_a_unit_that_runs_is_started_again_when_something_changed(host: Host, changed: bool) -> None:
    file = OwnFile(path="/etc/x", content="new", about="")
    path_on(host, "/etc/x").write_text("old" if changed else "new")
    assert apply([file, Started(SERVER)], host, str) == 2 * changed
    assert path_on(host, "/started").exists() is changed


def test_an_installed_release_has_its_wheel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    with pytest.raises(SettingsError, match="the wheel is missing"):
        checked_wheel(None)
    wheel = make_wheel(tmp_path)
    assert checked_wheel(None) == wheel


def test_a_user_is_there_when_the_machine_has_it(host: Host) -> None:
    user = User("operator-kiosk", "")
    assert not user.is_done(host)
    assert user.undo(host) == ""
    with path_on(host, "/etc/passwd").open("a") as file:
        file.write("operator-kiosk:x:999:999::/:/usr/sbin/nologin\n")
    assert user.is_done(host)


def test_a_release_that_was_cut_off_is_no_release(host: Host, tmp_path: Path) -> None:
    release = Release(wheel=make_wheel(tmp_path), lock="")
    path_on(host, f"{release.folder}/bin").mkdir(parents=True)
    assert not release.is_done(host)
    path_on(host, f"{release.folder}/.complete").touch()
    assert release.is_done(host)


def test_only_the_release_that_runs_and_the_one_before_stay(host: Host) -> None:
    names = ["0.1.0-a", "0.2.0-b", "0.3.0-c"]
    for name in names[:2]:
        path_on(host, f"/opt/operator-panel/releases/{name}").mkdir(parents=True)
    link_to(host, "current", names[0])
    Current(names[1]).do(host)
    assert (linked(host, "previous"), linked(host, "current")) == (names[0], names[1])
    path_on(host, f"/opt/operator-panel/releases/{names[2]}").mkdir()
    Current(names[2]).do(host)
    assert (linked(host, "previous"), linked(host, "current")) == (names[1], names[2])
    left = {path.name for path in path_on(host, "/opt/operator-panel/releases").iterdir()}
    assert left == set(names[1:])


def test_two_builds_of_one_version_are_two_releases(tmp_path: Path) -> None:
    first, second = make_wheel(tmp_path / "1"), make_wheel(tmp_path / "2", **{"app/panel.toml": "x"})
    assert release_name(first) != release_name(second)


@pytest.mark.parametrize("name", ["missing.whl", "other-1.0-py3-none-any.whl"])
def test_foreign_wheel_is_named(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    if name.startswith("other"):
        path.touch()
    with pytest.raises(SettingsError, match=r"is no wheel of the operator panel"):
        checked_wheel(path)


def test_a_command_that_fails_says_why() -> None:
    with pytest.raises(StepFailed, match="boom"):
        Host().run(["sh", "-c", "echo boom >&2; exit 3"])
    with pytest.raises(StepFailed, match="no-such-command can't be run"):
        Host().run(["no-such-command"])


def test_a_command_of_the_machine_does_not_read_this_programs_modules(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("PYTHONPATH", "/elsewhere")
    assert Host().run(["sh", "-c", 'printf %s "$PYTHONPATH"']) == ""


@pytest.mark.parametrize(("options", "units"), [([], [SERVER, SCREEN]), (["--no-screen"], [SERVER])])
def test_end_of_the_installation_names_the_status_command(
    options: list[str],
    units: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(Host, "runs_systemd", True)
    monkeypatch.setattr("app.tools.cli.install.steps", lambda *_: [])
    assert install([str(make_wheel(tmp_path)), "--yes", *options]) == 0
    assert capsys.readouterr().out.splitlines()[1:] == [
        f"see whether it runs: systemctl status {' '.join(units)}"
    ]


def test_the_command_runs_from_the_wheels_file_with_nothing_installed(
    host: Host, tmp_path: Path
) -> None:
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(tmp_path)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True, timeout=120)
    (wheel,) = tmp_path.glob("*.whl")
    # -S: none of the packages that this Python has.
    command = [sys.executable, "-S", "-m", "app.cli", "install", f"--root={host.root}"]
    before = tree(host.root)

    def run(*more: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [*command, *more],
            cwd=tmp_path,
            env={"PATH": "/usr/bin:/bin", "PYTHONPATH": str(wheel)},
            capture_output=True,
            text=True,
            check=False,
            stdin=subprocess.DEVNULL,
        )

    dry = run("--dry-run")
    assert dry.returncode == 0, dry.stderr
    assert f"install {wheel.name} into" in dry.stdout
    unasked = run()
    assert (unasked.returncode, unasked.stderr) == (
        2,
        "nothing was changed: add --yes to go on without a question\n",
    )
    assert tree(host.root) == before

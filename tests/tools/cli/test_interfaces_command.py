"""`operator-panel interfaces`: definitions are copied beside a panel, whole packages or nothing."""

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import pytest

from app.ros.messages import load_interfaces
from app.ros.messages.package_copy import copy_packages, find_packages, opened_source
from app.system.errors import InterfaceError
from app.tools.cli.interfaces import main

NAV: Final = {
    "nav2_msgs/package.xml": "<package><name>nav2_msgs</name></package>",
    "nav2_msgs/msg/Costmap.msg": "std_msgs/Header header\ngeo_msgs/GeoPoint[] points\n",
    "nav2_msgs/srv/ClearCostmap.srv": "float32 distance\n---\nstd_msgs/Empty response\n",
    "nav2_msgs/action/Wait.action": "float32 time\n---\nbool done\n---\nfloat32 left\n",
    "nav2_msgs/README.md": "not copied",
    "geo_msgs/msg/GeoPoint.msg": "float64 latitude\nother_msgs/Datum datum\n",
}


def written(folder: Path, files: Mapping[str, str]) -> Path:
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
    return folder


def files_in(folder: Path) -> set[str]:
    return {str(file.relative_to(folder)) for file in folder.rglob("*") if file.is_file()}


def test_a_package_of_an_installed_prefix_is_copied_with_what_it_needs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    datum = {"other_msgs/msg/Datum.msg": "string name\n", "unused_msgs/msg/A.msg": "bool a\n"}
    prefix = written(tmp_path / "jazzy/share", NAV | datum).parent
    target = tmp_path / "interfaces"
    arguments = ["add", "nav2_msgs", "--from", str(prefix), "--to", str(target)]
    assert main(arguments) == 0
    assert files_in(target) == {
        "nav2_msgs/msg/Costmap.msg",
        "nav2_msgs/srv/ClearCostmap.srv",
        "nav2_msgs/action/Wait.action",
        "geo_msgs/msg/GeoPoint.msg",
        "other_msgs/msg/Datum.msg",
    }
    printed = capsys.readouterr().out
    assert f"{target}/nav2_msgs: 1 message, 1 service, 1 action\n" in printed
    assert f"{target}/other_msgs: 1 message, which geo_msgs needs\n" in printed
    assert f'in the panel file: interfaces = ["{target}"]' in printed
    interfaces = load_interfaces("jazzy", [target])
    assert interfaces.field_type("nav2_msgs/msg/Costmap", "points[0].datum.name") == "string"
    assert main(arguments) == 0
    assert "1 action (as before)" in capsys.readouterr().out


def test_a_package_that_is_needed_and_nowhere_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = written(tmp_path / "src", NAV)
    assert main(["add", "nav2_msgs", "--from", str(source), "--to", str(tmp_path / "i")]) == 1
    assert "geo_msgs needs other_msgs, which is neither built in" in capsys.readouterr().err


def test_a_wheel_is_a_source(tmp_path: Path) -> None:
    wheel = tmp_path / "nav2-1.0-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for path, text in NAV.items():
            archive.writestr(f"nav2-1.0.data/data/share/{path}", text)
    with opened_source(wheel) as folder:
        copied = copy_packages(["geo_msgs"], folder, tmp_path / "i", ())
    assert [package.name for package in copied.packages] == ["geo_msgs"]
    assert copied.missing == {"other_msgs": "geo_msgs"}


@pytest.mark.parametrize("path", ["../outside/msg/A.msg", "/outside/msg/A.msg"])
def test_a_wheel_can_not_write_outside(tmp_path: Path, path: str) -> None:
    wheel = tmp_path / "bad.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr(path, "bool a\n")
    with pytest.raises(InterfaceError, match="a file outside of itself"), opened_source(wheel):
        pass


def test_a_source_that_is_no_source_says_what_would_be_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "text").write_text("nothing")
    for source, words in (("none", "is not there: it must be a folder"), ("text", "is no zip file or")):
        assert main(["add", "a_msgs", "--from", str(tmp_path / source)]) == 1
        assert words in capsys.readouterr().err
    written(tmp_path / "src", NAV)
    assert main(["add", "a_msgs", "--from", str(tmp_path / "src")]) == 1
    assert "there is no package a_msgs in the source: it has geo_msgs, nav2_msgs" in (
        capsys.readouterr().err
    )


def test_a_broken_definition_is_not_copied_and_the_old_one_stays(tmp_path: Path) -> None:
    target = written(tmp_path / "i", {"nav2_msgs/msg/Costmap.msg": "bool old\n"})
    broken = written(tmp_path / "src", {**NAV, "nav2_msgs/msg/Bad.msg": "float65 x\n"})
    with pytest.raises(InterfaceError, match=r"Bad\.msg"):
        copy_packages(["nav2_msgs"], broken, target, ())
    assert files_in(target) == {"nav2_msgs/msg/Costmap.msg"}


def test_a_full_disk_leaves_the_old_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = written(tmp_path / "i", {"nav2_msgs/msg/Costmap.msg": "bool old\n"})
    source = written(tmp_path / "src", NAV)

    def full(self: Path, data: bytes) -> int:
        raise OSError(28, "No space left on device", str(self))

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError, match="No space left"):
        copy_packages(["nav2_msgs"], source, target, ())
    assert files_in(target) == {"nav2_msgs/msg/Costmap.msg"}
    assert (target / "nav2_msgs/msg/Costmap.msg").read_text() == "bool old\n"


def test_the_package_nearest_to_the_source_counts(tmp_path: Path) -> None:
    written(tmp_path, {"a/b/c_msgs/msg/C.msg": "bool far\n", "c_msgs/msg/C.msg": "bool near\n"})
    written(tmp_path, {"build/d_msgs/msg/D.msg": "bool d\n", ".git/e_msgs/msg/E.msg": "bool e\n"})
    assert find_packages(tmp_path) == {"c_msgs": tmp_path / "c_msgs"}


def test_built_in_packages_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "std_srvs: 3 services" in lines
    assert "tf2_msgs: 2 messages, 1 service, 1 action" in lines
    assert main(["list", "std_srvs", "--distro", "humble"]) == 0
    assert capsys.readouterr().out.split() == [
        f"std_srvs/srv/{name}" for name in ("Empty", "SetBool", "Trigger")
    ]
    assert main(["list", "nav2_msgs"]) == 1
    assert "nav2_msgs is not built in" in capsys.readouterr().err


def test_a_package_of_ros_1_is_named(tmp_path: Path) -> None:
    package = tmp_path / "source/old_msgs"
    (package / "msg").mkdir(parents=True)
    (package / "msg/State.msg").write_text("Header header\nbool on\n")
    depends = "<buildtool_depend>catkin</buildtool_depend>"
    (package / "package.xml").write_text(f"<package><name>old_msgs</name>{depends}</package>")
    with pytest.raises(InterfaceError, match=r"old_msgs is a package of ROS 1"):
        copy_packages(["old_msgs"], tmp_path / "source", tmp_path / "i", ())

"""What the `KIOSK_…` variables do, and what is said of a wrong one."""

from pathlib import Path

import pytest

from app.system.errors import SettingsError
from app.system.settings import PACKAGE, SHIPPED_PANELS, Settings, panel_path, shipped_path


def test_without_variables_the_shipped_files_are_used() -> None:
    settings = Settings.from_environment({})
    assert settings.panel == PACKAGE / "panel.toml"
    assert settings.zenoh.name == "zenoh.json5"
    assert settings.panel.is_file()
    assert settings.zenoh.is_file()


def test_without_variables_the_panel_file_says_which_robot() -> None:
    assert Settings.from_environment({}).mode is None


@pytest.mark.parametrize("mode", ["demo", "live"])
def test_kiosk_mode_overrides_the_panel_file(mode: str) -> None:
    assert Settings.from_environment({"KIOSK_MODE": mode}).mode == mode


@pytest.mark.parametrize("mode", ["Demo", "simulated", " live", "0"])
def test_unknown_mode_is_refused_with_the_valid_modes(mode: str) -> None:
    with pytest.raises(SettingsError, match=f'KIOSK_MODE is "{mode}": it must be "demo" or "live"'):
        Settings.from_environment({"KIOSK_MODE": mode})


@pytest.mark.parametrize("name", ["KIOSK_PANEL", "KIOSK_ZENOH"])
def test_a_file_is_taken_from_where_the_variable_points(name: str, tmp_path: Path) -> None:
    settings = Settings.from_environment({name: str(tmp_path / "mine")})
    assert tmp_path / "mine" in (settings.panel, settings.zenoh)


def test_shipped_panel_is_named_unless_a_file_has_that_name(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mobile-robot").mkdir()
    shipped = Settings.from_environment({"KIOSK_PANEL": "mobile-robot"}).panel
    assert shipped.is_file()
    assert shipped.parent.name == "mobile-robot"
    (tmp_path / "mobile-robot").rmdir()
    (tmp_path / "mobile-robot").touch()
    assert Settings.from_environment({"KIOSK_PANEL": "mobile-robot"}).panel == tmp_path / "mobile-robot"


def test_data_lives_where_the_variable_points(tmp_path: Path) -> None:
    settings = Settings.from_environment({"KIOSK_DATA": str(tmp_path)})
    assert settings.data_folder("live") == settings.data_folder("demo") == tmp_path


def test_a_demo_keeps_its_data_apart(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    settings = Settings.from_environment({})
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert settings.data_folder("live") == tmp_path / "operator-panel"
    assert settings.data_folder("demo") == tmp_path / "operator-panel/demo"
    monkeypatch.setenv("XDG_STATE_HOME", "relative")
    assert settings.data_folder("live") == Path.home() / ".local/state/operator-panel"


@pytest.mark.parametrize(
    ("panel", "folder"),
    [("", "demo"), *((name, f"demo-{name}") for name in SHIPPED_PANELS), ("cell1.toml", "demo")],
)
def test_each_shipped_panel_has_a_data_folder_of_its_own(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, panel: str, folder: str
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    settings = Settings.from_environment({"KIOSK_PANEL": panel})
    assert settings.data_folder("demo") == tmp_path / "operator-panel" / folder
    assert settings.data_folder("live") == tmp_path / "operator-panel"
    if panel in SHIPPED_PANELS:  # by its path it is the same panel
        by_path = Settings.from_environment({"KIOSK_PANEL": str(panel_path(panel))})
        assert by_path.data_folder("demo") == settings.data_folder("demo")


def test_a_path_may_be_relative_or_start_at_home(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    settings = Settings.from_environment({"KIOSK_PANEL": "~/cell.toml", "KIOSK_ZENOH": "z.json5"})
    assert (settings.panel, settings.zenoh) == (tmp_path / "cell.toml", tmp_path / "z.json5")


@pytest.mark.parametrize(
    "name", ["KIOSK_PANEL", "KIOSK_ZENOH", "KIOSK_MODE", "KIOSK_HOSTS", "KIOSK_DEV"]
)
def test_an_empty_variable_is_as_if_it_were_not_there(name: str) -> None:
    assert Settings.from_environment({name: ""}) == Settings.from_environment({})


def test_the_panel_answers_to_loopback_names_only_by_default() -> None:
    assert Settings.from_environment({}).hosts == ("127.0.0.1", "localhost", "[::1]")


def test_kiosk_hosts_adds_names_in_lower_case() -> None:
    settings = Settings.from_environment({"KIOSK_HOSTS": " Cell1.local, ,10.0.0.7,"})
    assert settings.hosts == ("127.0.0.1", "localhost", "[::1]", "cell1.local", "10.0.0.7")


@pytest.mark.parametrize(
    ("written", "level"), [("debug", "debug"), ("WARN", "warn"), ("Fatal", "fatal")]
)
def test_the_log_level_is_one_of_ros_in_any_case(written: str, level: str) -> None:
    assert Settings.from_environment({"KIOSK_LOG_LEVEL": written}).log_level == level


@pytest.mark.parametrize("written", ["warning", "trace", "10"])
def test_an_unknown_log_level_is_refused_with_those_that_there_are(written: str) -> None:
    with pytest.raises(SettingsError, match=r"KIOSK_LOG_LEVEL .*debug, info, warn, error, fatal"):
        Settings.from_environment({"KIOSK_LOG_LEVEL": written})


@pytest.mark.parametrize(("written", "dev"), [("1", True), ("yes", True), ("0", False)])
def test_kiosk_dev_is_for_development(written: str, dev: bool) -> None:
    assert Settings.from_environment({"KIOSK_DEV": written}).dev is dev


def test_databases_live_in_the_users_state_folder(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    settings = Settings.from_environment({})
    assert settings.data_folder("live") == tmp_path / "operator-panel"
    assert settings.data_folder("demo") == tmp_path / "operator-panel/demo"
    for unset in ("", "relative/path"):
        monkeypatch.setenv("XDG_STATE_HOME", unset)
        monkeypatch.setenv("HOME", "/home/kim")
        assert settings.data_folder("live") == Path("/home/kim/.local/state/operator-panel")


def test_kiosk_data_is_the_folder_of_whatever_mode(tmp_path: Path) -> None:
    settings = Settings.from_environment({"KIOSK_DATA": str(tmp_path)})
    assert settings.data_folder("live") == settings.data_folder("demo") == tmp_path


@pytest.mark.parametrize("name", ["templates", "static", "zenoh.json5", "panel.toml"])
def test_shipped_files_are_found(name: str) -> None:
    assert shipped_path(name).exists()


@pytest.mark.parametrize("hosts", ["panel.local:8000", "::1", "http://panel", "panel/", "a b"])
def test_a_host_that_could_never_match_is_refused(hosts: str) -> None:
    with pytest.raises(SettingsError, match="KIOSK_HOSTS"):
        Settings.from_environment({"KIOSK_HOSTS": hosts})


@pytest.mark.parametrize(
    ("name", "meant"),
    [("KIOSK_PANNEL", "KIOSK_PANEL"), ("KIOSK_HOST", "KIOSK_HOSTS"), ("KIOSK_panel", "KIOSK_PANEL")],
)
def test_unknown_variable_stops_the_start_and_the_error_suggests_a_name(name: str, meant: str) -> None:
    with pytest.raises(SettingsError, match=f"^{name} is not a setting .* did you mean {meant}\\?$"):
        Settings.from_environment({name: ""})


def test_a_variable_like_no_other_gets_an_error_with_all_that_there_are() -> None:
    with pytest.raises(SettingsError, match=r"KIOSK_XYZZY .* there are KIOSK_PANEL, KIOSK_ZENOH, "):
        Settings.from_environment({"KIOSK_XYZZY": "1", "PATH": "/bin", "KIOSKS": "2"})


def test_proxies_are_addresses_and_networks_and_none_without_a_word() -> None:
    assert Settings.from_environment({}).proxies == ()
    settings = Settings.from_environment({"KIOSK_PROXIES": " 127.0.0.1, 192.0.2.0/24,,::1"})
    assert settings.proxies == ("127.0.0.1", "192.0.2.0/24", "::1")


@pytest.mark.parametrize("written", ["*", "proxy.local", "192.0.2.1/24", "127.0.0.1:80", "[::1]"])
def test_a_proxy_that_could_be_any_or_no_client_is_refused(written: str) -> None:
    with pytest.raises(SettingsError, match="KIOSK_PROXIES has "):
        Settings.from_environment({"KIOSK_PROXIES": written})
